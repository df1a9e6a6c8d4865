"""Figures of models: eigenvalues, the map of errors, partials, and presets compared, each against its definition."""

import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from app.analysis import error_plane
from app.analysis.comparison import Audible, compare
from app.analysis.error_plane import AMPLITUDES_MM, POSITIONS, ErrorPlane, error_of_plucks, nearest_cell, refine
from app.analysis.poles import pole_figure
from app.analysis.take_partials import take_partials
from app.export.wav import WavSettings
from app.presets.library import PresetEntry, list_presets
from app.rendering import Take
from app.rendering.note_sound import NoteSound
from app.shared.worker import Cancelled
from engine.compare.audible import audible_errors
from engine.compare.relative import relative_error
from engine.models import build_model
from engine.models.base import Physics
from engine.pluck import Pluck
from engine.presets import SHIPPED, Preset, PresetInfo, load_preset, read_info, save_preset
from engine.resonators.sine_transform import listening_weights, project, to_grid, to_modes
from engine.sources import ModelSource, TruthSource
from engine.values.ear import Ear
from engine.values.string import StringParameters
from tests.app.sounds import render_sound
from tests.app.takes import append_to
from training.heard import GLIDE_S, RATE_HZ


def of_family(path: Path, model: str) -> Preset:
    """The small preset with another model that starts from the physics."""
    preset, made = load_preset(path), build_model(model, {})
    how = "physics" if "physics" in made.initialisations else made.own_initialisation()
    physics = Physics(preset.info.resonator, preset.info.rate_hz)
    made.initialise(how, physics, torch.Generator().manual_seed(0))
    weights = {name: tensor.numpy() for name, tensor in made.state_dict().items()}
    return Preset(preset.name, path, replace(preset.info, model=model, model_configuration={}), weights)


@pytest.mark.parametrize("model", ["dmd", "koopman", "koopman_var", "koopman_integrated", "lru", "s5"])
def test_a_model_that_starts_from_the_string_has_its_modes(small_preset, model):
    preset = of_family(small_preset, model)
    figure, own = pole_figure(preset), preset.info.resonator
    own_hz = own.eigenvalues().imag / (2 * math.pi)
    assert own_hz[-1] > 2000  # half the rate: it folds to where it is heard
    np.testing.assert_allclose(figure.string.mode_hz, own_hz)
    np.testing.assert_allclose(figure.string.folded_hz, np.minimum(own_hz, 4000 - own_hz))
    np.testing.assert_allclose(figure.string.t60_s, math.log(1000) / own.sigma)
    assert (figure.string.mode == np.arange(1, 11)).all()
    assert (np.abs(figure.string.cents) < 1e-6).all()
    for mode in range(1, 11):
        found = (figure.learned.layer == 0) & (figure.learned.mode == mode)
        best = np.abs(figure.learned.cents[found]).argmin()
        assert figure.learned.cents[found][best] == pytest.approx(0, abs=0.5)
        assert figure.learned.mode_hz[found][best] == pytest.approx(own_hz[mode - 1], rel=1e-3)


def test_of_a_conjugate_pair_one_is_shown_and_what_grows_has_no_decay_time(small_preset):
    preset = of_family(small_preset, "dmd")
    assert len(pole_figure(preset).learned) == 10  # of 20 that are there and 50 that could be
    with torch.no_grad():
        preset.model.magnitude_log[0] = 0.01  # type: ignore[operator,union-attr,index]
    assert np.isinf(pole_figure(preset).learned.t60_s).sum() == 1


def test_a_sharp_eigenvalue_is_so_many_cents_high(small_preset):
    preset = load_preset(small_preset)
    with torch.no_grad():
        preset.model.theta_log += math.log(2 ** (10 / 1200))  # type: ignore[operator,union-attr]
    learned = pole_figure(preset).learned
    np.testing.assert_allclose(learned.cents[learned.mode_hz < 1500], 10, atol=0.01)


@pytest.mark.parametrize("model", ["fgru", "frnn"])
def test_a_model_without_eigenvalues_says_so(small_preset, model):
    figure = pole_figure(of_family(small_preset, model))
    assert (len(figure.learned), figure.layers, len(figure.string)) == (0, 0, 10)
    assert f"a {model} has no eigenvalues" in figure.note


def test_interpolation_keeps_its_points_and_is_linear_between():
    coarse = np.array([[0.0, 4.0], [8.0, 12.0], [8.0, math.inf]])
    fine = refine(coarse, 4)
    assert fine.shape == (9, 5)
    np.testing.assert_array_equal(fine[::4, ::4], coarse)
    np.testing.assert_allclose(fine[2], [4, 5, 6, 7, 8])
    assert np.isfinite(fine[:5]).all() and not np.isnan(fine).any()


def test_coarse_first_and_nothing_twice(monkeypatch, job):
    asked: list[tuple[int, int]] = []

    def errors(plucks: list[Pluck], job: object) -> np.ndarray:
        asked.extend(nearest_cell(p.position, p.amplitude_mm) for p in plucks)
        return np.array([p.position * p.amplitude_mm for p in plucks])

    monkeypatch.setattr(error_plane, "error_of_plucks", lambda preset: errors)
    plane, preset = ErrorPlane(), Any
    assert plane.picture() is None
    job.cancel_after = 40
    with pytest.raises(Cancelled):
        plane.compute(preset, Pluck(), job)
    assert asked[:12] == [(x, y) for x in range(0, 49, 16) for y in range(0, 33, 16)]
    job.cancel_after = None
    whole = plane.compute(preset, Pluck(), job)
    assert len(asked) == len(set(asked)) == 49 * 33
    np.testing.assert_allclose(whole.error, POSITIONS[:, None] * AMPLITUDES_MM, rtol=1e-9)
    assert whole.at(POSITIONS[3] + 0.005, 1.01 * AMPLITUDES_MM[5]) == whole.error[3, 5]
    assert [found.spacing for found in job.results] == [16, 8, 4, 4, 2, 1], "the second computation finds a 4"
    assert [nearest_cell(0.5, 0.5), nearest_cell(2.0, 0.0)] == [(24, 0), (48, 0)]


def test_errors_are_those_of_the_sources_and_infinite_where_they_are_not_finite(small_preset, job):
    preset, plucks = load_preset(small_preset), [Pluck(0.3, 2.0), Pluck(0.62, 9.0, "triangular")]
    for pluck, error in zip(plucks, error_of_plucks(preset)(plucks, job), strict=True):
        initial = project(pluck.displacement(101), 10)[None]
        model, truth = (
            source.advance(source.start(initial), 400)[0]
            for source in (ModelSource(preset), TruthSource(preset.info))
        )
        assert error == pytest.approx(relative_error(model, truth).rel_mae, rel=1e-3)
    with torch.no_grad():
        next(preset.model.parameters()).fill_(math.inf)
    assert np.isinf(error_of_plucks(preset)(plucks, job)).all()


@pytest.fixture
def info(small_preset: Any) -> PresetInfo:
    return replace(read_info(small_preset), tension_modulated=False)


def take_of(info: PresetInfo, position: float, first: float = 1.0, model: StringParameters | None = None) -> Take:
    """A linear string, and beside it one with a first mode of another level and, where asked, another string."""
    pluck = Pluck(position, 4.0)
    take = Take("take", info, pluck, 0.5, Ear((0.5,)))
    initial = project(pluck.displacement(info.grid_points), info.modes)[None]
    motions = []
    for string in (replace(info, string=model or info.string), info):
        source = TruthSource(string)
        frames, _ = source.advance(source.start(initial), take.frames - 1)
        motions.append(np.concatenate([initial, frames[0]]))
    changed = to_modes(motions[0], info.modes) * np.array([first] + [1.0] * (info.modes - 1))
    append_to(take, to_grid(changed, info.grid_points).astype(np.float32), motions[1].astype(np.float32))
    return take


@pytest.mark.parametrize("decay", [0.6, 1.0, 1.8])
def test_a_tighter_string_is_sharp_and_another_loss_rings_so_long(info, job, decay):
    own = info.string
    loss = {name: decay * getattr(own, name) for name in ("damping_d1_kg_m_s", "damping_d3_kg_m_s")}
    other = replace(own, tension_n=own.tension_n * 2 ** (10 / 1200), **loss)
    by_window = take_partials(take_of(info, 0.37, 0.5, other), job)
    assert set(by_window) == {"trained", "past", "all"}
    first, *rows = by_window["all"][:4]
    assert decay != 1 or (first.level_db, rows[0].level_db) == pytest.approx((-6.02, 0), abs=0.05)
    own_hz = info.resonator.eigenvalues().imag / (2 * math.pi)
    for row in rows:
        assert row.cents == pytest.approx(5, abs=0.1)
        assert row.truth_hz == pytest.approx(own_hz[row.mode - 1], rel=1e-4)
        assert row.model_hz == pytest.approx(other.undamped_frequency(row.mode) / (2 * math.pi), rel=1e-4)
        t60_s = [math.log(1000) / string.decay_rate(row.mode) for string in (own, other)]
        assert [row.truth_t60_s, row.model_t60_s] == pytest.approx(t60_s, rel=1e-2)
        assert row.t60_error_percent == pytest.approx(100 / decay - 100, abs=1)


def test_rows_without_figures_say_why(info, job):
    rows = take_partials(take_of(info, 0.5), job)["all"]  # the middle is a node of the second mode
    assert (rows[0].note, rows[1].truth_hz) == ("", None)
    assert "60 dB" in rows[1].note
    assert "above half the sample rate: heard at" in rows[8].note


def test_a_model_that_ran_away_is_measured_as_far_as_it_goes(info, job):
    take = take_of(info, 0.37)
    take.model_ends_s = 0.05
    take.motion_m("model")[201:] = 0
    rows = take_partials(take, job)
    assert set(rows) == {"trained", "all"}
    assert rows["all"][0].level_db == pytest.approx(0, abs=0.01)
    take.model_ends_s = 0.0
    assert take_partials(take, job) == {}


def test_a_take_of_pictures_has_the_partials_of_every_sample(job):
    preset = load_preset(SHIPPED / "studio_nylon_b3.safetensors")
    info, pluck, source = preset.info, Pluck(0.3, 4.0), ModelSource(preset)
    initial = project(pluck.displacement(info.grid_points), info.modes)[None]
    following, _ = source.advance(source.start(initial), round(0.2 * info.rate_hz))
    every = np.concatenate([initial[:, None], following], axis=1)[0].astype(np.float32)
    whole = Take("whole", info, pluck, 0.2, Ear((0.5,)))
    pictures = Take("pictures", info, pluck, 0.2, Ear((0.5,)), stride=8, model=source)
    expected, found = [], []
    for take, rows in ((whole, expected), (pictures, found)):
        append_to(take, every[:: take.stride], every[:: take.stride])
        by_window = take_partials(take, job)
        assert set(by_window) == {"trained", "all"}
        rows += [(row.truth_hz, row.cents, row.level_db) for row in by_window["all"][:20]]
    for (hz, *figures), (true_hz, *true) in zip(found, expected, strict=True):
        assert hz == true_hz and figures == pytest.approx(true, abs=1e-3)


PLUCK, LISTEN = Pluck(0.35, 4.0), 0.37


def plucked(entry: PresetEntry) -> tuple[PresetEntry, NoteSound]:
    return entry, NoteSound(entry.path, PLUCK, 0.3, Ear((LISTEN,)))


@pytest.fixture
def entries(small_preset: Path, tmp_path: Path) -> list[PresetEntry]:
    for name in ("first", "second"):
        shutil.copy(small_preset, tmp_path / f"{name}.safetensors")
    return list_presets(tmp_path)[0]


def test_figures_are_those_of_the_definition(entries, job):
    compare([plucked(entries[0])], job)
    (row,) = job.results
    preset, initial = load_preset(entries[0].path), project(PLUCK.displacement(101), 10)[None]
    model, truth = (
        source.advance(source.start(initial), 1200)[0][0]
        for source in (ModelSource(preset), TruthSource(preset.info))
    )
    error, ear = model - truth, listening_weights(np.array([LISTEN]), 101)
    for part, mae, mse in ((slice(400), row.mae, row.mse), (slice(400, None), row.past_mae, row.past_mse)):
        assert mae == pytest.approx(float(np.abs(error[part]).sum() / np.abs(truth[part]).sum()), rel=1e-3)
        assert mse == pytest.approx(float((error[part] ** 2).sum() / (truth[part] ** 2).sum()), rel=1e-3)
    heard = ((error @ ear) ** 2).sum() / ((truth @ ear) ** 2).sum()
    assert row.null_db == pytest.approx(10 * math.log10(heard), abs=0.01)
    assert (row.real_time > 0, row.note) == (True, "")
    assert job.shares == sorted(job.shares) and job.shares[-1] == 1


def test_the_ear_finds_what_it_finds_in_the_exported_sound(entries, job):
    """Through the pick-up, unless it is too short for a spectrum."""
    sound = NoteSound(entries[0].path, PLUCK, 1.0, Ear((LISTEN,), "bridge"))
    compare([(entries[0], sound), (entries[0], replace(sound, seconds=0.1))], job)
    row, short = job.results
    model, truth = (render_sound(sound, source, WavSettings(rate_hz=RATE_HZ)) for source in ("model", "truth"))
    modes_hz = entries[0].info.resonator.omega / (2 * math.pi)
    expected = audible_errors(model, truth, RATE_HZ, modes_hz.tolist(), GLIDE_S).distance_db
    assert row.heard.distance_db == pytest.approx(expected, rel=0.01) and expected > 0.01
    assert str(row.heard) == row.figures["heard"] and "spectra" in row.heard.sentence
    assert short.heard is None and short.mae is not None
    near, far = Audible(0.2, "true", ""), Audible(9.0, "9.0 dB off", "")
    assert sorted([far, near]) == [near, far], "in order of the distance"


def test_a_bad_preset_is_a_row_and_the_next_runs_away_and_says_when(entries, job):
    entries[0].path.write_bytes(b"damaged")
    preset = load_preset(entries[1].path)
    with torch.no_grad():
        preset.model.decoder.bias.fill_(1e6)  # type: ignore[operator,union-attr]
    save_preset(entries[1].path, preset.info, preset.model)
    compare([plucked(entry) for entry in entries], job)
    bad, run_away = job.results
    assert "first.safetensors" in bad.note and bad.mae is None
    assert "diverges" in run_away.note and run_away.mae == run_away.past_mae == math.inf

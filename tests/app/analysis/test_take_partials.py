"""The table of partials of takes whose model is the truth, changed in a known way."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.analysis.take_partials import take_partials
from app.rendering import Take
from engine.pluck import Pluck
from engine.presets import SHIPPED, PresetInfo, load_preset, read_info
from engine.resonators.sine_transform import project, to_grid, to_modes
from engine.sources import ModelSource, TruthSource
from engine.values.ear import Ear
from engine.values.string import StringParameters
from tests.app.takes import append_to


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


def test_levels_and_decay_times_mode_by_mode(info: PresetInfo, job: Any) -> None:
    rows = take_partials(take_of(info, 0.37, 0.5), job)
    assert set(rows) == {"trained", "past", "all"}
    one, two = rows["all"][:2]
    assert (one.level_db, two.level_db) == (pytest.approx(-6.02, abs=0.01), pytest.approx(0, abs=0.01))
    own = info.resonator.eigenvalues()[1]
    assert two.truth_hz == pytest.approx(float(own.imag) / (2 * math.pi), rel=1e-4)
    assert two.cents == pytest.approx(0, abs=0.02)
    assert two.truth_t60_s == pytest.approx(math.log(1000) / -float(own.real), rel=1e-2)
    assert two.model_t60_s == pytest.approx(two.truth_t60_s, rel=1e-2)


@pytest.mark.parametrize("decay", [0.6, 1.8])
def test_a_tighter_string_is_sharp_and_one_of_another_loss_rings_as_long_as_it_does(
    info: PresetInfo, job: Any, decay: float
) -> None:
    own = info.string
    loss = {name: decay * getattr(own, name) for name in ("damping_d1_kg_m_s", "damping_d3_kg_m_s")}
    other = replace(own, tension_n=own.tension_n * 2 ** (10 / 1200), **loss)
    for row in take_partials(take_of(info, 0.37, model=other), job)["all"][1:4]:
        assert row.cents == pytest.approx(5, abs=0.1)
        assert row.model_hz == pytest.approx(other.undamped_frequency(row.mode) / (2 * math.pi), rel=1e-4)
        t60_s = [math.log(1000) / string.decay_rate(row.mode) for string in (own, other)]
        assert [row.truth_t60_s, row.model_t60_s] == pytest.approx(t60_s, rel=1e-2)
        assert row.t60_error_percent == pytest.approx(100 / decay - 100, abs=1)


def test_rows_without_figures_say_why(info: PresetInfo, job: Any) -> None:
    rows = take_partials(take_of(info, 0.5), job)["all"]  # the middle is a node of the second mode
    assert (rows[0].note, rows[1].truth_hz) == ("", None)
    assert "60 dB" in rows[1].note
    assert "above half the sample rate: heard at" in rows[8].note


def test_a_model_that_ran_away_is_measured_as_far_as_it_goes(info: PresetInfo, job: Any) -> None:
    take = take_of(info, 0.37)
    take.model_ends_s = 0.05
    take.motion_m("model")[201:] = 0
    rows = take_partials(take, job)
    assert set(rows) == {"trained", "all"}
    assert rows["all"][0].level_db == pytest.approx(0, abs=0.01)
    take.model_ends_s = 0.0
    assert take_partials(take, job) == {}


def test_a_take_of_pictures_has_the_partials_of_every_sample(job: Any) -> None:
    """The model is rendered again for them."""
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

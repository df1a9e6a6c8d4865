"""A family of strings: what is drawn lies in it, and what is learned holds on others, and on drums."""

import math
from functools import partial
from itertools import product
from unittest.mock import Mock

import pytest
import torch

from engine.models import build_model
from engine.models.base import Physics
from engine.presets import SHIPPED, STRINGS, find_preset, load_preset, read_described_string, read_info
from engine.resonators.family import inharmonicity
from engine.resonators.string import resonator_of
from training.cli.family import shelf, train
from training.family import errors as family_errors
from training.family.drums import draw_drum, measure_drum, measure_drums, store, summary
from training.family.fit import FitCase, errors, fit_curves, geometric_mean
from training.family.motion import linear_motion, model_player, untrained, untrained_player
from training.family.preset import read_configuration, train_preset
from training.family.shelf import TITLES
from training.family.strings import COLUMNS, FAMILY, draw_string, solve, string_of

RATE_HZ, STEPS = 48_000, 1_200


def cases(split: str, count: int) -> list[FitCase]:
    drawn = (draw_string("inside", split, number) for number in range(count))
    return [FitCase(plucked, solve(plucked, RATE_HZ, STEPS)) for plucked in drawn]


@pytest.mark.parametrize("column", COLUMNS)
def test_strings_lie_in_their_column(column):
    ranges = FAMILY[column]
    for number in range(40):
        plucked = draw_string(column, "test", number)
        assert not ranges.warnings(plucked.string)
        assert any(low <= plucked.pitch_hz <= high for low, high in ranges.pitch_hz)
        assert any(low <= inharmonicity(plucked.string) <= high for low, high in ranges.inharmonicity)
        rise = float(plucked.resonator.relative_tension_rise(plucked.amplitudes_m))
        assert math.isclose(rise, plucked.tension_rise, rel_tol=1e-9)
        assert ranges.tension_rise[0] <= rise <= ranges.tension_rise[1]
        assert float(plucked.resonator.omega[-1]) < 2 * math.pi * 20_000
        assert 1 <= plucked.resonator.modes <= 99


def test_a_string_sounds_as_it_is_reported():
    eigenvalues = resonator_of(string_of(110.0, 1e-4, 8.0, 0.5), 60).eigenvalues()
    bright = round(3000 / 110) - 1
    found = [eigenvalues[0].imag / (2 * math.pi), *(math.log(1000) / -eigenvalues[mode].real for mode in (0, bright))]
    assert found == pytest.approx([110.0, 8.0, 0.5], rel=1e-9)


def test_splits_share_no_string_and_a_number_is_a_string_or_a_drum_for_ever():
    splits = ("train", "validation", "test")
    assert len({draw_string("inside", split, n).pitch_hz for split in splits for n in range(9)}) == 27
    for draw in (partial(draw_string, "inside", "test"), draw_drum):
        assert (draw(3).amplitudes_m == draw(3).amplitudes_m).all()


def test_curves_are_found_from_nothing_and_hold_on_other_strings():
    """A sixth of a second of six strings is enough to find the twelfths of backward error analysis."""
    train, validation = cases("train", 6), cases("validation", 4)
    model = build_model("koopman_tension", {"modes": 25, "degree": 2})
    physics = Physics(resonator_of(train[0].plucked.string, 25), RATE_HZ, 1e-3)
    model.initialise("kicks", physics, torch.Generator())
    start = geometric_mean(errors(model, validation, RATE_HZ, STEPS))
    shares = []
    best = fit_curves(
        model, train, validation, RATE_HZ, steps=3, first_frames=600, seed=0, report=lambda *of: shares.append(of[0])
    )
    assert shares == [1 / 3, 2 / 3, 1]
    assert best < start / 100
    assert math.isclose(best, geometric_mean(errors(model, validation, RATE_HZ, STEPS)), rel_tol=1e-9)
    for curve in (model.r, model.p):
        at_rest = curve.detach() @ torch.tensor([1.0, -1.0, 1.0], dtype=torch.float64)  # Chebyshev's at phase 0
        assert abs(float(at_rest) - 1 / 12) < 0.01


def test_a_preset_of_many_strings_is_whole(tmp_path, capsys):
    sizes = (
        "modes = 25\nstrings = 2\nvalidation_strings = 1\ntest_strings = 1\nseconds = 0.02\nsteps = 1\nfirst_s = 0.01"
    )
    (file := tmp_path / "two.toml").write_text(f"title = 'Two'\ndescription = ''\n{sizes}")
    c, shares = read_configuration(file), list[float]()
    info = train_preset(c, tmp_path / "two.safetensors", report=lambda share, *_: shares.append(share))
    assert shares == sorted(shares) and max(shares) == 1
    loaded = load_preset(tmp_path / "two.safetensors")
    assert loaded.info == info and info.family == FAMILY["inside"]
    assert info.rel_mse is not None and 0 < info.rel_mse < 1e-3
    assert read_configuration().initialisation == "kicks"
    train(file, tmp_path / "again.safetensors")
    assert f"again.safetensors: rel. MSE {info.rel_mse:.4g}, rel. MAE" in capsys.readouterr().out
    again = load_preset(tmp_path / "again.safetensors").model.state_dict()
    assert all(torch.equal(weight, again[name]) for name, weight in loaded.model.state_dict().items())


def test_players_are_as_good_as_they_should_be():
    players = {
        "series": family_errors.player(untrained("series")),
        "kicks": family_errors.player(untrained("kicks")),
        "averaging": family_errors.averaging,
        "linear": linear_motion,
    }
    found = family_errors.measure(players, "inside", 2, RATE_HZ, window_s=0.05)
    means = [found[name].geometric_mean for name in players]
    assert means == sorted(means)


def test_the_shelf_has_the_strings_of_the_files(tmp_path, monkeypatch):
    monkeypatch.setattr("engine.presets.SHIPPED", tmp_path)
    shelf()
    for name, title in TITLES.items():
        string, description = read_described_string(STRINGS / f"{name}.toml")
        info = read_info(tmp_path / f"studio_any_{name}.safetensors")
        assert (info.title, info.string) == (title, string)
        assert info.description == f"{description} Played by the model of every string."
        assert info == read_info(find_preset(f"studio_any_{name}"))


def test_the_model_of_strings_plays_drums():
    model = load_preset(SHIPPED / "studio_any_string.safetensors").model
    players = {"model": model_player(model), "series": untrained_player("series"), "linear": linear_motion}
    plates = product((4, 5, 10, 11), range(2))  # of few modes
    errors = [each for number, seed in plates for each in measure_drum(number, players, RATE_HZ, False, seed)]
    found = {name: summary(errors, name, RATE_HZ, 0) for name in players}
    assert found["model"].geometric_mean < 1e-11 and found["model"].worst < 1e-6
    assert found["series"].geometric_mean < 1e-11
    assert found["linear"].geometric_mean > 1e-2


def test_a_measurement_of_drums_continues(tmp_path):
    counted = Mock(side_effect=linear_motion)
    checkpoint = tmp_path / "runs" / "drums.csv"
    for _ in range(2):
        found = measure_drums({"linear": counted}, 1, 0, 8_000, 5, checkpoint)
    assert counted.call_count == len(found) == 1
    table = tmp_path / "rows.csv"
    for _ in range(2):
        store([summary(found, "linear", 8_000, 5)], table)
    assert len(table.read_text().splitlines()) == 2

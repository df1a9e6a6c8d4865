"""Errors of models of many strings on drums: small, kept and continued."""

import pytest

from engine.presets import SHIPPED, load_preset
from training.family.drums import (
    DrumError,
    draw_drum,
    measure_drum,
    measure_drums,
    store,
    summary,
)
from training.family.motion import linear_motion, model_player, untrained_player

RATE_HZ = 48_000


@pytest.fixture(scope="module")
def errors() -> list[DrumError]:
    model = load_preset(SHIPPED / "studio_any_string.safetensors").model
    players = {"model": model_player(model), "series": untrained_player("series"), "linear": linear_motion}
    found: list[DrumError] = []
    for seed in range(2):
        for number in (4, 5, 10, 11):  # plates: few modes
            found += measure_drum(number, players, RATE_HZ, False, seed)
    return found


def test_the_model_of_strings_plays_drums(errors):
    model, series, linear = (summary(errors, name, RATE_HZ, 0) for name in ("model", "series", "linear"))
    assert model.geometric_mean is not None and model.geometric_mean < 1e-11
    assert model.worst is not None and model.worst < 1e-6
    assert series.geometric_mean is not None and series.geometric_mean < 1e-11
    assert linear.geometric_mean is not None and linear.geometric_mean > 1e-2


def test_a_drum_is_the_same_for_ever():
    first, again = draw_drum(8), draw_drum(8)
    assert first.drum == again.drum
    assert (first.amplitudes_m == again.amplitudes_m).all()


def test_a_measurement_continues(tmp_path):
    calls: list[int] = []

    def counted(struck, rate_hz):
        calls.append(rate_hz)
        return linear_motion(struck, rate_hz)

    checkpoint = tmp_path / "runs" / "drums.csv"
    measure_drums({"linear": counted}, 1, 0, 8_000, 5, checkpoint)
    found = measure_drums({"linear": counted}, 1, 0, 8_000, 5, checkpoint)
    assert len(calls) == 1
    assert len(found) == 1
    table = tmp_path / "rows.csv"
    for _ in range(2):
        store([summary(found, "linear", 8_000, 5)], table)
    assert len(table.read_text().splitlines()) == 2

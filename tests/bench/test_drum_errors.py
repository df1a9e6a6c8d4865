"""Errors of models of many strings on drums."""

import pytest

from engine.presets import SHIPPED, load_preset
from tests.bench.drum_errors import DrumError, draw_drum, measure_drum, summary
from training.family.drums import linear_drum, model_player, untrained_player

RATE_HZ = 48_000


@pytest.fixture(scope="module")
def errors() -> list[DrumError]:
    model = load_preset(SHIPPED / "studio_any_string.safetensors").model
    players = {"model": model_player(model), "series": untrained_player("series"), "linear": linear_drum}
    found: list[DrumError] = []
    for seed in range(2):
        for number in (4, 5, 10, 11):  # plates: few modes
            found += measure_drum(number, players, RATE_HZ, False, seed)
    return found


def test_the_model_of_strings_plays_drums(errors: list[DrumError]) -> None:
    model, series, linear = (summary(errors, name) for name in ("model", "series", "linear"))
    assert model["geometric_mean"] < 1e-11
    assert model["worst"] < 1e-6
    assert series["geometric_mean"] < 1e-11
    assert linear["geometric_mean"] > 1e-2


def test_a_drum_is_the_same_for_ever() -> None:
    first, again = draw_drum(8), draw_drum(8)
    assert first.drum == again.drum
    assert (first.amplitudes_m == again.amplitudes_m).all()

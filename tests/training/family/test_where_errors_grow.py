"""Beyond which ends of the family the shipped model's error grows: where the app warns, and where it does not."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from engine.models.koopman_tension import KoopmanTension
from engine.pluck import Shape
from engine.presets import find_preset, load_preset
from engine.resonators.family import StringFamily
from training.family.errors import player
from training.family.fit import geometric_mean
from training.family.strings import FAMILY, draw_from, solve

RATE_HZ, STEPS, STRINGS = 48_000, 9_600, 12
HARD = replace(FAMILY["inside"], tension_rise=(0.2, 0.5))  # where there is an error to be seen
GROWS = 5.0  # times: strings of one range differ more from each other


@pytest.fixture(scope="module")
def model() -> KoopmanTension:
    found = load_preset(find_preset("studio_any_string")).model
    assert isinstance(found, KoopmanTension)
    return found


@torch.inference_mode()
def error(model: KoopmanTension, ranges: StringFamily, shape: Shape | None = None) -> float:
    """Geometric mean of the relative squared errors of a fifth of a second; draws of other ranges are alike."""
    play, found = player(model), []
    for number in range(STRINGS):
        plucked = draw_from(ranges, np.random.default_rng(number), shape)
        truth = solve(plucked, RATE_HZ, STEPS)
        found.append((play(plucked, RATE_HZ)(STEPS) - truth).square().sum() / truth.square().sum())
    return geometric_mean(torch.stack(found))


GROWS_BEYOND = [
    (None, "tension_rise", (0.3, 0.5), (0.8, 1.0)),
    ("raised_cosine", "half_width", (0.04, 0.06), (0.01, 0.02)),
    ("gaussian", "half_width", (0.04, 0.06), (0.01, 0.02)),
    ("gaussian", "half_width", (0.1, 0.15), (0.25, 0.5)),
    (None, "position", (0.06, 0.1), (0.02, 0.04)),
    (None, "bright_t60_s", (0.5, 1.0), (5.0, 20.0)),
]
HOLDS_BEYOND = [
    (None, "tension_rise", (0.02, 0.05), (0.001, 0.02)),
    (None, "pitch_hz", ((55, 110),), ((15, 55),)),
    (None, "pitch_hz", ((440, 880),), ((880, 4_000),)),
    (None, "inharmonicity", ((1e-5, 1e-4),), ((1e-9, 1e-5),)),
    (None, "inharmonicity", ((1e-4, 1e-3),), ((1e-3, 3e-2),)),
    (None, "t60_s", (5.0, 20.0), (20.0, 200.0)),
    (None, "bright_t60_s", (0.1, 0.2), (0.02, 0.1)),
    ("gaussian", "half_width", (0.1, 0.15), (0.15, 0.2)),
    ("raised_cosine", "half_width", (0.1, 0.15), (0.15, 0.5)),
]
CASES = [*((*each, True) for each in GROWS_BEYOND), *((*each, False) for each in HOLDS_BEYOND)]


@pytest.mark.parametrize(("shape", "name", "trained", "beyond", "grows"), CASES)
def test_the_error_grows_where_the_app_warns_and_nowhere_else(model, shape, name, trained, beyond, grows):
    ranges = replace(HARD, t60_s=(20.0, 20.1)) if grows and name == "bright_t60_s" else HARD
    inside, outside = (error(model, replace(ranges, **{name: each}), shape) for each in (trained, beyond))
    assert (outside > GROWS * inside) == grows

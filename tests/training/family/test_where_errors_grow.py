"""Beyond which ends of the family the shipped model's error grows: where the app warns, and where it does not."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from engine.presets import find_preset, load_preset
from training.family.errors import player
from training.family.fit import geometric_mean
from training.family.strings import FAMILY, draw_from, solve

HARD = replace(FAMILY["inside"], tension_rise=(0.2, 0.5))  # where there is an error to be seen
RINGS = replace(HARD, t60_s=(20.0, 20.1))
GROWS = 5.0  # times: strings of one range differ more from each other
CASES = [  # docs/many-strings.md has the figures
    (True, HARD, None, "tension_rise", (0.3, 0.5), (0.8, 1.0)),
    (True, HARD, "raised_cosine", "half_width", (0.04, 0.06), (0.01, 0.02)),
    (True, HARD, "gaussian", "half_width", (0.1, 0.15), (0.25, 0.5)),
    (True, HARD, None, "position", (0.06, 0.1), (0.02, 0.04)),
    (True, RINGS, None, "bright_t60_s", (0.5, 1.0), (5.0, 20.0)),
    (False, HARD, None, "t60_s", (5.0, 20.0), (20.0, 200.0)),
    (False, HARD, None, "pitch_hz", ((55, 110),), ((15, 55),)),
    (False, HARD, None, "pitch_hz", ((440, 880),), ((880, 4_000),)),
    (False, HARD, None, "inharmonicity", ((1e-4, 1e-3),), ((1e-3, 3e-2),)),
]


@pytest.mark.parametrize(("grows", "ranges", "shape", "name", "trained", "beyond"), CASES)
@torch.inference_mode()
def test_the_error_grows_where_the_app_warns_and_nowhere_else(grows, ranges, shape, name, trained, beyond):
    """Geometric means of a fifth of a second of twelve strings; draws of both ranges are alike."""
    play, means = player(load_preset(find_preset("studio_any_string")).model), []
    for each in (trained, beyond):
        errors = []
        for number in range(12):
            plucked = draw_from(replace(ranges, **{name: each}), np.random.default_rng(number), shape)
            truth = solve(plucked, 48_000, 9_600)
            errors.append((play(plucked, 48_000)(9_600) - truth).square().sum() / truth.square().sum())
        means.append(geometric_mean(torch.stack(errors)))
    assert (means[1] > GROWS * means[0]) == grows

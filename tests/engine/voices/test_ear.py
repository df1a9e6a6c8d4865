"""Listening points and solo: what is read off a motion."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from engine.pluck import FULL_SCALE_M, FULL_SCALE_M_S
from engine.resonators.sine_transform import listening_weights, to_grid
from engine.voices import Ear

POINTS = 101


def test_without_solo_it_is_the_engines_listening_point() -> None:
    weights = Ear((0.37, 0.61)).weights(POINTS)
    torch.testing.assert_close(weights, listening_weights(torch.tensor([0.37, 0.61], dtype=torch.float64), POINTS))


def test_solo_reads_one_mode_at_the_listening_point() -> None:
    amplitudes = torch.randn(25, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    motion = to_grid(amplitudes, POINTS)
    for mode in (1, 7, 25):
        heard = motion @ Ear((0.37,), solo=mode).weights(POINTS)[:, 0]
        assert float(heard) == pytest.approx(float(amplitudes[mode - 1]) * np.sin(np.pi * mode * 0.37), abs=1e-12)
    everything = sum(motion @ Ear((0.37,), solo=mode).weights(POINTS)[:, 0] for mode in range(1, POINTS - 1))
    assert float(everything) == pytest.approx(float(motion @ Ear((0.37,)).weights(POINTS)[:, 0]), abs=1e-12)
    assert not Ear((0.37,), solo=POINTS).weights(POINTS).any()


def test_nodes_are_known() -> None:
    assert Ear((0.5,), solo=2).is_on_node(0.5)
    assert not Ear((0.5,), solo=3).is_on_node(0.5)
    assert Ear((0.0,)).is_on_node(0.0)
    assert not Ear((0.5,)).is_on_node(0.5)


def test_each_pick_up_has_its_full_scale() -> None:
    assert Ear((0.5,)).full_scale == FULL_SCALE_M
    assert Ear((0.5,), "velocity").full_scale == FULL_SCALE_M_S

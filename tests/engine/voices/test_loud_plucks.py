"""Loud plucks that overlap, judged as a recording of them is: the limiter makes no clicks."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.kernels.constants import QUANTUM
from engine.pluck import Pluck
from engine.presets import SHIPPED, load_preset
from engine.resonators.sine_transform import project
from engine.values.ear import Ear
from engine.voices import Mixer, Voice, model_program
from tests.bench.play import analysis

RATE_HZ = 48_000
SECONDS = 4
PLACES = (0.1, 0.18, 0.26, 0.34, 0.42, 0.5)


@pytest.fixture(scope="module")
def keys() -> list[int]:
    """Twelve a second, as hands play them, each where a quantum begins."""
    random = np.random.default_rng(1)
    frames = RATE_HZ // 4 + np.arange(12 * SECONDS) * RATE_HZ // 12 + random.integers(-400, 400, 12 * SECONDS)
    return [int(frame) // QUANTUM * QUANTUM for frame in frames]


def played(keys: list[int], gain: float) -> tuple[NDArray[np.float32], float]:
    """The sound, (frames, 2), and the limiter's strongest reduction in dB."""
    preset = load_preset(SHIPPED / "studio_nylon_b3.safetensors")
    program, ear, random = model_program(preset, RATE_HZ), Ear((0.37,)), np.random.default_rng(2)
    begins = []
    for place in PLACES:
        initial_m = project(Pluck(place).displacement(preset.info.grid_points), preset.info.modes)
        begins.append((initial_m, program.start(initial_m)))
    mixer, blocks, now = Mixer(RATE_HZ), [], 0
    for key in keys:
        blocks.append(mixer.render(key - now))
        now = key
        initial_m, begin = begins[random.integers(len(begins))]
        mixer.add(Voice(program, initial_m, ear, gain, begin=begin))
    blocks.append(mixer.render(RATE_HZ // 2))
    return np.concatenate(blocks), mixer.take_reduction_db()


@pytest.mark.parametrize("gain", [3.0, 4.0])
def test_the_limiter_makes_no_clicks(keys: list[int], gain: float) -> None:
    sound, reduction_db = played(keys, gain)
    assert reduction_db > 2.0  # it had to do
    expected = analysis.expected_sound(sound, keys, RATE_HZ)
    rest = analysis.unpredicted(sound[:, 0], RATE_HZ)
    found = analysis.events(rest, RATE_HZ)
    plucked = analysis.matched(keys, found, rest.by_past, 0, RATE_HZ)
    assert analysis.clicks(found, plucked, [], expected, RATE_HZ) == []

"""A voice for a file is what a device would be given."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.kernels.constants import AHEAD, QUANTUM
from engine.kernels.fields import record_of
from engine.kernels.voice_records import BANK_PROGRAM
from engine.levels import FULL_SCALE_M
from engine.pluck import Pluck
from engine.presets import load_preset
from engine.sources import ModelSource, Runaway
from engine.values.ear import Ear
from engine.voices import Mixer, Program, Voice, model_program, render_voice, rendered_program, truth_program
from engine.voices.ear import weights_of
from engine.voices.program import voice_ends_s
from engine.voices.voice import END_FADE_S
from tests.engine.sounds import EAR, KNOWING, PLUCK, Signal, initial_m, mixer_of, shipped

PRESET, SECONDS, RATE_HZ = shipped(KNOWING), 0.2, 44_100


def program_of(kind: str) -> Program:
    return truth_program(PRESET.info, RATE_HZ) if kind == "truth" else model_program(PRESET, RATE_HZ)


@pytest.mark.parametrize("kind", ["bank", "truth"])
@pytest.mark.parametrize("ear", [EAR, Ear((0.3, 0.6), "velocity", 2)])
def test_it_is_a_mixer_with_that_one_voice(kind: str, ear: Ear) -> None:
    program, frames = program_of(kind), round(SECONDS * RATE_HZ)
    found = render_voice(program, ModelSource(PRESET), PRESET.info, PLUCK, ear, SECONDS)
    mixer = mixer_of(Voice(program, initial_m(PRESET.info, PLUCK), ear), rate_hz=RATE_HZ, limited=True)
    given = mixer.render(frames + AHEAD)[AHEAD:, : len(ear.points)]  # as a device is, by the limiter's delay later
    np.testing.assert_array_equal(found, given)
    assert mixer.take_reduction_db() == 0.0


def test_a_model_that_is_no_bank_is_rendered_and_converted(small_preset: Path) -> None:
    preset, ear = load_preset(small_preset), Ear((0.3, 0.6))
    info, source = preset.info, ModelSource(preset)
    assert model_program(preset, RATE_HZ).rendered
    found = render_voice(rendered_program(info, info.rate_hz), source, info, PLUCK, ear, SECONDS)
    let_go_m, weights = initial_m(info, PLUCK), weights_of(ear, info.grid_points)
    frames_m, _ = source.advance(source.start(let_go_m[None]), len(found) - 1, weights)
    expected = np.concatenate([(let_go_m @ weights)[None], frames_m[0]]) / FULL_SCALE_M
    attack = round(0.002 * info.rate_hz)
    np.testing.assert_allclose(found[attack:], expected[attack:], atol=1e-6)  # its own rate: as it is
    higher = render_voice(rendered_program(info, 48_000), source, info, PLUCK, ear, SECONDS)
    np.testing.assert_allclose(higher[::12][attack:-4], found[attack:-4], atol=1e-5)


def test_progress_may_end_it_and_a_runaway_is_reported_with_its_time() -> None:
    shares: list[float] = []
    program, source = program_of("bank"), ModelSource(PRESET)
    render_voice(program, source, PRESET.info, PLUCK, EAR, SECONDS, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0

    def refuse(share: float) -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError):
        render_voice(program, source, PRESET.info, PLUCK, EAR, SECONDS, refuse)
    program.memory[record_of(program.memory, BANK_PROGRAM)["sigma"]] = -5e-3  # an e-fold in 50 ms
    with pytest.raises(Runaway) as caught:
        render_voice(program, source, PRESET.info, PLUCK, EAR, 2.0)
    assert 0.05 < caught.value.time_s < 1.0


def undying(kind: str) -> tuple[Program, ModelSource]:
    """Of a model that does not decay, compiled or rendered ahead, whose voice ends after 0.3 s."""
    source = ModelSource(PRESET)
    if kind == "bank":
        program = program_of("bank")
        program.memory[record_of(program.memory, BANK_PROGRAM)["sigma"] :][: program.modes] = 1e-9
    else:
        program = rendered_program(PRESET.info, RATE_HZ)

        shape_m = Pluck(0.3, 0.1).displacement(PRESET.info.grid_points)

        def hum(state: object, steps: int) -> tuple[Signal, object]:
            return np.cos(np.arange(steps) * math.pi / 4)[None, :, None] * shape_m, state

        source.advance = hum
    return replace(program, ends_s=0.3), source


@pytest.mark.parametrize("kind", ["bank", "rendered"])
@pytest.mark.parametrize("ear", [EAR, Ear((0.3, 0.6), "velocity", 2)])
def test_a_voice_ends_though_its_model_hums_on(kind: str, ear: Ear) -> None:
    program, source = undying(kind)
    found = render_voice(program, source, PRESET.info, PLUCK, ear, 1.0)
    endless = render_voice(replace(program, ends_s=math.inf), source, PRESET.info, PLUCK, ear, 1.0)
    assert np.abs(endless[-RATE_HZ // 10 :]).max() > 1e-3
    first, faded = -(-round(0.3 * RATE_HZ) // QUANTUM) * QUANTUM, round(END_FADE_S * RATE_HZ)
    done = (np.arange(len(found)) - first + 1).clip(0, faded)[:, None] / faded
    np.testing.assert_array_equal(found[:first], endless[:first])
    np.testing.assert_allclose(found, (1 - done**2 * (3 - 2 * done)) * endless, atol=1e-7)
    cut = render_voice(program, source, PRESET.info, PLUCK, ear, 5.0, until_db=60.0)
    assert first + faded < len(cut) < RATE_HZ


@pytest.mark.parametrize("skipped_s", [0.0, 0.2, 0.4])
def test_what_is_played_ends_as_in_a_file_and_rings_on_without_losses(skipped_s: float) -> None:
    """Also where it begins later in its motion, or behind its end."""
    program, source = undying("bank")
    let_go_m, first = initial_m(PRESET.info, PLUCK), round(skipped_s * RATE_HZ / QUANTUM) * QUANTUM
    file = render_voice(program, source, PRESET.info, PLUCK, EAR, 1.0)[first:, 0]
    for own in (program, replace(program, ends_s=math.inf)):
        voice, mixer = Voice(own, let_go_m, EAR, 0.0 if skipped_s else 1.0), Mixer(RATE_HZ, limited=False)
        if skipped_s:
            voice.skip(skipped_s, mixer)
            voice.set_gain(1.0)
        mixer.add(voice)
        played = mixer.render(RATE_HZ - first)[:, 0]
        faded_in = 2 * round(0.02 * RATE_HZ) if skipped_s else 0
        if own is not program:
            assert np.abs(played[-RATE_HZ // 10 :]).max() > 1e-3 and not voice.over
        else:
            assert voice.over
            expected = file[faded_in:] if skipped_s < 0.3 else 0 * file[faded_in:]
            np.testing.assert_array_equal(played[faded_in:], expected)


def test_it_ends_where_its_string_is_silent_and_not_within_its_training() -> None:
    info = PRESET.info
    slowest = float(info.resonator.sigma.min())
    assert voice_ends_s(info) == pytest.approx(2 * math.log(1e3) / slowest)  # twice 60 dB
    for program in (program_of("bank"), rendered_program(info, RATE_HZ)):
        assert program.ends_s == voice_ends_s(info)
    assert program_of("truth").ends_s == math.inf
    damped = replace(info, string=replace(info.string, damping_d1_kg_m_s=1e3 * info.string.damping_d1_kg_m_s))
    assert voice_ends_s(damped) == info.horizon_s
    endless = replace(info, string=replace(info.string, damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0))
    assert voice_ends_s(endless) == math.inf

"""What one thread writes for another: in order, also on processors that let writes overtake one another."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numba import njit

from engine.effects import Effects
from engine.kernels.compiled import COMPILED
from engine.kernels.fields import slot
from engine.kernels.memory import publish
from engine.kernels.mixer_records import MIXER
from engine.kernels.voice_records import VOICE
from engine.levels import FULL_SCALE_M
from engine.pluck import Pluck
from engine.resonators.string import resonator_of
from engine.values.ear import Ear
from engine.values.effects import Room
from engine.values.string import StringParameters
from engine.voices import Mixer, Voice, plain_program
from engine.voices import mixer as mixer_module
from engine.voices import voice as voice_module
from engine.voices.programs import solver_program

RATE_HZ = 48_000
Published = list[tuple[int, int]]


def test_what_is_published_lies_between_two_fences() -> None:
    """x86 keeps the order of writes by itself, so that only the code can be looked at."""
    uncached = njit(**{**COMPILED, "cache": False})(publish.py_func)
    uncached(np.zeros(4, np.int64), 2, 7)
    (code,) = uncached.inspect_llvm().values()
    function = re.search(r"^define [^@]*i32 @.*?^}", code, re.DOTALL | re.MULTILINE)
    assert function is not None
    steps = re.findall(r"^\s*(fence seq_cst|store i64 %arg\.whole)", function[0], re.MULTILINE)
    assert steps == ["fence seq_cst", "store i64 %arg.whole", "fence seq_cst"]


@pytest.fixture
def published(monkeypatch: pytest.MonkeyPatch) -> Published:
    """What is published, slot and number, while nothing of it is written."""
    found: Published = []

    def note(slots: np.ndarray, slot: int, whole: int) -> None:
        found.append((slot, whole))

    monkeypatch.setattr(mixer_module, "publish", note)
    monkeypatch.setattr(voice_module, "publish", note)
    return found


def string_voice() -> Voice:
    program = solver_program(resonator_of(StringParameters(), 4), RATE_HZ)
    return Voice(program, Pluck().displacement(program.grid_points), Ear((0.37,)))


def test_samples_and_voices_are_published_when_they_are_there(published: Published) -> None:
    """The numbers that show them to the device's thread change in no other way."""
    samples = np.full((100, 1), 0.25, np.float32)
    rendered = Voice(plain_program(RATE_HZ), np.full(3, FULL_SCALE_M), Ear((0.5,)), 1.0, 1.0, RATE_HZ)
    rendered.append(samples)
    assert published == [(slot(VOICE, "ready"), 100)]
    assert rendered.record["ready"] == 0
    mixer, voices = Mixer(RATE_HZ), [string_voice(), string_voice()]
    mixer.add(*voices)
    assert published[1:] == [(slot(MIXER, "pushed"), 2)]
    assert mixer.record["ring"][:2].tolist() == [each.address for each in voices]
    assert mixer.record["pushed"] == 0


def test_listening_points_are_published(published: Published) -> None:
    voice = string_voice()
    voice.listen(Ear((0.2,)))
    assert [each for each, _ in published] == [slot(VOICE, "next_weights")]
    assert voice.record["next_weights"] == 0


def test_a_response_is_published_after_the_convolver(published: Published) -> None:
    mixer = Mixer(RATE_HZ)
    mixer.set_effects(Effects(room=Room(mix=0.5)))
    assert [place for place, _ in published] == [slot(MIXER, "convolver"), slot(MIXER, "effects")]

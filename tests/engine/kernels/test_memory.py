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
from engine.voices import memory as memory_module
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

    monkeypatch.setattr(memory_module, "publish", note)
    return found


def test_what_a_device_shall_see_is_published_when_it_is_there(published: Published) -> None:
    """The numbers that show samples, voices, places and responses to its thread change in no other way."""
    program = solver_program(resonator_of(StringParameters(), 4), RATE_HZ)
    voice = Voice(program, Pluck().displacement(program.grid_points), Ear((0.37,)))
    rendered = Voice(plain_program(RATE_HZ), np.full(3, FULL_SCALE_M), Ear((0.5,)), 1.0, 1.0, RATE_HZ)
    rendered.append(np.full((100, 1), 0.25, np.float32))
    mixer = Mixer(RATE_HZ)
    mixer.add(voice, rendered)
    voice.listen(Ear((0.2,)))
    mixer.set_effects(Effects(room=Room(mix=0.5)))
    assert published[:2] == [(slot(VOICE, "ready"), 100), (slot(MIXER, "pushed"), 2)]
    last = [slot(VOICE, "next_weights"), slot(MIXER, "convolver"), slot(MIXER, "effects")]
    assert [place for place, _ in published[2:]] == last  # a response after the convolver
    assert (rendered.record["ready"], voice.record["next_weights"], mixer.record["pushed"]) == (0, 0, 0)
    assert mixer.record["ring"][:2].tolist() == [voice.address, rendered.address]

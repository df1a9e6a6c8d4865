"""From a MIDI port to sound: what comes in as bytes is measured in what the mixer gives, by real voices.

Once through a virtual port of the system, where it has a sequencer, and always through a port of our own, which makes
messages of bytes as a driver's thread does.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import mido
import numpy as np
import pytest
from numpy.typing import NDArray

from app.instrument.events import Event
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.patches.patch import Damping, Patch
from app.playing.midi_backend import Backend, MidiUnavailable, RtMidi, load_backend
from app.playing.midi_port import MidiInput
from app.playing.notes import Notes
from app.playing.sources import Sources
from engine.values.ear import Ear
from tests.app.monitors import find_shipped, hears

RATE_HZ = 48_000
KEY, HZ = 57, 220.0
RELEASE_T60_S = 0.15
NAME = f"Learned Strings test {os.getpid()}"  # others of the system may be tested at the same time
Wait = Callable[[Callable[[], bool]], None]


class Sender(Protocol):
    """The other end of the cable."""

    def send(self, *data: int) -> None: ...


class OwnBackend:
    """One input, in this process: bytes are parsed, and messages delivered, in a thread of its own."""

    def __init__(self) -> None:
        self._callback: Callable[[Any], None] | None = None
        self._parser = mido.Parser()

    def get_input_names(self) -> list[str]:
        return [NAME]

    def open_input(self, name: str, *, callback: Callable[[Any], None]) -> OwnBackend:
        self._callback = callback
        return self

    def close(self) -> None:
        self._callback = None

    def connected(self) -> bool:
        return True

    def send(self, *data: int) -> None:
        def deliver() -> None:
            self._parser.feed(bytes(data))
            for message in self._parser:
                if self._callback is not None:
                    self._callback(message.bytes())

        thread = threading.Thread(target=deliver)
        thread.start()
        thread.join()


class VirtualPort:
    """A port of the system that this process makes, and that any program could open."""

    def __init__(self, output: Any) -> None:
        self._output = output

    def send(self, *data: int) -> None:
        self._output.send_message(data)


def system_backend() -> tuple[RtMidi, Any]:
    """The system's MIDI and a virtual output there."""
    try:
        backend = load_backend()
        return backend, backend.virtual_output(NAME)
    except (MidiUnavailable, OSError) as error:  # Windows has no virtual ports
        pytest.skip(f"no virtual MIDI port can be made here ({error})")


@pytest.fixture(params=["system", "own"])
def ends(request: pytest.FixtureRequest) -> Iterator[tuple[Backend, Sender]]:
    """A backend with one port, and what sends to it."""
    if request.param == "own":
        own = OwnBackend()
        yield own, own
        return
    backend, output = system_backend()
    yield backend, VirtualPort(output)
    output.delete()


@pytest.fixture
def patch() -> Patch:
    shipped = read_patch(PATCHES / "steel_string_acoustic.json")
    dry = {
        "polarisations": None,
        "sympathy_s_kg": 0.0,  # or the other strings would ring on
        "mode": "poly",
        "bend_semitones": 2.0,
        "damping": Damping(release_t60_s=RELEASE_T60_S),
    }
    return Patch.model_validate({**dict(shipped), **dry})


class Instrument:
    """A patch behind a MIDI input, whose sound the test takes as it likes."""

    def __init__(self, notes: Notes, sound: Any, sender: Sender, wait: Wait, handled: list[Event]) -> None:
        self._sound, self._sender, self._wait, self._handled = sound, sender, wait, handled
        self.notes = notes

    def send(self, *data: int) -> None:
        """And waits until it has come."""
        before = len(self._handled)
        self._sender.send(*data)
        self._wait(lambda: len(self._handled) > before)

    def hear(self, seconds: float) -> NDArray[np.float64]:
        """(frames,), left."""
        found: NDArray[np.float64] = self._sound.mixer.render(round(seconds * RATE_HZ))[:, 0].astype(np.float64)
        return found


@pytest.fixture
def instrument(ends: tuple[Backend, Sender], sound: Any, patch: Patch, wait: Wait) -> Iterator[Instrument]:
    backend, sender = ends
    reports: list[str] = []
    handled: list[Event] = []
    notes = Notes(sound, Sources(), find_shipped, lambda message, detail: reports.append(message))
    notes.set_monitor(hears("model"))

    def handle(event: Event) -> None:
        notes.handle(event)
        handled.append(event)

    port = MidiInput(handle, lambda: backend)
    notes.set_instrument(patch, Ear(tuple(patch.pickup.points), patch.pickup.kind))
    wait(lambda: notes.keys.player is not None)
    port.open(next(name for name in port.names() if NAME in name))
    yield Instrument(notes, sound, sender, wait, handled)
    port.close()
    notes.close()
    assert reports == []


def pitch_hz(sound: NDArray[np.float64], near_hz: float, begin_s: float = 0.1) -> float:
    """Of the partial near a frequency, between the bins of a window's transform."""
    part, padded = sound[round(begin_s * RATE_HZ) :], 2**20
    spectrum = np.abs(np.fft.rfft(part * np.hanning(len(part)), padded))
    low, high = (int(near_hz * factor * padded / RATE_HZ) for factor in (0.97, 1.03))
    peak = low + int(spectrum[low:high].argmax())
    left, middle, right = np.log(spectrum[peak - 1 : peak + 2])
    return float((peak + 0.5 * (left - right) / (left - 2 * middle + right)) * RATE_HZ / padded)


def cents(one_hz: float, other_hz: float) -> float:
    return float(1200 * np.log2(one_hz / other_hz))


def level_db(sound: NDArray[np.float64], begin_s: float = 0.0, end_s: float | None = None) -> float:
    part = sound[round(begin_s * RATE_HZ) : None if end_s is None else round(end_s * RATE_HZ)]
    return float(10 * np.log10(max(np.mean(part**2), 1e-24)))


def falls_db(sound: NDArray[np.float64]) -> float:
    """By how much from one 40 ms to those that begin 60 ms later."""
    return level_db(sound, 0.02, 0.06) - level_db(sound, 0.08, 0.12)


RELEASED_DB = 60 * 0.06 / RELEASE_T60_S


def test_notes_are_in_tune_and_the_pitch_wheel_bends_them(instrument: Instrument) -> None:
    instrument.send(0x90, KEY, 8)
    assert abs(cents(pitch_hz(instrument.hear(1.0), HZ), HZ)) < 0.5
    for low, high, semitones in ((0x7F, 0x7F, 2.0), (0x00, 0x00, -2.0), (0x00, 0x40, 0.0)):
        instrument.send(0xE0, low, high)
        wanted_hz = HZ * 2 ** (semitones / 12)
        assert abs(cents(pitch_hz(instrument.hear(1.0), wanted_hz), wanted_hz)) < 1.0


def test_a_key_that_is_let_go_is_damped_and_another_rings_on(instrument: Instrument) -> None:
    instrument.send(0x90, KEY, 90)
    assert level_db(instrument.hear(0.2)) > -50
    instrument.send(0x80, KEY, 64)
    assert falls_db(instrument.hear(0.15)) == pytest.approx(RELEASED_DB, abs=2.0)
    instrument.send(0x90, KEY, 90)
    assert falls_db(instrument.hear(0.15)) < 6
    instrument.send(0x90, KEY, 0)  # as many keyboards release
    assert falls_db(instrument.hear(0.15)) == pytest.approx(RELEASED_DB, abs=2.0)
    instrument.hear(0.5)
    assert level_db(instrument.hear(0.1)) < -90


def test_the_pedal_holds_what_is_let_go_until_it_is_up(instrument: Instrument) -> None:
    instrument.send(0xB0, 64, 127)
    instrument.send(0x90, KEY, 90)
    instrument.hear(0.2)
    instrument.send(0x80, KEY, 0)
    assert falls_db(instrument.hear(0.15)) < 6
    instrument.send(0xB0, 64, 0)
    assert falls_db(instrument.hear(0.15)) == pytest.approx(RELEASED_DB, abs=2.0)


def test_a_chord_sounds_together_and_all_sound_off_ends_it(instrument: Instrument) -> None:
    for key in (45, 52, 57):
        instrument.send(0x90, key, 60)
    heard = instrument.hear(1.0)
    for key in (45, 52, 57):
        wanted_hz = 440 * 2 ** ((key - 69) / 12)
        assert abs(cents(pitch_hz(heard, wanted_hz), wanted_hz)) < 12  # the partials of three strings lie close
    assert instrument.notes.keys.sounding().keys() == {45, 52, 57}
    instrument.send(0xB0, 120, 0)
    instrument.hear(0.1)
    assert level_db(instrument.hear(0.1)) < -90

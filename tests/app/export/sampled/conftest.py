"""An instrument that is rendered without a model, decaying sines at its levels, and players of samples."""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from app.instruments.instrument import Fretted, Instrument
from app.player.events import ControlChange, NoteOff, NoteOn, TimedEvent
from app.player.midi_file import midi_bytes
from engine.values.string import StringParameters

T60_S = 2.0
RATE_HZ = 48_000
BLOCK = 64

Sound = NDArray[np.floating]
Render = Callable[..., NDArray[np.float32]]
InstrumentOf = Callable[..., Instrument]
Events = Sequence[tuple[float, int, int]]  # time in s, key, velocity; 0 releases
Play = Callable[[Path, Events, float], Sound]


@pytest.fixture
def instrument_of() -> InstrumentOf:
    """An instrument of keys 45 … 64; fields as given."""

    def made(**fields: object) -> Instrument:
        defaults = {"name": "Any string", "category": "guitar", "range": (45, 64)}
        return Instrument.model_validate({**defaults, "strings": Fretted(string=StringParameters()), **fields})

    return made


@pytest.fixture
def instrument(instrument_of: InstrumentOf) -> Instrument:
    return instrument_of()


@pytest.fixture
def render() -> Render:
    """A sine of the key's pitch, and the softer the wider the pluck; a right channel is 6 dB softer."""

    def rendered(
        instrument: Instrument, key: int, velocity: int, held_s: float, seconds: float, rate_hz: int, **_: object
    ) -> NDArray[np.float32]:
        time_s = np.arange(round(seconds * rate_hz)) / rate_hz
        decay = 10 ** (-3 * time_s / T60_S)
        if held_s < seconds:
            decay *= 10 ** (-3 * np.maximum(0, time_s - held_s) / instrument.damping.release_t60_s)
        pluck = instrument.pluck.pluck(velocity)
        level = pluck.amplitude_mm / 10 * 10 ** (instrument.level_db / 20) * 1.6 / (1 + 10 * pluck.width)
        sound = level * decay * np.sin(2 * math.pi * hz_of(key) * time_s)
        return np.stack([sound / 2**side for side in range(len(instrument.pickup.points))], axis=1).astype(np.float32)

    return rendered


def hz_of(key: float) -> float:
    return 440 * 2 ** ((key - 69) / 12)


def strongest_hz(sound: Sound, rate_hz: int = RATE_HZ) -> float:
    """The frequency of the strongest partial, by a parabola."""
    bins = 2**19
    spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound)), bins))
    peak = int(spectrum[1:-1].argmax()) + 1
    below, top, above = np.log(spectrum[peak - 1 : peak + 2])
    return (peak + 0.5 * (below - above) / (below - 2 * top + above)) * rate_hz / bins


def cents(hz: float, other_hz: float) -> float:
    return float(1200 * np.log2(hz / other_hz))


def level_db(sound: Sound) -> float:
    """Root mean square in dB."""
    return float(10 * np.log10(np.mean(np.square(sound.astype(np.float64)))))


def by_fluidsynth(path: Path, events: Events, seconds: float) -> Sound:
    """Events as FluidSynth plays them, without its effects: (2, frames)."""
    program = shutil.which("fluidsynth")
    if program is None:
        pytest.skip("needs FluidSynth, as Debian's package fluidsynth brings it")
    song, out = path.with_name("song.mid"), path.with_name("song.wav")
    timed = [TimedEvent(0.0, ControlChange(7, 127))]
    timed += [TimedEvent(at, NoteOn(key, velocity) if velocity else NoteOff(key)) for at, key, velocity in events]
    song.write_bytes(midi_bytes([*timed, TimedEvent(seconds, ControlChange(7, 127))]))
    effects = "-R 0 -C 0 -g 1 -ni -q -O float -T wav"
    words = [program, *effects.split(), "-r", str(RATE_HZ), "-F", out, path, song]
    subprocess.run(words, check=True, capture_output=True)
    return soundfile.read(out)[0].T[:, : round(seconds * RATE_HZ)]


class Sfizz:
    """A player of SFZ."""

    def __init__(self, path: Path) -> None:
        pysfizz = pytest.importorskip("pysfizz")
        synth = pysfizz.Synth(RATE_HZ, BLOCK)
        assert synth.load_sfz_file(path, quiet=False)
        self.whole, self.synth = synth, vars(synth)["_synth"]  # the compiled player, which has its notes in real time

    def press(self, key: int, velocity: int) -> None:
        self.synth.note_on(0, key, velocity)

    def release(self, key: int) -> None:
        self.synth.note_off(0, key, 0)

    def voices(self) -> int:
        return int(self.synth.get_num_active_voices())

    def play(self, seconds: float) -> NDArray[np.float32]:
        """(2, frames)."""
        blocks = round(seconds * RATE_HZ / BLOCK)
        return np.concatenate([np.stack(self.synth.render_block()) for _ in range(blocks)], axis=1)


def by_sfizz(path: Path, events: Events, seconds: float) -> Sound:
    player, parts, now = Sfizz(path), [], 0.0
    for at, key, velocity in events:
        if at > now:
            parts.append(player.play(at - now))
            now = at
        player.press(key, velocity) if velocity else player.release(key)
    return np.concatenate([*parts, player.play(seconds - now)], axis=1)


PLAYERS: dict[str, Play] = {"sfz": by_sfizz, "sf2": by_fluidsynth}

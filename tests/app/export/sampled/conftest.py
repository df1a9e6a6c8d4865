"""Instruments that are rendered without a model, as decaying sines at their own levels, and players of samples."""

import math
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from app.export.sampled.plan import SampledPlan
from app.instruments.instrument import Fretted, Instrument
from app.player.events import ControlChange, NoteOff, NoteOn, TimedEvent
from app.player.midi_file import midi_bytes
from engine.values.string import StringParameters

T60_S = 2.0
RATE_HZ = 48_000
BLOCK = 64
STEREO = {"points": (0.2, 0.4)}

Sound = NDArray[np.floating]
Events = Sequence[tuple[float, int, int]]  # time in s, key, velocity; 0 releases


def instrument_of(**fields: object) -> Instrument:
    """An instrument of keys 45 … 64; fields as given."""
    defaults = {"name": "Any string", "category": "guitar", "range": (45, 64)}
    return Instrument.model_validate({**defaults, "strings": Fretted(string=StringParameters()), **fields})


def small(instrument: Instrument | None = None, **choices: object) -> SampledPlan:
    return SampledPlan(instrument or instrument_of(), **{"keys": (58, 61), "layers": 3, "seconds": 0.17, **choices})


def render(
    instrument: Instrument, key: int, velocity: int, held_s: float, seconds: float, rate_hz: int, **_: object
) -> NDArray[np.float32]:
    """A sine of the key's pitch, and the softer the wider the pluck; a right channel is 6 dB softer."""
    time_s = np.arange(round(seconds * rate_hz)) / rate_hz
    decay = 10 ** (-3 * time_s / T60_S - 3 * np.maximum(0, time_s - held_s) / instrument.damping.release_t60_s)
    pluck = instrument.pluck.pluck(velocity)
    level = pluck.amplitude_mm / 10 * 10 ** (instrument.level_db / 20) * 1.6 / (1 + 10 * pluck.width)
    sound = level * decay * np.sin(2 * math.pi * hz_of(key) * time_s)
    return np.stack([sound / 2**side for side in range(len(instrument.pickup.points))], axis=1).astype(np.float32)


def hz_of(key: float) -> float:
    return 440 * 2 ** ((key - 69) / 12)


def strongest_hz(sound: Sound, rate_hz: int = RATE_HZ) -> float:
    """The frequency of the strongest partial, by a parabola."""
    bins = 2**19
    spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound)), bins))
    peak = int(spectrum[1:-1].argmax()) + 1
    below, top, above = np.log(spectrum[peak - 1 : peak + 2])
    return (peak + 0.5 * (below - above) / (below - 2 * top + above)) * rate_hz / bins


def cents(sound: Sound, hz: float) -> float:
    """Of the strongest partial, above a frequency."""
    return float(1200 * np.log2(strongest_hz(sound) / hz))


def level_db(sound: Sound) -> float:
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
    def __init__(self, path: Path) -> None:
        synth = pytest.importorskip("pysfizz").Synth(RATE_HZ, BLOCK)
        assert synth.load_sfz_file(path, quiet=False)
        self._whole, self._synth = synth, vars(synth)["_synth"]  # the compiled one has its notes in real time

    @property
    def voices(self) -> int:
        return int(self._synth.get_num_active_voices())

    def play(self, events: Events, seconds: float) -> Sound:
        parts, now = [np.zeros((2, 0), np.float32)], 0.0
        for at, key, velocity in (*events, (seconds, 0, 0)):
            blocks = round((at - now) * RATE_HZ / BLOCK)
            parts += [np.stack(self._synth.render_block()) for _ in range(blocks)]
            now = at
            self._synth.note_on(0, key, velocity) if velocity else self._synth.note_off(0, key, 0)
        return np.concatenate(parts, axis=1)


PLAYERS = {"sfz": lambda path, *played: Sfizz(path).play(*played), "sf2": by_fluidsynth}

"""A patch that is rendered without a model: decaying sines at the patch's own levels."""

from __future__ import annotations

import math
import shutil
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from app.patches.patch import Fretted, Patch
from engine.values.string import StringParameters

T60_S = 2.0
RATE_HZ = 48_000


@pytest.fixture
def patch_of() -> Callable[..., Patch]:
    """A patch of keys 45 … 64; fields as given."""

    def made(**fields: object) -> Patch:
        defaults = {"name": "Any string", "category": "guitar", "range": (45, 64)}
        return Patch.model_validate({**defaults, "strings": Fretted(string=StringParameters()), **fields})

    return made


@pytest.fixture
def patch(patch_of: Callable[..., Patch]) -> Patch:
    return patch_of()


@pytest.fixture
def render() -> Callable[..., NDArray[np.float32]]:
    """A sine of the key's pitch, and the softer the wider the pluck; a right channel is 6 dB softer."""

    def rendered(
        patch: Patch, key: int, velocity: int, held_s: float, seconds: float, rate_hz: int, **_: object
    ) -> NDArray[np.float32]:
        time_s = np.arange(round(seconds * rate_hz)) / rate_hz
        decay = 10 ** (-3 * time_s / T60_S)
        if held_s < seconds:
            decay *= 10 ** (-3 * np.maximum(0, time_s - held_s) / patch.damping.release_t60_s)
        pluck = patch.pluck.pluck(velocity)
        level = pluck.amplitude_mm / 10 * 10 ** (patch.level_db / 20) * 1.6 / (1 + 10 * pluck.width)
        sound = level * decay * np.sin(2 * math.pi * 440 * 2 ** ((key - 69) / 12) * time_s)
        return np.stack([sound / 2**side for side in range(len(patch.pickup.points))], axis=1).astype(np.float32)

    return rendered


@pytest.fixture
def pitch_cents() -> Callable[[NDArray[np.floating], int, int], float]:
    """How far a sound is from a key's pitch of equal temperament: its strongest partial, by a parabola."""

    def found(sound: NDArray[np.floating], rate_hz: int, key: int) -> float:
        bins = 2**19
        spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound)), bins))
        peak = int(spectrum[1:-1].argmax()) + 1
        below, top, above = np.log(spectrum[peak - 1 : peak + 2])
        hz = (peak + 0.5 * (below - above) / (below - 2 * top + above)) * rate_hz / bins
        return float(1200 * np.log2(hz / (440 * 2 ** ((key - 69) / 12))))

    return found


@pytest.fixture
def level_db() -> Callable[[NDArray[np.floating]], float]:
    """Root mean square in dB."""
    return lambda sound: float(10 * np.log10(np.mean(np.square(sound.astype(np.float64)))))


def midi(events: list[tuple[float, int, int]], seconds: float) -> bytes:
    """A file of one track at a tick a millisecond: (time in s, key, velocity; 0 releases), at full volume."""

    def count(ticks: int) -> bytes:
        return bytes([ticks >> 14 | 0x80, ticks >> 7 & 0x7F | 0x80, ticks & 0x7F])

    track, now = b"\x00\xb0\x07\x7f", 0
    for time_s, key, velocity in events:
        track += count(round(1000 * time_s) - now) + bytes([0x90, key, velocity])
        now = round(1000 * time_s)
    track += count(round(1000 * seconds) - now) + b"\xff\x2f\x00"
    head = b"MThd" + struct.pack(">IHHH", 6, 0, 1, 500)
    return head + b"MTrk" + struct.pack(">I", len(track)) + track


@pytest.fixture
def play(tmp_path: Path) -> Callable[..., NDArray[np.float64]]:
    """Plays events by FluidSynth, without its effects: (2, frames)."""
    program = shutil.which("fluidsynth")
    if program is None:
        pytest.skip("needs FluidSynth, as Debian's package fluidsynth brings it")

    def played(path: Path, events: list[tuple[float, int, int]], seconds: float) -> NDArray[np.float64]:
        song, out = tmp_path / "song.mid", tmp_path / "song.wav"
        song.write_bytes(midi(events, seconds))
        effects = ["-R", "0", "-C", "0", "-g", "1"]
        words = [
            program,
            "-ni",
            "-q",
            *effects,
            "-r",
            str(RATE_HZ),
            "-O",
            "float",
            "-T",
            "wav",
            "-F",
            out,
            path,
            song,
        ]
        subprocess.run(words, check=True, capture_output=True)
        return soundfile.read(out)[0].T

    return played


BLOCK = 64


class Sfizz:
    """A player of SFZ."""

    def __init__(self, path: Path) -> None:
        pysfizz = pytest.importorskip("pysfizz")
        self._synth = pysfizz.Synth(RATE_HZ, BLOCK)
        assert self._synth.load_sfz_file(path, quiet=False)
        self.voices: Callable[[], int] = self._synth._synth.get_num_active_voices

    def press(self, key: int, velocity: int) -> None:
        self._synth._synth.note_on(0, key, velocity)

    def release(self, key: int) -> None:
        self._synth._synth.note_off(0, key, 0)

    def play(self, seconds: float) -> NDArray[np.float32]:
        """(2, frames)."""
        blocks = round(seconds * RATE_HZ / BLOCK)
        return np.concatenate([np.stack(self._synth._synth.render_block()) for _ in range(blocks)], axis=1)


@pytest.fixture
def sfizz() -> type[Sfizz]:
    return Sfizz

"""A steady tone, played as the app's sound is, by a process that does nothing else: the control of the measurement.

Where the tone has holes too, the computer or the sound server was late, not the app. It plays into a null sink of its
own, through PortAudio, with the app's buffer, compiled mixer and thread priority.

One thread of that process does nothing but wake every millisecond, in real time where the system grants it: where
even this one is late, the computer was held up as a whole, as a virtual one is by its neighbours.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from app.audio.choices import Buffer
from app.shared.thread_priority import put_first
from tests.bench.play.analysis import silences
from tests.bench.play.children import child
from tests.bench.play.recording import Recording, recording, recording_aside
from tests.bench.play.sound_server import CHANNELS, FORMAT, RATE_HZ, SoundServer

SINK = "control"
LOG = "control.log"
LATE = "late by, ms: "
TONE_HZ = 440
LEVEL = 0.1
PATIENCE_S = 20.0
WAKES_EVERY_S = 0.001
LATE_S = 0.003


@contextlib.contextmanager
def steady_tone(server: SoundServer, folder: Path, buffer: Buffer) -> Iterator[Recording]:
    """Play and record it until the block ends."""
    _make_sink(server)
    with recording(server, folder / "control", SINK) as recorded, _tone(server, folder, buffer):
        recorded.wait_for_sound(0.0, PATIENCE_S)  # so that it does not start while the app does
        yield recorded


@contextlib.contextmanager
def steady_tone_aside(server: SoundServer, folder: Path, buffer: Buffer) -> Iterator[Path]:
    """The same for long: recorded by a process alone, the mean of both channels, float32 (frames,), in the file."""
    path = folder / "control"
    _make_sink(server)
    with recording_aside(server, path, SINK), _tone(server, folder, buffer):
        yield path


def late_wakes_ms(folder: Path) -> list[float]:
    """By how much a thread that only wakes was late, where by more than `LATE_S`, since the tone began.

    Args:
        folder: the tone's.
    """
    lines = (folder / LOG).read_text(encoding="utf-8", errors="replace").splitlines()
    return [float(line.removeprefix(LATE)) for line in lines if line.startswith(LATE)]


def _make_sink(server: SoundServer) -> None:
    load = ["pactl", "load-module", "module-null-sink", f"sink_name={SINK}", f"rate={RATE_HZ}", f"format={FORMAT}"]
    subprocess.run([*load, f"channels={CHANNELS}"], env=server.environment, check=True, capture_output=True)


@contextlib.contextmanager
def _tone(server: SoundServer, folder: Path, buffer: Buffer) -> Iterator[None]:
    command = [sys.executable, "-m", "tests.bench.play.control", str(buffer)]
    environment = {**server.environment, "PULSE_SINK": SINK}
    with (folder / LOG).open("wb") as log, child(command, environment, stdout=log, stderr=log):
        yield


def holes_ms(tone: Recording, begin_s: float, end_s: float) -> list[float]:
    """Lengths of the tone's holes between two times by `time.monotonic`."""
    clock = tone.clock()
    part = tone.sound()[clock.frame(begin_s) : clock.frame(end_s), 0]
    return [silence.frames * 1000 / RATE_HZ for silence in silences(part, RATE_HZ)]


def main(buffer: str) -> None:
    """Play until the process is ended. `buffer`: see `Buffer`."""
    from app.audio.sound import Sound
    from app.playing.pair import Pair
    from app.window.audio_control import LATENCY_S

    time_s = np.arange(RATE_HZ) / RATE_HZ
    tone = (LEVEL * np.sin(2 * np.pi * TONE_HZ * time_s)).astype(np.float32)[:, None]
    with Sound() as sound:
        latency_s = LATENCY_S.get(buffer, 0.0)  # type: ignore[call-overload]
        sound.open(buffer_s=latency_s, rate_hz=RATE_HZ, buffer_frames=0 if latency_s else int(buffer))
        while sound.status().device is None:
            time.sleep(0.05)
        pair = Pair(sound.mixer, {"tone": tone})
        pair.select("tone")
        pair.play()
        put_first({threading.get_native_id()})
        while True:
            began_s = time.monotonic()
            time.sleep(WAKES_EVERY_S)
            late_s = time.monotonic() - began_s - WAKES_EVERY_S
            if late_s > LATE_S:
                print(f"{LATE}{1000 * late_s:.2f}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])

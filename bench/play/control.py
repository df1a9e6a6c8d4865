"""A steady tone, played as the app's sound is, by a process that does nothing else: the control of the measurement.

Where the tone has holes too, the computer or the sound server was late, not the app. It plays into a null sink of its
own, through PortAudio, with the app's buffer, compiled mixer and thread priority.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from app.audio.choices import Buffer
from bench.play.children import child
from bench.play.recording import Recording, recording
from bench.play.sound_server import CHANNELS, FORMAT, RATE_HZ, SoundServer

SINK = "control"
TONE_HZ = 440
LEVEL = 0.1
PATIENCE_S = 20.0


@contextlib.contextmanager
def steady_tone(server: SoundServer, folder: Path, buffer: Buffer) -> Iterator[Recording]:
    """Play and record it until the block ends."""
    load = ["pactl", "load-module", "module-null-sink", f"sink_name={SINK}", f"rate={RATE_HZ}", f"format={FORMAT}"]
    subprocess.run([*load, f"channels={CHANNELS}"], env=server.environment, check=True, capture_output=True)
    command = [sys.executable, "-m", "bench.play.control", str(buffer)]
    environment = {**server.environment, "PULSE_SINK": SINK}
    with recording(server, folder / "control", SINK) as recorded, child(command, environment):
        recorded.wait_for_sound(0.0, PATIENCE_S)  # so that it does not start while the app does
        yield recorded


def main(buffer: str) -> None:
    """Play until the process is ended. `buffer`: see `Buffer`."""
    from app.audio.choices import SoundChoice
    from app.audio.sound import Sound
    from app.playing.pair import Pair

    time_s = np.arange(RATE_HZ) / RATE_HZ
    tone = (LEVEL * np.sin(2 * np.pi * TONE_HZ * time_s)).astype(np.float32)[:, None]
    with Sound() as sound:
        frames = int(buffer) if buffer.isdigit() else buffer
        sound.open(sound=SoundChoice.model_validate({"rate_hz": RATE_HZ, "buffer": frames}))
        while sound.status().device is None:
            time.sleep(0.05)
        pair = Pair(sound.mixer, {"tone": tone})
        pair.select("tone")
        pair.play()
        while True:
            time.sleep(1.0)


if __name__ == "__main__":
    main(sys.argv[1])

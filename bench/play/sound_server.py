"""A private sound server whose only device, a null sink, stands for the sound card.

The null sink runs by the computer's monotonic clock, asks for sound as a card does, and plays silence where none
arrives in time. What it receives can be recorded bit for bit. It pauses while no program plays, so a player of
silence keeps it running.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from app.shared.thread_priority import put_first
from bench.play.children import Missing, child

RATE_HZ = 48_000
CHANNELS = 2
FORMAT = "float32le"
SINK = "test"
FIRST_SINK = 0  # as pactl counts: the app's
SILENCE = "silence"
SOCKET = "native"
START_PATIENCE_S = 10.0


@dataclass(frozen=True)
class SoundServer:
    """`environment`: of processes that are to play into it."""

    environment: dict[str, str]

    def buffered_s(self) -> float | None:
        """The sound that the server has buffered of the one client; None where not exactly one plays."""
        command = ["pactl", "--format=json", "list", "sink-inputs"]
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True)
        try:
            clients = json.loads(done.stdout)
            others = [c for c in clients if c["sink"] == FIRST_SINK and c["properties"].get("media.name") != SILENCE]
            [client] = others
            return float(client["buffer_latency_usec"]) * 1e-6
        except (ValueError, KeyError, TypeError):
            return None


@contextlib.contextmanager
def sound_server(folder: Path) -> Iterator[SoundServer]:
    """Start the server, with its files in `folder`, and end it afterwards. The user's own sound is left alone.

    Raises:
        Missing: it did not start.
    """
    (folder / ".asoundrc").write_text("pcm.!default { type pulse }\nctl.!default { type pulse }\n", encoding="utf-8")
    caches = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")  # the user's, so that starts are warm
    environment = {
        **os.environ,
        "HOME": str(folder),
        "XDG_RUNTIME_DIR": str(folder),
        "XDG_CONFIG_HOME": str(folder),
        "XDG_DATA_HOME": str(folder),
        "XDG_CACHE_HOME": caches,
        "PULSE_RUNTIME_PATH": str(folder),
        "PULSE_SERVER": f"unix:{folder / SOCKET}",
        "PYTHONPATH": str(Path(__file__).parents[2]),
    }
    socket, log_path = folder / SOCKET, folder / "pulse.log"
    protocol = f"module-native-protocol-unix socket={socket} auth-anonymous=1"
    # First among all processes where the system permits it: its own lateness is not to be measured.
    options = ["--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no", "--high-priority=yes", "--realtime=yes"]
    command = ["pulseaudio", "-n", *options, "-L", " ".join(_CARD), "-L", protocol]
    with log_path.open("wb") as log, child(command, environment, stderr=log) as process:
        deadline_s = time.monotonic() + START_PATIENCE_S
        while not socket.exists() and time.monotonic() < deadline_s and process.poll() is None:
            time.sleep(0.02)
        if not socket.exists():
            raise Missing(f"PulseAudio did not start: {log_path.read_text(errors='replace')[-300:]}")
        put_first({process.pid})  # its main thread, which takes its clients' sound; the sinks' already go first
        with child(_PLAY_SILENCE, environment):
            yield SoundServer(environment)


_CARD = ["module-null-sink", f"sink_name={SINK}", f"rate={RATE_HZ}", f"format={FORMAT}", f"channels={CHANNELS}"]
_PLAY_SILENCE = [
    *("pacat", "--playback", "--raw", f"--device={SINK}", f"--stream-name={SILENCE}", "--latency-msec=1000"),
    *(f"--format={FORMAT}", f"--rate={RATE_HZ}", f"--channels={CHANNELS}", "/dev/zero"),
]

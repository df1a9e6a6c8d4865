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
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from app.commands.benchmarks.play.children import Missing, child

RATE_HZ = 48_000
CHANNELS = 2
FORMAT = "float32le"
SINK = "test"
FIRST_SINK = 0  # as pactl counts: the app's
SILENCE = "silence"
START_PATIENCE_S = 10.0


@dataclass(frozen=True)
class SoundServer:
    """`environment` of processes that are to play into it."""

    environment: dict[str, str]

    @contextlib.contextmanager
    def adopted(self) -> Iterator[None]:
        """Within, this process plays into it too. To be entered before PortAudio is loaded.

        Raises:
            Missing: PortAudio has been loaded.
        """
        if "sounddevice" in sys.modules:
            raise Missing("PortAudio has been loaded, and plays elsewhere; use a process of its own")
        before = dict(os.environ)
        os.environ.update(self.environment)
        try:
            yield
        finally:
            os.environ.clear()
            os.environ.update(before)

    def buffered_s(self) -> float | None:
        """How much sound of the one client that plays the server has buffered; None where not exactly one plays."""
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
    """Starts the server, with its files in `folder`, and ends it afterwards. The user's own sound is left alone.

    Raises:
        Missing: it did not start.
    """
    socket = folder / "native"
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
        "PULSE_SERVER": f"unix:{socket}",
        "PYTHONPATH": str(Path(__file__).parents[4]),
    }
    sink = f"module-null-sink sink_name={SINK} rate={RATE_HZ} format={FORMAT} channels={CHANNELS}"
    protocol = f"module-native-protocol-unix socket={socket} auth-anonymous=1"
    # First among all processes where the system permits it, as a desktop's: its own lateness is not to be measured.
    options = ["--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no", "--high-priority=yes", "--realtime=yes"]
    command = ["pulseaudio", "-n", *options, "-L", sink, "-L", protocol]
    with (folder / "pulse.log").open("wb") as log, child(command, environment, stderr=log) as process:
        deadline_s = time.monotonic() + START_PATIENCE_S
        while not socket.exists() and time.monotonic() < deadline_s and process.poll() is None:
            time.sleep(0.02)
        if not socket.exists():
            said = (folder / "pulse.log").read_text(errors="replace")[-300:]
            raise Missing(f"PulseAudio did not start: {said}")
        with child(_PLAY_SILENCE, environment):
            yield SoundServer(environment)


_PLAY_SILENCE = [
    *("pacat", "--playback", "--raw", f"--device={SINK}", f"--stream-name={SILENCE}", "--latency-msec=1000"),
    *(f"--format={FORMAT}", f"--rate={RATE_HZ}", f"--channels={CHANNELS}", "/dev/zero"),
]

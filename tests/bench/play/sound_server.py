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
from dataclasses import dataclass, field
from pathlib import Path

from app.shared.thread_priority import put_first
from tests.bench.play.children import Missing, child

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
    """`environment` of processes that are to play into it; its files are in `folder`."""

    environment: dict[str, str]
    folder: Path
    _processes: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)

    def start(self) -> None:
        """With its sound card. Raises `Missing` where it does not."""
        socket, log_path = self.folder / SOCKET, self.folder / "pulse.log"
        socket.unlink(missing_ok=True)  # of one that was killed
        protocol = f"module-native-protocol-unix socket={socket} auth-anonymous=1"
        # First among all processes where the system permits it: its own lateness is not to be measured.
        options = ["--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no", "--high-priority=yes"]
        command = ["pulseaudio", "-n", *options, "--realtime=yes", "-L", " ".join(_CARD), "-L", protocol]
        log = self._processes.enter_context(log_path.open("wb"))
        process = self._processes.enter_context(child(command, self.environment, stderr=log))
        deadline_s = time.monotonic() + START_PATIENCE_S
        while not socket.exists() and time.monotonic() < deadline_s and process.poll() is None:
            time.sleep(0.02)
        if not socket.exists():
            raise Missing(f"PulseAudio did not start: {log_path.read_text(errors='replace')[-300:]}")
        put_first({process.pid})  # its main thread, which takes its clients' sound; the sinks' already go first
        self._play_silence()

    def end(self) -> None:
        """All who play into it lose it."""
        self._processes.close()

    def take_card_away(self) -> None:
        """The server continues without it: all who play are cut off."""
        self._control("unload-module", _CARD[0])

    def give_card_back(self) -> None:
        self._control("load-module", *_CARD)
        self._play_silence()

    def refresh_card(self) -> None:
        """Where somebody has begun to record. A null sink begins with a block of two seconds, which nothing can join;
        after a pause its blocks are as short as its clients ask for."""
        deadline_s = time.monotonic() + START_PATIENCE_S
        while not self._control("list", "short", "source-outputs") and time.monotonic() < deadline_s:
            time.sleep(0.01)
        for pause in ("1", "0"):
            self._control("suspend-sink", SINK, pause)

    def _play_silence(self) -> None:
        self._processes.enter_context(child(_PLAY_SILENCE, self.environment))

    def _control(self, *words: str) -> bytes:
        return subprocess.run(["pactl", *words], env=self.environment, check=True, capture_output=True).stdout

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
        "PYTHONPATH": str(Path(__file__).parents[3]),
    }
    server = SoundServer(environment, folder)
    try:
        server.start()
        yield server
    finally:
        server.end()


_CARD = ["module-null-sink", f"sink_name={SINK}", f"rate={RATE_HZ}", f"format={FORMAT}", f"channels={CHANNELS}"]
_PLAY_SILENCE = [
    *("pacat", "--playback", "--raw", f"--device={SINK}", f"--stream-name={SILENCE}", "--latency-msec=1000"),
    *(f"--format={FORMAT}", f"--rate={RATE_HZ}", f"--channels={CHANNELS}", "/dev/zero"),
]

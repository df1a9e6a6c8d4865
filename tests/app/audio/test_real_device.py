"""From the voices through PortAudio and a sound server and back: what arrives is what a mixer renders, to the bit.

A private PulseAudio with a null sink stands for the sound card; `parec` records what the sink was given.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import app
from engine.kernels.constants import QUANTUM
from tests.app.audio import play_through_device as script

RATE_HZ = 44_100  # what PortAudio calls the default rate of an ALSA plugin


class SoundServer(NamedTuple):
    process: subprocess.Popen[bytes]
    environment: dict[str, str]


def wait_for(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 5
    while not condition() and time.monotonic() < deadline_s:
        time.sleep(0.02)


@pytest.fixture
def sound_server() -> Iterator[SoundServer]:
    for program in ("pulseaudio", "parec"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed")
    with tempfile.TemporaryDirectory(prefix="sound") as folder:
        socket = Path(folder, "native")
        Path(folder, ".asoundrc").write_text("pcm.!default { type pulse }\nctl.!default { type pulse }\n")
        folders = dict.fromkeys(("HOME", "XDG_RUNTIME_DIR", "XDG_CONFIG_HOME", "PULSE_RUNTIME_PATH"), folder)
        path = str(Path(app.__file__).parents[1])
        environment = {**os.environ, **folders, "PULSE_SERVER": f"unix:{socket}", "PYTHONPATH": path}
        sink = f"module-null-sink sink_name=test rate={RATE_HZ} format=float32le channels=2"
        protocol = f"module-native-protocol-unix socket={socket} auth-anonymous=1"
        options = ["-n", "--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no", "--disable-shm=yes"]
        with Path(folder, "log").open("wb") as log:
            command = ["pulseaudio", *options, "-L", sink, "-L", protocol]
            process = subprocess.Popen(command, env=environment, stderr=log)
        try:
            wait_for(lambda: socket.exists() or process.poll() is not None)
            if not socket.exists():
                pytest.skip("PulseAudio did not start: " + Path(folder, "log").read_text()[-300:])
            yield SoundServer(process, environment)
        finally:
            process.kill()
            process.wait()


def play(server: SoundServer, *action: str) -> dict[str, Any]:
    """The words of the sound."""
    command = [sys.executable, script.__file__, str(RATE_HZ), *action]  # kernels may have to be compiled
    done = subprocess.run(command, env=server.environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    said: dict[str, Any] = json.loads(done.stdout)
    if {"no_device", "portaudio_missing"} & set(said["problems"]):
        pytest.skip(f"PortAudio or ALSA's pulse plugin is missing: {said}")
    return said


def play_and_record(server: SoundServer, *action: str) -> tuple[dict[str, Any], np.ndarray]:
    """What the sound said, and what the sink was given: shape (frames, 2)."""
    command = ["parec", "-d", "test.monitor", f"--rate={RATE_HZ}", "--format=float32le", "--channels=2"]
    with tempfile.TemporaryFile() as recording:
        recorder = subprocess.Popen([*command, "--latency-msec=20"], env=server.environment, stdout=recording)
        try:
            wait_for(lambda: os.fstat(recording.fileno()).st_size > 0)
            said = play(server, *action)
        finally:
            recorder.terminate()
            recorder.wait()
        recording.seek(0)
        data = recording.read()
    return said, np.frombuffer(data[: len(data) // 8 * 8], np.float32).reshape(-1, 2)


def aligned(recorded: np.ndarray, beginning: np.ndarray, frames: int) -> np.ndarray:
    """The stretch of the recording, (frames, 2), whose left side starts where it differs least from `beginning`.

    Plucks that overlap are alike: where more of them sound, the plain correlation may be greater than at the
    right place, so that the energy of the recording there is taken off.
    """
    left, beginning = recorded[:, 0], beginning[:, 0]
    size = left.size + beginning.size
    match = np.fft.irfft(np.fft.rfft(left, size) * np.fft.rfft(beginning, size).conj(), size)
    starts = left.size - max(frames, beginning.size) + 1
    assert starts > 0, f"only {left.size} frames were recorded"
    energy_before = np.concatenate([[0.0], np.cumsum(left.astype(np.float64) ** 2)])
    energy = energy_before[beginning.size :][:starts] - energy_before[:starts]
    start = int(np.argmin(energy - 2 * match[:starts]))
    return recorded[start : start + frames]


def test_overlapping_notes_and_a_switch_arrive_as_a_mixer_renders_them(sound_server: SoundServer) -> None:
    gaps = 0
    for _ in range(3):
        said, recorded = play_and_record(sound_server, "switch")
        gaps = said["gaps"]
        assert said["problems"] == []
        if said["rate_hz"] != RATE_HZ:
            pytest.skip(f"PortAudio wants {said['rate_hz']} Hz here")
        assert said["over"] == [True] * 3
        assert said["late_frames"] == [0, 0, round(script.SECOND_S * RATE_HZ)]
        earliest, latest = (frame // QUANTUM for frame in said["switched"])
        # The gains were changed between two of the device's calls, and are heard from the quantum after it on.
        candidates = [script.expected(RATE_HZ, quantum * QUANTUM) for quantum in range(earliest, latest + 2)]
        heard = aligned(recorded, candidates[0][: earliest * QUANTUM], len(candidates[0]))
        if any(np.array_equal(heard, candidate) for candidate in candidates):
            return
    assert gaps > 0, "what was recorded is not what was rendered"
    pytest.skip(f"this computer is too busy for gapless sound: {gaps} gaps")


def test_a_sound_server_that_dies_is_reported_once_and_time_goes_on(sound_server: SoundServer) -> None:
    said = play(sound_server, "kill", str(sound_server.process.pid))
    assert said["problems"] == ["vanished"]
    assert said["over"] == [True] * 3, "all notes must come to their end without sound"

"""From the player through PortAudio and a sound server and back: what arrives is what the mixer rendered.

A private PulseAudio with a null sink stands for the sound card; `parec` records what the sink was given.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from app.audio.stream import BLOCK_FRAMES

import app
from app.audio import AudioUnavailable, Mixer, Track, output_devices

RATE_HZ = 44_100  # what PortAudio calls the default rate of an ALSA plugin
SECONDS = 2.0
SCRIPT = Path(__file__).with_name("play_through_device.py")


class SoundServer(NamedTuple):
    process: subprocess.Popen[bytes]
    environment: dict[str, str]


@pytest.fixture
def sound_server() -> Iterator[SoundServer]:
    for program in ("pulseaudio", "parec"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed")
    with tempfile.TemporaryDirectory(prefix="sound") as folder:
        home = Path(folder)
        socket = home / "native"
        (home / ".asoundrc").write_text("pcm.!default { type pulse }\nctl.!default { type pulse }\n")
        environment = {
            **os.environ,
            "HOME": folder,
            "XDG_RUNTIME_DIR": folder,
            "XDG_CONFIG_HOME": folder,
            "PULSE_RUNTIME_PATH": folder,
            "PULSE_SERVER": f"unix:{socket}",
            "PYTHONPATH": str(Path(app.__file__).parents[1]),
        }
        sink = f"module-null-sink sink_name=test rate={RATE_HZ} format=float32le channels=2"
        protocol = f"module-native-protocol-unix socket={socket} auth-anonymous=1"
        options = ["--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no", "--disable-shm=yes"]
        with (home / "log").open("wb") as log:
            process = subprocess.Popen(
                ["pulseaudio", "-n", *options, "-L", sink, "-L", protocol], env=environment, stderr=log
            )
        try:
            deadline_s = time.monotonic() + 5
            while not socket.exists() and time.monotonic() < deadline_s and process.poll() is None:
                time.sleep(0.02)
            if not socket.exists():
                pytest.skip("PulseAudio did not start: " + (home / "log").read_text()[-300:])
            yield SoundServer(process, environment)
        finally:
            process.kill()
            process.wait()


@pytest.fixture
def track_file(tmp_path: Path) -> Path:
    """Two plucked sounds, alike but not equal, and never the same twice in time."""
    rng = np.random.default_rng(1)
    t = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    partials = np.arange(1, 30)[:, np.newaxis]
    levels = rng.uniform(-1, 1, (29, 1)) / partials
    model, truth = (
        np.sum(levels * np.sin(2 * np.pi * partials * pitch_hz * t) * np.exp(-3 * t), axis=0)
        for pitch_hz in (110.3, 110.7)
    )
    np.savez(tmp_path / "track.npz", model=0.4 * model, truth=0.4 * truth)
    return tmp_path / "track.npz"


def play(server: SoundServer, track_file: Path, *action: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, str(SCRIPT), str(track_file), *action],
        env=server.environment,
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert done.returncode == 0, done.stderr
    said: dict[str, Any] = json.loads(done.stdout)
    if "no_device" in said["problems"] or "portaudio_missing" in said["problems"]:
        pytest.skip(f"PortAudio or ALSA's pulse plugin is missing: {said}")
    return said


def play_and_record(server: SoundServer, track_file: Path, *action: str) -> tuple[dict[str, Any], np.ndarray]:
    """What the player said, and what the sink was given: shape (frames, 2)."""
    command = ["parec", "-d", "test.monitor", f"--rate={RATE_HZ}", "--format=float32le", "--channels=2"]
    with tempfile.TemporaryFile() as recording:
        recorder = subprocess.Popen([*command, "--latency-msec=20"], env=server.environment, stdout=recording)
        try:
            time.sleep(0.5)
            said = play(server, track_file, *action)
        finally:
            recorder.terminate()
            recorder.wait()
        recording.seek(0)
        data = recording.read()
    return said, np.frombuffer(data[: len(data) // 8 * 8], np.float32).reshape(-1, 2)


def rendered(track_file: Path, switch_frame: int) -> np.ndarray:
    """What the mixer renders when the source is switched at a frame; shape (frames,)."""
    sources = np.load(track_file)
    track = Track(RATE_HZ, sources["model"].size, ("model", "truth"))
    track.append(sources)
    mixer = Mixer(RATE_HZ)
    mixer.load(track)
    mixer.play()
    before = mixer.next_block(switch_frame)
    mixer.select("truth")
    return np.concatenate([before, mixer.next_block(track.length_frames - switch_frame)])[:, 0]


def aligned(recorded: np.ndarray, beginning: np.ndarray, frames: int) -> np.ndarray:
    """The stretch of the recording, shape (frames,), that starts where it differs least from `beginning`.

    Plucks that overlap are alike: where more of them sound, the plain correlation may be greater than at the
    right place, so that the energy of the recording there is taken off.
    """
    size = recorded.size + beginning.size
    match = np.fft.irfft(np.fft.rfft(recorded, size) * np.fft.rfft(beginning, size).conj(), size)
    starts = recorded.size - max(frames, beginning.size) + 1
    assert starts > 0, f"only {recorded.size} frames were recorded"
    energy_before = np.concatenate([[0.0], np.cumsum(recorded.astype(np.float64) ** 2)])
    energy = energy_before[beginning.size :][:starts] - energy_before[:starts]
    start = int(np.argmin(energy - 2 * match[:starts]))
    return recorded[start : start + frames]


def null_depth_db(recorded: np.ndarray, expected: np.ndarray) -> float:
    """Energy of recorded − expected, relative to the energy of expected."""
    difference = recorded.astype(np.float64) - expected
    return float(10 * np.log10(np.sum(difference**2) / np.sum(expected.astype(np.float64) ** 2) + 1e-30))


def test_what_is_recorded_is_what_was_rendered(sound_server: SoundServer, track_file: Path) -> None:
    model_only = rendered(track_file, round(SECONDS * RATE_HZ))
    for _ in range(3):
        said, recorded = play_and_record(sound_server, track_file, "switch")
        assert said["problems"] == []
        if said["rate_hz"] != RATE_HZ:
            pytest.skip(f"PortAudio wants {said['rate_hz']} Hz here")
        np.testing.assert_array_equal(recorded[:, 0], recorded[:, 1])
        heard = aligned(recorded[:, 0], model_only[: round(0.4 * RATE_HZ)], model_only.size)
        # The source was switched at some block; which one it was, the recording shows, a few blocks late.
        block = int(np.argmax(np.abs(heard - model_only) > 1e-3)) // BLOCK_FRAMES
        candidates = [rendered(track_file, k * BLOCK_FRAMES) for k in range(max(block - 4, 0), block + 1)]
        depth_db = min(null_depth_db(heard, expected) for expected in candidates)
        print(f"null depth {depth_db:.1f} dB, {said['underruns']} underruns")
        assert said["position_s"] == pytest.approx(SECONDS)
        if depth_db < -60:
            return
    # Gaps in what a busy computer played are no fault of the samples.
    assert said["underruns"] > 0, f"null depth only {depth_db:.1f} dB"
    pytest.skip(f"this computer is too busy for gapless sound: {said['underruns']} underruns")


def test_overlapping_plucks_switches_and_the_loop_arrive_as_mixed(
    sound_server: SoundServer, track_file: Path, tmp_path: Path
) -> None:
    for _ in range(3):
        said, recorded = play_and_record(sound_server, track_file, "live", str(tmp_path / "mixed.npy"))
        assert said["problems"] == []
        if said["rate_hz"] != RATE_HZ:
            pytest.skip(f"PortAudio wants {said['rate_hz']} Hz here")
        mixed = np.trim_zeros(np.load(tmp_path / "mixed.npy")[:, 0])  # what came last was not all played
        assert len(mixed) > 2.5 * RATE_HZ
        heard = aligned(recorded[:, 0], mixed, mixed.size)
        depth_db = null_depth_db(heard, mixed)
        print(f"null depth {depth_db:.1f} dB, {said['underruns']} underruns")
        if depth_db < -60:
            return
    assert said["underruns"] > 0, f"null depth only {depth_db:.1f} dB"
    pytest.skip(f"this computer is too busy for gapless sound: {said['underruns']} underruns")


def test_a_sound_server_that_dies_is_reported_once(sound_server: SoundServer, track_file: Path) -> None:
    said, _ = play_and_record(sound_server, track_file, "kill", str(sound_server.process.pid))
    assert said["problems"] == ["vanished"]
    assert said["position_s"] == pytest.approx(SECONDS), "the playhead must reach the end without sound"


def test_the_devices_of_this_computer_can_be_listed() -> None:
    try:
        devices = output_devices()
    except AudioUnavailable as error:
        pytest.skip(str(error))
    assert all(device.name and device.default_rate_hz > 0 and device.channels > 0 for device in devices)

"""From the voices through PortAudio and a sound server and back: what arrives is what a mixer renders, to the bit.

A private PulseAudio with a null sink stands for the sound card; `parec` records what the sink was given.
This file is also the program that plays there, as ALSA and PulseAudio read their settings once per process.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.audio.choices import SoundChoice
from app.audio.problems import AudioProblem
from app.audio.sound import Sound
from app.rendering.subject import load_subject
from engine.kernels.constants import QUANTUM
from engine.pluck import Pluck
from engine.presets import SHIPPED
from engine.resonators.sine_transform import project
from engine.values.ear import Ear
from engine.voices import Mixer, Voice, model_program, truth_program

RATE_HZ = 44_100  # what PortAudio calls the default rate of an ALSA plugin
SECOND_S, RELEASE_S, END_S = 0.2, 0.6, 0.8  # after the first note began
PRESET = SHIPPED / "studio_any_string.safetensors"  # which needs no torch


def wait_for(condition: Callable[[], object], timeout_s: float = 60.0) -> None:  # kernels may have to be compiled
    deadline_s = time.monotonic() + timeout_s
    while not condition() and time.monotonic() < deadline_s:
        time.sleep(0.005)


def notes(first_frame: int) -> list[Voice]:
    """The first note as model and, unheard, as truth, and the second one. They know when they begin and end."""
    preset = load_subject(PRESET, RATE_HZ)
    model, truth = model_program(preset, RATE_HZ), truth_program(preset.info, RATE_HZ)
    first, second = Pluck(0.3), Pluck(0.6, 3.0)
    found = []
    for program, pluck, gain, at_s in (
        (model, first, 0.5, 0.0),
        (truth, first, 0.0, 0.0),
        (truth, second, 0.5, SECOND_S),
    ):
        initial_m = project(pluck.displacement(preset.info.grid_points), preset.info.modes)
        voice = Voice(program, initial_m, Ear((0.37, 0.7)), gain)
        voice.begin_at(first_frame + round(at_s * RATE_HZ))
        voice.release_at(first_frame + round(RELEASE_S * RATE_HZ))
        found.append(voice)
    return found


def main() -> None:
    """Play, and print what the sound says."""
    problems: list[AudioProblem] = []
    notes(0)  # compiles, which may take longer than there is until the first frame
    with Sound(problems.append) as sound:  # with a buffer for a computer that is busy with other tests
        sound.open(sound=SoundChoice.model_construct(rate_hz=RATE_HZ, buffer=RATE_HZ // 10))
        wait_for(lambda: sound.status().device is not None or problems)
        time.sleep(0.2)  # let the device settle
        mixer = sound.mixer
        first_frame = round((mixer.seconds + 0.3) * RATE_HZ)
        first_frame += -first_frame % QUANTUM
        voices = notes(first_frame)
        mixer.add(*voices)
        wait_for(lambda: mixer.seconds > first_frame / RATE_HZ + END_S)
        time.sleep(0.3)  # the end is still on its way through the sound server
        said = {
            "gaps": len(sound.status().gaps),
            "over": [voice.over for voice in voices],
            "late_frames": [voice.began_frame - first_frame for voice in voices],
            "problems": [problem.kind for problem in problems],
        }
    print(json.dumps(said))


@pytest.fixture
def server() -> Iterator[dict[str, str]]:
    """The environment of its clients."""
    for program in ("pulseaudio", "parec"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed")
    with tempfile.TemporaryDirectory(prefix="sound") as folder:
        socket = Path(folder, "native")
        Path(folder, ".asoundrc").write_text("pcm.!default { type pulse }\nctl.!default { type pulse }\n")
        folders = dict.fromkeys(("HOME", "XDG_RUNTIME_DIR", "XDG_CONFIG_HOME", "PULSE_RUNTIME_PATH"), folder)
        path = str(Path(__file__).parents[3])
        environment = {**os.environ, **folders, "PULSE_SERVER": f"unix:{socket}", "PYTHONPATH": path}
        sink = f"module-null-sink sink_name=test rate={RATE_HZ} format=float32le channels=2"
        protocol = f"module-native-protocol-unix socket={socket} auth-anonymous=1"
        options = ["-n", "--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no", "--disable-shm=yes"]
        with Path(folder, "log").open("wb") as log:
            command = ["pulseaudio", *options, "-L", sink, "-L", protocol]
            process = subprocess.Popen(command, env=environment, stderr=log)
        try:
            wait_for(lambda: socket.exists() or process.poll() is not None, 5.0)
            if not socket.exists():
                pytest.skip("PulseAudio did not start: " + Path(folder, "log").read_text()[-300:])
            yield environment
        finally:
            process.kill()
            process.wait()


def play(environment: dict[str, str]) -> dict[str, Any]:
    """The words of the sound."""
    done = subprocess.run([sys.executable, __file__], env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    said: dict[str, Any] = json.loads(done.stdout)
    if {"no_device", "portaudio_missing"} & set(said["problems"]):
        pytest.skip(f"PortAudio or ALSA's pulse plugin is missing: {said}")
    return said


def test_overlapping_notes_arrive_as_a_mixer_renders_them(server, tmp_path):
    command = ["parec", "-d", "test.monitor", f"--rate={RATE_HZ}", "--format=float32le", "--channels=2"]
    mixer, gaps, file = Mixer(RATE_HZ), 0, tmp_path / "recorded"
    mixer.add(*notes(0))
    expected = mixer.render(round(END_S * RATE_HZ))
    for _ in range(3):
        with file.open("wb") as output:
            recorder = subprocess.Popen([*command, "--latency-msec=20"], env=server, stdout=output)
        wait_for(lambda: file.stat().st_size > 0, 5.0)
        said = play(server)
        recorder.terminate()
        recorder.wait()
        data = file.read_bytes()
        recorded = np.frombuffer(data[: len(data) // 8 * 8], np.float32).reshape(-1, 2)
        gaps = said["gaps"]
        assert (said["problems"], said["over"]) == ([], [True] * 3)
        assert said["late_frames"] == [0, 0, round(SECOND_S * RATE_HZ)]
        first, begun = (int(samples.any(axis=1).argmax()) for samples in (expected, recorded))
        if np.array_equal(recorded[begun - first :][: len(expected)], expected):
            return
    assert gaps > 0, "what was recorded is not what was rendered"
    pytest.skip(f"this computer is too busy for gapless sound: {gaps} gaps")


if __name__ == "__main__":
    main()

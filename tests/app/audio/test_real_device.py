"""From the voices through PortAudio and a sound server and back: what arrives is what a mixer renders, to the bit.

A private PulseAudio with a null sink stands for the sound card; `parec` records what the sink was given.
This file is also the program that plays there, as ALSA and PulseAudio read their settings once per process.
"""

import json
import os
import shutil
import signal
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
from engine.kernels.constants import QUANTUM
from engine.pluck import Pluck
from engine.presets import SHIPPED, load_preset
from engine.resonators.sine_transform import project
from engine.values.ear import Ear
from engine.voices import Mixer, Voice, model_program, truth_program

RATE_HZ = 44_100  # what PortAudio calls the default rate of an ALSA plugin
SECOND_S, SWITCH_S, RELEASE_S, END_S = 0.2, 0.4, 0.6, 0.8  # after the first note began
PRESET = "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"


def wait_for(condition: Callable[[], object], timeout_s: float = 60.0) -> None:  # kernels may have to be compiled
    deadline_s = time.monotonic() + timeout_s
    while not condition() and time.monotonic() < deadline_s:
        time.sleep(0.005)


def notes(first_frame: int) -> list[Voice]:
    """The first note as model and, unheard, as truth, and the second one. They know when they begin and end."""
    preset = load_preset(SHIPPED / PRESET)
    model, truth = model_program(preset, RATE_HZ), truth_program(preset.info, RATE_HZ)
    first, second = Pluck(0.3), Pluck(0.6, 3.0)
    found = []
    for program, pluck, gain, at_s in ((model, first, 0.5, 0.0), (truth, first, 0.0, 0.0), (truth, second, 0.5, 0.2)):
        initial_m = project(pluck.displacement(preset.info.grid_points), preset.info.modes)
        voice = Voice(program, initial_m, Ear((0.37, 0.7)), gain)
        voice.begin_at(first_frame + round(at_s * RATE_HZ))
        voice.release_at(first_frame + round(RELEASE_S * RATE_HZ))
        found.append(voice)
    return found


def switch(model: Voice, truth: Voice, _: Voice) -> None:
    model.set_gain(0.0)
    truth.set_gain(0.5)


def expected(switch_frame: int) -> np.ndarray:
    """The sound of the same notes without a device, switched at a frame; from the first one's first on."""
    mixer, voices = Mixer(RATE_HZ), notes(0)
    mixer.add(*voices)
    before = mixer.render(switch_frame)
    switch(*voices)
    return np.concatenate([before, mixer.render(round(END_S * RATE_HZ) - switch_frame)])


def main(server: str = "") -> None:
    """Play, and print what the sound says; half-way the voices are switched, or the server of this id is ended."""
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
        begin_s = first_frame / RATE_HZ
        wait_for(lambda: mixer.seconds > begin_s + SWITCH_S)
        earliest_s = mixer.seconds
        if server:
            os.kill(int(server), signal.SIGKILL)
            wait_for(lambda: sound.status().device is None)
        switch(*voices)
        latest_s = mixer.seconds
        wait_for(lambda: mixer.seconds > begin_s + END_S)
        time.sleep(0 if server else 0.3)  # the end is still on its way through the sound server
        said = {
            "gaps": len(sound.status().gaps),
            "over": [voice.over for voice in voices],
            "late_frames": [voice.began_frame - first_frame for voice in voices],
            "switched": [round((time_s - begin_s) * RATE_HZ) for time_s in (earliest_s, latest_s)],
            "problems": [problem.kind for problem in problems],
        }
    print(json.dumps(said))


Server = tuple[subprocess.Popen[bytes], dict[str, str]]  # the process, and the environment of its clients


@pytest.fixture
def server() -> Iterator[Server]:
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
            yield process, environment
        finally:
            process.kill()
            process.wait()


def play(environment: dict[str, str], *server: str) -> dict[str, Any]:
    """The words of the sound."""
    command = [sys.executable, __file__, *server]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    said: dict[str, Any] = json.loads(done.stdout)
    if {"no_device", "portaudio_missing"} & set(said["problems"]):
        pytest.skip(f"PortAudio or ALSA's pulse plugin is missing: {said}")
    return said


def test_overlapping_notes_and_a_switch_arrive_as_a_mixer_renders_them(server, tmp_path):
    command = ["parec", "-d", "test.monitor", f"--rate={RATE_HZ}", "--format=float32le", "--channels=2"]
    gaps, file = 0, tmp_path / "recorded"
    for _ in range(3):
        with file.open("wb") as output:
            recorder = subprocess.Popen([*command, "--latency-msec=20"], env=server[1], stdout=output)
        wait_for(lambda: file.stat().st_size > 0, 5.0)
        said = play(server[1])
        recorder.terminate()
        recorder.wait()
        data = file.read_bytes()
        recorded = np.frombuffer(data[: len(data) // 8 * 8], np.float32).reshape(-1, 2)
        gaps = said["gaps"]
        assert (said["problems"], said["over"]) == ([], [True] * 3)
        assert said["late_frames"] == [0, 0, round(SECOND_S * RATE_HZ)]
        earliest, latest = (frame // QUANTUM for frame in said["switched"])
        # The gains were changed between two of the device's calls, and are heard from the quantum after it on.
        for quantum in range(earliest, latest + 2):
            sound = expected(quantum * QUANTUM)
            first, begun = (int(samples.any(axis=1).argmax()) for samples in (sound, recorded))
            if np.array_equal(recorded[begun - first :][: len(sound)], sound):
                return
    assert gaps > 0, "what was recorded is not what was rendered"
    pytest.skip(f"this computer is too busy for gapless sound: {gaps} gaps")


def test_a_sound_server_that_dies_is_reported_once_and_time_goes_on(server):
    said = play(server[1], str(server[0].pid))
    assert said["problems"] == ["vanished"]
    assert said["over"] == [True] * 3, "all notes must come to their end without sound"


if __name__ == "__main__":
    main(*sys.argv[1:])

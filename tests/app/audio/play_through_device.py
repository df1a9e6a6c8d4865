"""Strikes two notes that overlap through the default device and prints what the sound says, as JSON.

A script of its own, because ALSA and PulseAudio read their settings once per process:

    python play_through_device.py RATE switch      the first note changes from the model to the truth on the way
    python play_through_device.py RATE kill PID    the sound server PID is ended instead
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from app.audio.choices import SoundChoice
from app.audio.problems import AudioProblem
from app.audio.sound import Sound
from engine.pluck import Pluck
from engine.presets import SHIPPED, load_preset
from engine.resonators.sine_transform import project
from engine.values.ear import Ear
from engine.voices import Mixer, Voice, model_program, truth_program

PRESET = load_preset(SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors")
SECOND_S, SWITCH_S, RELEASE_S, END_S = 0.2, 0.4, 0.6, 0.8  # after the first note began


def notes(rate_hz: int, first_frame: int) -> tuple[Voice, Voice, Voice]:
    """The first note as model and, unheard, as truth, and the second one. They know when they begin and end."""
    bank, truth, found = model_program(PRESET, rate_hz), truth_program(PRESET.info, rate_hz), list[Voice]()
    assert bank is not None
    first, second = Pluck(0.3), Pluck(0.6, 3.0)
    struck = ((bank, first, 0.5, 0.0), (truth, first, 0.0, 0.0), (truth, second, 0.5, SECOND_S))
    for program, pluck, gain, at_s in struck:
        initial_m = project(pluck.displacement(PRESET.info.grid_points), PRESET.info.modes)
        voice = Voice(program, initial_m, Ear((0.37, 0.7)), gain)
        voice.begin_at(first_frame + round(at_s * rate_hz))
        voice.release_at(first_frame + round(RELEASE_S * rate_hz))
        found.append(voice)
    return found[0], found[1], found[2]


def switch(model: Voice, truth: Voice) -> None:
    model.set_gain(0.0)
    truth.set_gain(0.5)


def expected(rate_hz: int, switch_frame: int) -> NDArray[np.float32]:
    """The sound of the same notes without a device, switched at a frame; from the first one's first on."""
    mixer = Mixer(rate_hz)
    model, truth, second = notes(rate_hz, 0)
    mixer.add(model, truth, second)
    before = mixer.render(switch_frame)
    switch(model, truth)
    return np.concatenate([before, mixer.render(round(END_S * rate_hz) - switch_frame)])


def wait_until(condition: Callable[[], bool], timeout_s: float = 60.0) -> None:  # kernels may have to be compiled
    deadline_s = time.monotonic() + timeout_s
    while not condition() and time.monotonic() < deadline_s:
        time.sleep(0.005)


def main(rate: str, action: str, *argument: str) -> None:
    problems: list[AudioProblem] = []
    notes(int(rate), 0)  # compiles, which may take longer than there is until the first frame
    with Sound(problems.append) as sound:
        choice = SoundChoice.model_construct(rate_hz=int(rate), buffer=int(rate) // 10)
        sound.open(sound=choice)  # the computer may be busy with other tests
        wait_until(lambda: sound.status().device is not None or problems != [])
        time.sleep(0.2)  # let the device settle
        mixer = sound.mixer
        first_frame = round((mixer.seconds + 0.3) * mixer.rate_hz)
        first_frame += -first_frame % 64
        voices = notes(mixer.rate_hz, first_frame)
        mixer.add(*voices)
        begin_s = first_frame / mixer.rate_hz
        wait_until(lambda: mixer.seconds > begin_s + SWITCH_S)
        earliest_s = mixer.seconds
        if action == "kill":
            os.kill(int(argument[0]), signal.SIGKILL)
            wait_until(lambda: sound.status().device is None)
        switch(*voices[:2])
        latest_s = mixer.seconds
        wait_until(lambda: mixer.seconds > begin_s + END_S)
        time.sleep(0.3 if action == "switch" else 0)  # the end is still on its way through the sound server
        status = sound.status()
        said = {
            "rate_hz": status.rate_hz,
            "gaps": len(status.gaps),
            "over": [voice.over for voice in voices],
            "late_frames": [voice.began_frame - first_frame for voice in voices],
            "switched": [round((time_s - begin_s) * mixer.rate_hz) for time_s in (earliest_s, latest_s)],
            "problems": [problem.kind for problem in problems],
        }
    print(json.dumps(said))


if __name__ == "__main__":
    main(*sys.argv[1:])

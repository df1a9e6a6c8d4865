"""The sound opens devices, changes them, outlives them, and reports what is wrong with them."""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from app.audio import sound as sound_module
from app.audio.choices import DeviceChoice, SoundChoice
from app.audio.devices import AudioDevice
from app.audio.problems import AudioProblem, ProblemKind, problem, refused
from app.audio.sound import Sound
from engine.effects import Effects
from engine.values.effects import Room
from engine.voices import Mixer, Voice, plain_program

TIMEOUT_S = 30.0  # a busy computer's; nothing here takes so long
HEADPHONES = AudioDevice("Headphones", "Test API", 48_000)
SPEAKERS = AudioDevice("Speakers", "Test API", 44_100)  # of another rate


@dataclass
class Desk:
    """The computer's devices, and all that was asked of them."""

    devices: list[AudioDevice] = field(default_factory=lambda: [HEADPHONES, SPEAKERS])
    refuses: Callable[[AudioDevice], AudioProblem | None] = lambda device: None
    while_opening: Callable[[], object] = lambda: None
    outputs: list[Mock] = field(default_factory=list)
    rescans: int = 0
    problems: list[AudioProblem] = field(default_factory=list)

    def look_up(self, device: DeviceChoice | None, rescan: bool) -> AudioDevice:
        if rescan:
            self.rescans += 1
            assert all(output.close.called for output in self.outputs), (
                "PortAudio must not start under an open stream"
            )
        for each in self.devices:
            if device in (None, each.choice):
                return each
        raise problem(ProblemKind.VANISHED if device else ProblemKind.NO_DEVICE, device.name if device else "")

    def open_output(self, device: AudioDevice, buffer_s: float, mixer: Mixer) -> Mock:
        """An output that plays only when a test says so."""
        assert all(output.close.called for output in self.outputs), (
            "one at a time: it might refuse to be opened twice"
        )
        self.while_opening()
        if (refusal := self.refuses(device)) is not None:
            raise refusal
        output = Mock(device=device, rate_hz=device.default_rate_hz, latency_s=buffer_s, mixer=mixer)
        for name, value in {"now_s": 7.0, "load": 0.25, "lost": False, "stalled": False}.items():
            getattr(output, name).return_value = value
        self.outputs.append(output)
        return output

    @property
    def kinds(self) -> list[ProblemKind]:
        return [problem.kind for problem in self.problems]

    def sound(self, **other: Any) -> Sound:
        faces = {"look_up": self.look_up, "open_output": self.open_output}
        return Sound(**{"on_problem": self.problems.append, **faces, **other})


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Desk:
    for name, value in {"TRY_AGAIN_S": 0.05, "LOOK_EVERY_S": 0.01}.items():
        monkeypatch.setattr(sound_module, name, value)
    return Desk()


@pytest.fixture
def sound(desk: Desk) -> Iterator[Sound]:
    with desk.sound() as made:
        yield made


def broken(*_: object) -> Any:
    raise ZeroDivisionError("a mistake")


def wait_for(condition: Callable[[], object]) -> None:
    deadline_s = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline_s, "it did not happen"
        time.sleep(0.005)


def opened(sound: Sound, device: AudioDevice | None = None, rescan: bool = False, **options: object) -> None:
    """Asks for a device and waits until that was obeyed or refused."""
    done = sound.status().changes_done
    sound.open(device and device.choice, SoundChoice.model_validate(options), rescan)
    wait_for(lambda: sound.status().changes_done > done)


def lasting(sound: Sound) -> Voice:
    voice = Voice.of_samples(plain_program(sound.rate_hz), np.full((1000, 1), 0.25, np.float32))
    voice.loop()
    sound.mixer.add(voice)
    return voice


def looked_at(sound: Sound) -> None:
    """Waits for a few looks of the caretaker."""
    looks = list[object]()
    sound.watch(looks.append)
    wait_for(lambda: len(looks) > 3)


def time_goes_on(voice: Voice) -> None:
    at_s = voice.seconds
    wait_for(lambda: voice.seconds > at_s + 0.02)


def plays_on(sound: Sound, desk: Desk) -> None:
    """What is asked of it is done, and the mixer is still the device's."""
    opened(sound, buffer="high")
    wait_for(lambda: sound.status().latency_s == 0.04)
    assert sound.mixer is desk.outputs[-1].mixer and not desk.outputs[-1].close.called
    voice = lasting(sound)
    assert np.abs(sound.mixer.render(4800)).max() > 0.1 and not voice.over


# Devices and their mixers


def test_time_goes_on_and_a_default_is_opened(sound, desk, threads_begun):
    before, voice = sound.mixer, lasting(sound)
    time_goes_on(voice)
    assert sound.status().device is None and sound.now_s() > 0
    opened(sound)
    wait_for(lambda: sound.status().load == 0.25)
    status = sound.status()
    assert (status.device, status.rate_hz, status.latency_s, status.problem) == (HEADPHONES, 48_000, 0.012, None)
    assert sound.now_s() == 7.0 and sound.mixer is before is desk.outputs[0].mixer and desk.problems == []
    opened(sound)
    assert len(desk.outputs) == 1, "asking for what there is changes nothing"
    for _ in range(2):
        sound.close()
        assert desk.outputs[0].close.called and threads_begun() == []
    sound.open()  # nobody obeys, and nothing is wrong
    assert len(desk.outputs) == 1


def test_what_rings_goes_on_where_the_rate_stays_and_choices_are_obeyed(sound, desk):
    desk.devices.append(AudioDevice("Monitor", "Test API", 48_000))
    opened(sound)
    voice = lasting(sound)
    opened(sound, desk.devices[-1], buffer="high")
    assert sound.mixer.voices == [voice] and desk.outputs[0].close.called
    assert desk.outputs[1].mixer is desk.outputs[0].mixer and desk.outputs[1].latency_s == 0.04
    opened(sound, HEADPHONES, rate_hz=96_000, buffer=512)
    assert (sound.rate_hz, desk.outputs[-1].latency_s) == (96_000, 512 / 96_000)
    assert desk.outputs[-1].device == replace(HEADPHONES, default_rate_hz=96_000)
    desk.devices.insert(0, AudioDevice("Telephone", "Test API", 48_000, channels=1))
    opened(sound)
    assert sound.mixer.channels == 1
    for number in (1, 2):  # a look for devices interrupts, and takes the same again
        opened(sound, rescan=True)
        wait_for(lambda: sound.status().device is not None)
        assert [output.close.called for output in desk.outputs[3:]] == [True] * number + [False]


def test_another_rate_has_another_mixer_with_all_that_is_set(sound, desk):
    """A device may take a second to open, in which the window sets volume, body and room."""
    opened(sound)
    before, effects = sound.mixer, Effects(room=Room(0.3, 1.0))
    desk.while_opening = lambda: (sound.set_volume_db(-20.0), sound.set_effects(effects))
    opened(sound, SPEAKERS)
    wait_for(lambda: sound.status().rate_hz == 44_100)
    assert sound.mixer is not before and (sound.rate_hz, sound.mixer.effects) == (44_100, effects)
    assert sound.mixer.voices == []
    sound.set_effects(None)
    lasting(sound)
    np.testing.assert_allclose(sound.mixer.render(20_000)[-100:], 0.025, rtol=1e-5)
    sound.set_volume_db(float("-inf"))
    sound.mixer.render(40_000)
    assert not sound.mixer.render(1000).any()
    for volume_db in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="volume cannot be"):
            sound.set_volume_db(volume_db)


# Faults of devices: what happens, which problem is reported, and that sound or time continues


def busy(device: AudioDevice) -> AudioProblem | None:
    rate_hz = device.default_rate_hz
    return refused(ValueError("busy"), device.name, rate_hz) if rate_hz != 48_000 else None


GONE = replace(HEADPHONES, name="Gone")


@pytest.mark.parametrize(
    ("device", "rate_hz", "kind"), [(SPEAKERS, 0, "busy"), (HEADPHONES, 96_000, "busy"), (GONE, 0, "vanished")]
)
def test_a_refused_change_is_undone(sound, desk, device, rate_hz, kind):
    opened(sound, HEADPHONES)
    voice, desk.refuses = lasting(sound), busy
    opened(sound, device, rate_hz=rate_hz)
    assert desk.kinds == [kind] and f"“{device.name}”" in str(sound.status().problem)
    assert (sound.status().device, sound.rate_hz) == (HEADPHONES, 48_000)
    assert sound.mixer.voices == [voice] and not desk.outputs[-1].close.called


def test_no_device_at_all_is_reported_and_who_hears_of_it_may_close_the_sound(desk):
    """Who hears of a problem finds it in the status."""
    desk.devices.clear()
    found: list[str | None] = []
    with desk.sound(on_problem=lambda problem: found.append(sound.status().problem)) as sound:
        sound.open()
        wait_for(lambda: found)
        time_goes_on(lasting(sound))
        assert sound.status().device is None
    assert len(found) == 1 and "No audio output" in str(found[0])
    closed = threading.Event()
    other = desk.sound(on_problem=lambda problem: (other.close(), closed.set()))
    other.open()
    assert closed.wait(TIMEOUT_S)  # no dead lock
    other.close()


def test_a_lost_device_is_reported_once_and_found_again(sound, desk):
    opened(sound)  # the default, whichever it is
    voice = lasting(sound)
    desk.devices.remove(HEADPHONES)
    desk.outputs[0].lost.return_value = True
    wait_for(lambda: desk.problems)
    assert desk.outputs[0].close.called
    time_goes_on(voice)  # the clock takes over
    tries = desk.rescans
    wait_for(lambda: desk.rescans > tries + 2)
    assert desk.kinds == [ProblemKind.VANISHED] and "disconnected" in str(sound.status().problem)
    assert len(desk.outputs) == 1, "it is not replaced by another that nobody chose"
    desk.devices.insert(0, HEADPHONES)
    wait_for(lambda: sound.status().device == HEADPHONES)
    assert sound.mixer.voices == [voice] and sound.status().problem is None and len(desk.problems) == 1
    desk.devices.remove(HEADPHONES)
    desk.outputs[1].lost.return_value = True
    wait_for(lambda: len(desk.problems) == 2)
    opened(sound, SPEAKERS)
    desk.devices.insert(0, HEADPHONES)
    tries = desk.rescans
    looked_at(sound)
    assert (sound.status().device, desk.rescans) == (SPEAKERS, tries)


def test_a_stall_is_reported_and_withdrawn(sound, desk):
    opened(sound)
    for number in (1, 2):
        desk.outputs[0].stalled.return_value = True
        wait_for(lambda number=number: len(desk.problems) == number)  # type: ignore[misc]
        assert "“Headphones” stopped" in str(sound.status().problem)
        looked_at(sound)
        desk.outputs[0].stalled.return_value = False
        wait_for(lambda: sound.status().problem is None)
    assert desk.kinds == [ProblemKind.STALLED] * 2 and not desk.outputs[0].close.called


def test_a_device_that_stops_is_opened_at_once(sound, desk, monkeypatch):
    """Nobody waits for it as for one that was unplugged, and what rings continues."""
    monkeypatch.setattr(sound_module, "TRY_AGAIN_S", 1e6)
    opened(sound)
    voice = lasting(sound)
    sound.mixer.record["calls"] += 1
    desk.outputs[0].lost.return_value = True
    wait_for(lambda: len(desk.outputs) == 2 and sound.status().gaps)
    assert desk.outputs[0].close.called and desk.problems == [] and sound.mixer.voices == [voice]
    (gap,) = sound.status().gaps
    assert gap.cause == "device" and gap.milliseconds >= 0
    desk.outputs[1].lost.return_value = True  # this one has never played
    wait_for(lambda: desk.problems)
    assert desk.kinds == [ProblemKind.VANISHED]


# Faults of the program


def test_what_has_rung_out_is_freed_and_gaps_are_kept(sound):
    opened(sound)
    sound.mixer.add(Voice.of_samples(plain_program(48_000), np.full((64, 1), 30.0, np.float32)))
    sound.mixer.render(640)
    wait_for(lambda: sound.status().gaps and sound.mixer.voices == [])
    assert [gap.cause for gap in sound.status().gaps] == ["runaway"]


@pytest.mark.parametrize("stage", ["watch", "forget_ended", "set_effects", "output"])
def test_a_fault_of_the_supervision_is_reported_once_and_sound_continues(sound, desk, monkeypatch, stage):
    """An output that cannot be supervised is opened again."""
    monkeypatch.setattr(sound_module, "RESTART_AFTER", 2)
    opened(sound)
    if stage == "watch":
        sound.watch(broken)
    elif stage == "output":
        desk.outputs[0].load.side_effect = desk.outputs[0].close.side_effect = broken
        wait_for(lambda: len(desk.outputs) == 2)
    else:
        monkeypatch.setattr(Mixer, stage, broken)
        opened(sound, buffer=2048)
    wait_for(lambda: desk.problems)
    plays_on(sound, desk)
    (problem,) = desk.problems
    assert problem.kind is ProblemKind.INTERNAL and "Playback continues" in problem.message
    assert "a mistake" in problem.detail
    assert sound.status().problem is None, "nothing is wrong with the device"


@pytest.mark.parametrize("stage", ["look_up", "open_output"])
def test_a_fault_while_a_device_is_opened_is_reported_and_tried_again(desk, stage):
    works, faults = getattr(desk, stage), [True, True]
    setattr(desk, stage, lambda *values: broken() if faults and faults.pop() else works(*values))
    with desk.sound() as sound:
        sound.open()
        wait_for(lambda: sound.status().device is not None)
        assert desk.kinds == [ProblemKind.UNEXPECTED]
        assert "internal error" in desk.problems[0].message and "a mistake" in desk.problems[0].detail
        plays_on(sound, desk)

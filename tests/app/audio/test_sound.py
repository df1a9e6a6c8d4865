"""The sound opens devices, changes them, outlives them, and says what is wrong with them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from app.audio import sound as sound_module
from app.audio.devices import AudioDevice
from app.audio.problems import AudioProblem, AudioUnavailable, ProblemKind, no_device, refused, vanished
from app.audio.sound import BUFFER_S, Sound
from engine.effects import Effects
from engine.values.effects import Room
from engine.voices import Mixer, Voice, plain_program

TIMEOUT_S = 10.0  # a busy computer's; nothing here takes so long


class FakeOutput:
    """An output that plays only when a test says so."""

    def __init__(self, device: AudioDevice, buffer_s: float, mixer: Mixer) -> None:
        self.device: AudioDevice | None = device
        self.rate_hz, self.latency_s, self.mixer = device.default_rate_hz, buffer_s, mixer
        self.is_stalled = self.is_lost = self.closed = False

    def now_s(self) -> float:
        return 7.0

    def load(self) -> float:
        return 0.25

    def stalled(self) -> bool:
        return self.is_stalled

    def lost(self) -> bool:
        return self.is_lost

    def close(self) -> None:
        self.closed = True


@dataclass
class Desk:
    """The computer's devices, and all that was asked of them."""

    devices: list[AudioDevice]
    refusals: dict[str, AudioUnavailable] = field(default_factory=dict)
    outputs: list[FakeOutput] = field(default_factory=list)
    rescans_while_open: int = 0
    rescans: int = 0
    problems: list[AudioProblem] = field(default_factory=list)

    def look_up(self, device: AudioDevice | None, rescan: bool) -> AudioDevice:
        if rescan:
            self.rescans += 1
            self.rescans_while_open += any(not output.closed for output in self.outputs)
        for each in self.devices:
            if device is None or (each.name, each.host_api) == (device.name, device.host_api):
                return each
        raise no_device() if device is None else vanished(device.name)

    def open_output(self, device: AudioDevice, buffer_s: float, mixer: Mixer) -> FakeOutput:
        assert all(output.closed for output in self.outputs), "one at a time: it might refuse to be opened twice"
        if device.name in self.refusals:
            raise self.refusals[device.name]
        self.outputs.append(FakeOutput(device, buffer_s, mixer))
        return self.outputs[-1]


@pytest.fixture
def desk(headphones: AudioDevice, speakers: AudioDevice) -> Desk:
    return Desk([headphones, speakers])


@pytest.fixture
def sound(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> Iterator[Sound]:
    monkeypatch.setattr(sound_module, "TRY_AGAIN_S", 0.05)
    with Sound(desk.problems.append, look_up=desk.look_up, open_output=desk.open_output) as made:
        yield made


def wait_for(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline_s, "it did not happen"
        time.sleep(0.005)


def opened(sound: Sound, device: AudioDevice | None = None, **options: float) -> None:
    """Asks for a device and waits until that was obeyed or refused."""
    done = sound.status().changes_done
    sound.open(device, **options)  # type: ignore[arg-type]
    wait_for(lambda: sound.status().changes_done > done)


def lasting(sound: Sound) -> Voice:
    voice = Voice.of_samples(plain_program(sound.rate_hz), np.full((1000, 1), 0.25, np.float32))
    voice.loop()
    sound.mixer.add(voice)
    return voice


def test_without_a_device_time_goes_on(sound: Sound) -> None:
    voice = lasting(sound)
    wait_for(lambda: voice.seconds > 0.02)
    assert sound.status().device is None
    assert sound.now_s() > 0


def test_the_systems_default_is_opened_at_its_own_rate(sound: Sound, desk: Desk, headphones: AudioDevice) -> None:
    before = sound.mixer
    opened(sound)
    wait_for(lambda: sound.status().load == 0.25)
    status = sound.status()
    assert (status.device, status.rate_hz, status.latency_s) == (headphones, 48_000, BUFFER_S)
    assert sound.now_s() == 7.0
    assert sound.mixer is before is desk.outputs[0].mixer
    assert status.problem is None
    assert desk.problems == []


def test_what_rings_goes_on_where_the_rate_stays(sound: Sound, desk: Desk) -> None:
    desk.devices.append(AudioDevice("Monitor", "Test API", 48_000))
    opened(sound)
    voice = lasting(sound)
    opened(sound, desk.devices[-1], buffer_s=0.03)
    assert sound.mixer.voices == [voice]
    assert desk.outputs[0].closed
    assert desk.outputs[1].mixer is desk.outputs[0].mixer
    assert desk.outputs[1].latency_s == 0.03


def test_another_rate_has_another_mixer_as_loud(sound: Sound, desk: Desk, speakers: AudioDevice) -> None:
    opened(sound)
    sound.set_volume_db(-20.0)
    before = sound.mixer
    opened(sound, speakers)
    assert sound.mixer is not before
    assert (sound.rate_hz, sound.mixer.rate_hz) == (44_100, 44_100)
    wait_for(lambda: sound.status().rate_hz == 44_100)
    assert sound.mixer.voices == []
    lasting(sound)
    found = sound.mixer.render(20_000)
    np.testing.assert_allclose(found[-100:], 0.025, rtol=1e-5)


def test_what_is_set_while_a_device_is_being_opened_is_heard(sound: Sound, desk: Desk, speakers: AudioDevice) -> None:
    """A device may take a second to open, in which the window sets volume, body and room."""
    opened(sound)
    open_output = desk.open_output
    effects = Effects(room=Room(0.3, 1.0))

    def slow(device: AudioDevice, buffer_s: float, mixer: Mixer) -> FakeOutput:
        sound.set_volume_db(-20.0)
        sound.set_effects(effects)
        return open_output(device, buffer_s, mixer)

    sound._open_output = slow
    opened(sound, speakers)
    assert (sound.rate_hz, sound.mixer.effects) == (44_100, effects)
    sound.set_effects(None)
    lasting(sound)
    found = sound.mixer.render(20_000)
    np.testing.assert_allclose(found[-100:], 0.025, rtol=1e-5)


def test_a_device_of_one_channel_has_a_mixer_of_one(sound: Sound, desk: Desk) -> None:
    desk.devices.insert(0, AudioDevice("Telephone", "Test API", 48_000, channels=1))
    opened(sound)
    assert sound.mixer.channels == 1


def test_rate_and_buffer_may_be_chosen(sound: Sound, desk: Desk, headphones: AudioDevice) -> None:
    opened(sound, headphones, rate_hz=96_000, buffer_frames=480)
    assert sound.rate_hz == 96_000
    assert desk.outputs[-1].device == replace(headphones, default_rate_hz=96_000)
    assert desk.outputs[-1].latency_s == 0.005


def test_asking_for_what_there_is_changes_nothing(sound: Sound, desk: Desk, headphones: AudioDevice) -> None:
    opened(sound, headphones)
    opened(sound, headphones)
    assert len(desk.outputs) == 1
    assert not desk.outputs[0].closed


def test_a_look_for_devices_interrupts_and_takes_the_same_again(sound: Sound, desk: Desk) -> None:
    """Also the second time, when nothing else is new. PortAudio must never start again under an open stream."""
    for _ in range(3):
        opened(sound, rescan=True)
        wait_for(lambda: sound.status().device is not None)
    assert [output.closed for output in desk.outputs] == [True, True, False]
    assert desk.rescans == 3
    assert desk.rescans_while_open == 0


def test_where_another_is_refused_the_former_plays_on(
    sound: Sound, desk: Desk, headphones: AudioDevice, speakers: AudioDevice
) -> None:
    opened(sound, headphones)
    voice = lasting(sound)
    desk.refusals["Speakers"] = refused(ValueError("busy"), "Speakers", 44_100)
    opened(sound, speakers)
    assert [problem.kind for problem in desk.problems] == [ProblemKind.BUSY]
    assert sound.status().device == headphones
    assert "in use by another program" in str(sound.status().problem)
    assert sound.mixer.voices == [voice]
    assert not desk.outputs[-1].closed
    opened(sound, replace(headphones, name="Gone"))
    assert desk.problems[-1].kind is ProblemKind.VANISHED
    assert sound.status().device == headphones


def test_a_new_rate_that_is_refused_leaves_the_old_one(sound: Sound, desk: Desk, headphones: AudioDevice) -> None:
    opened(sound, headphones)
    open_output = desk.open_output

    def picky(device: AudioDevice, buffer_s: float, mixer: Mixer) -> FakeOutput:
        if device.default_rate_hz == 192_000:
            raise refused(ValueError("Invalid sample rate"), device.name, 192_000)
        return open_output(device, buffer_s, mixer)

    sound._open_output = picky
    opened(sound, headphones, rate_hz=192_000)
    assert [problem.kind for problem in desk.problems] == [ProblemKind.RATE_REFUSED]
    assert (sound.rate_hz, sound.status().device) == (48_000, headphones)


def test_no_device_at_all_is_reported_and_time_goes_on(sound: Sound, desk: Desk) -> None:
    desk.devices.clear()
    opened(sound)
    voice = lasting(sound)
    wait_for(lambda: voice.seconds > 0.02)
    assert [problem.kind for problem in desk.problems] == [ProblemKind.NO_DEVICE]
    assert sound.status().device is None


def test_a_lost_device_is_reported_once_and_found_again(
    sound: Sound, desk: Desk, headphones: AudioDevice, speakers: AudioDevice
) -> None:
    opened(sound)  # the default, whichever it is
    voice = lasting(sound)
    desk.devices.remove(headphones)
    desk.outputs[0].is_lost = True
    wait_for(lambda: desk.problems != [])
    assert desk.outputs[0].closed
    at_s = voice.seconds
    wait_for(lambda: voice.seconds > at_s + 0.02)  # the clock takes over
    tries = desk.rescans
    wait_for(lambda: desk.rescans > tries + 2)
    assert [problem.kind for problem in desk.problems] == [ProblemKind.VANISHED]
    assert len(desk.outputs) == 1, "it is not replaced by another that nobody chose"
    assert "disconnected" in str(sound.status().problem)
    desk.devices.insert(0, headphones)
    wait_for(lambda: sound.status().device == headphones)
    assert sound.mixer.voices == [voice]
    assert sound.status().problem is None
    assert len(desk.problems) == 1
    assert desk.rescans_while_open == 0


def test_while_one_is_missed_another_may_be_chosen(
    sound: Sound, desk: Desk, headphones: AudioDevice, speakers: AudioDevice
) -> None:
    opened(sound, headphones)
    desk.devices.remove(headphones)
    desk.outputs[0].is_lost = True
    wait_for(lambda: desk.problems != [])
    opened(sound, speakers)
    wait_for(lambda: sound.status().device == speakers)
    desk.devices.append(headphones)
    tries = desk.rescans
    time.sleep(0.2)
    assert (sound.status().device, desk.rescans) == (speakers, tries)


def test_a_stall_is_reported_and_withdrawn(sound: Sound, desk: Desk) -> None:
    opened(sound)
    desk.outputs[0].is_stalled = True
    wait_for(lambda: desk.problems != [])
    assert "“Headphones” stopped" in str(sound.status().problem)
    time.sleep(0.2)
    assert [problem.kind for problem in desk.problems] == [ProblemKind.STALLED]
    desk.outputs[0].is_stalled = False
    wait_for(lambda: sound.status().problem is None)
    desk.outputs[0].is_stalled = True
    wait_for(lambda: len(desk.problems) == 2)
    assert not desk.outputs[0].closed


def test_what_has_rung_out_is_freed_and_gaps_are_kept(sound: Sound, desk: Desk) -> None:
    opened(sound)
    sound.mixer.add(Voice.of_samples(plain_program(48_000), np.full((64, 1), 30.0, np.float32)))
    sound.mixer.render(640)
    wait_for(lambda: sound.status().gaps != ())
    wait_for(lambda: sound.mixer._voices == [])
    assert [gap.cause for gap in sound.status().gaps] == ["runaway"]


def test_a_fault_of_the_program_is_reported_with_its_details(desk: Desk) -> None:
    def faulty(device: AudioDevice | None, rescan: bool) -> AudioDevice:
        raise ZeroDivisionError("a mistake")

    with Sound(desk.problems.append, look_up=faulty, open_output=desk.open_output) as sound:
        sound.open()
        wait_for(lambda: desk.problems != [])
    (problem,) = desk.problems
    assert "internal error" in problem.message
    assert "a mistake" in problem.detail


def broken(*_: object) -> None:
    raise ZeroDivisionError("a mistake")


def plays_on(sound: Sound, desk: Desk) -> None:
    """What is asked of it is done, and the mixer is still the device's."""
    opened(sound, buffer_s=0.5)
    wait_for(lambda: sound.status().latency_s == 0.5)
    assert sound.mixer is desk.outputs[-1].mixer and not desk.outputs[-1].closed
    voice = lasting(sound)
    assert np.abs(sound.mixer.render(4800)).max() > 0.1
    assert not voice.over


@pytest.mark.parametrize("stage", ["watch", "forget_ended", "set_effects"])
def test_a_fault_of_the_supervision_is_reported_once_and_sound_continues(
    sound: Sound, desk: Desk, monkeypatch: pytest.MonkeyPatch, stage: str
) -> None:
    opened(sound)
    if stage == "watch":
        sound.watch(broken)
    else:
        monkeypatch.setattr(Mixer, stage, broken)
        opened(sound, buffer_s=0.2)
    wait_for(lambda: desk.problems != [])
    plays_on(sound, desk)
    (problem,) = desk.problems
    assert problem.kind is ProblemKind.INTERNAL and "Playback continues" in problem.message
    assert "a mistake" in problem.detail
    assert sound.status().problem is None, "nothing is wrong with the device"


def test_an_output_that_cannot_be_supervised_is_opened_again(
    sound: Sound, desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sound_module, "RESTART_AFTER", 2)
    opened(sound)
    first = desk.outputs[0]

    def close() -> None:
        first.closed = True
        broken()

    monkeypatch.setattr(first, "load", broken)
    monkeypatch.setattr(first, "close", close)
    wait_for(lambda: len(desk.outputs) == 2)
    plays_on(sound, desk)
    assert [problem.kind for problem in desk.problems] == [ProblemKind.INTERNAL]


def test_a_device_that_stops_under_load_is_opened_again_at_once(
    sound: Sound, desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody waits for it as for one that was unplugged, and what rings continues."""
    monkeypatch.setattr(sound_module, "TRY_AGAIN_S", 1e6)
    opened(sound)
    voice = lasting(sound)
    sound.mixer.record["calls"] += 1
    desk.outputs[0].is_lost = True
    wait_for(lambda: len(desk.outputs) == 2 and sound.status().gaps != ())
    assert desk.outputs[0].closed and desk.problems == []
    assert sound.mixer.voices == [voice]
    (gap,) = sound.status().gaps
    assert gap.cause == "device" and gap.milliseconds >= 0
    desk.outputs[1].is_lost = True  # this one has never played
    wait_for(lambda: desk.problems != [])
    assert [problem.kind for problem in desk.problems] == [ProblemKind.VANISHED]


@pytest.mark.parametrize("stage", ["look_up", "open_output"])
def test_a_fault_while_a_device_is_opened_is_tried_again(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, stage: str
) -> None:
    monkeypatch.setattr(sound_module, "TRY_AGAIN_S", 0.05)
    works, faults = getattr(desk, stage), [True, True]

    def at_first_broken(*values: object) -> object:
        if faults:
            faults.pop()
            broken()
        return works(*values)

    monkeypatch.setattr(desk, stage, at_first_broken)
    with Sound(desk.problems.append, look_up=desk.look_up, open_output=desk.open_output) as sound:
        sound.open()
        wait_for(lambda: sound.status().device is not None)
        assert [problem.kind for problem in desk.problems] == [ProblemKind.OTHER]
        plays_on(sound, desk)


def test_a_fault_where_problems_are_shown_stops_nothing(desk: Desk) -> None:
    desk.refusals["Speakers"] = refused(OSError("busy"), "Speakers", 44_100)
    with Sound(broken, look_up=desk.look_up, open_output=desk.open_output) as sound:
        opened(sound)
        opened(sound, desk.devices[1])
        wait_for(lambda: sound.status().problem is not None)
        plays_on(sound, desk)


def test_who_hears_of_a_problem_finds_it_in_the_status(desk: Desk) -> None:
    desk.devices.clear()
    found: list[str | None] = []
    with Sound(look_up=desk.look_up, open_output=desk.open_output) as sound:
        sound._on_problem = lambda problem: found.append(sound.status().problem)
        sound.open()
        wait_for(lambda: found != [])
    assert "No audio output" in str(found[0])


def test_closing_frees_the_device_and_may_be_repeated(sound: Sound, desk: Desk) -> None:
    opened(sound)
    sound.close()
    assert desk.outputs[0].closed
    assert not sound._caretaker.is_alive()
    sound.close()
    sound.open()  # nobody obeys, and nothing is wrong
    assert len(desk.outputs) == 1


def test_closing_from_the_problem_itself_is_no_dead_lock(desk: Desk) -> None:
    desk.devices.clear()
    closed = threading.Event()
    sound = Sound(look_up=desk.look_up, open_output=desk.open_output)

    def close(problem: AudioProblem) -> None:
        sound.close()
        closed.set()

    sound._on_problem = close
    sound.open()
    assert closed.wait(TIMEOUT_S)
    sound.close()


@pytest.mark.parametrize("volume_db", [float("nan"), float("inf")])
def test_impossible_volumes_are_refused(sound: Sound, volume_db: float) -> None:
    with pytest.raises(ValueError, match="volume cannot be"):
        sound.set_volume_db(volume_db)


def test_minus_infinity_mutes(sound: Sound, desk: Desk) -> None:
    opened(sound)
    lasting(sound)
    sound.set_volume_db(float("-inf"))
    sound.mixer.render(40_000)
    assert not sound.mixer.render(1000).any()

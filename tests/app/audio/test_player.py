"""The player with a fake device that the tests drive, and without any."""

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from app.audio.stream import AHEAD_S, BUFFER_S, SOON_S, OutputStream

from app.audio import AudioDevice, AudioProblem, AudioUnavailable, Mixer, Player, ProblemKind, Track
from app.audio import player as player_module
from app.audio import stream as stream_module
from app.audio.problems import no_device, vanished

RATE_HZ = 48_000
BLOCK_FRAMES = 256


def make_track(rate_hz: int = RATE_HZ, seconds: float = 1.0) -> Track:
    frames = round(rate_hz * seconds)
    samples = 0.5 * np.sin(2 * np.pi * 220 * np.arange(frames) / rate_hz)
    track = Track(rate_hz, frames, ("model", "truth"))
    track.append({"model": samples, "truth": -samples})
    return track


def wait_until(condition: Callable[[], bool], timeout_s: float = 5.0) -> None:
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, "it never came true"
        time.sleep(0.002)


class Bench:
    """A player, the fake devices that it may open, and what it has complained about."""

    def __init__(self, open_fake: Any, raw_streams: list[Any]) -> None:
        self.problems: list[AudioProblem] = []
        self.devices: dict[str, AudioDevice] = {}
        self.refusal: AudioUnavailable | None = None
        self.accepted_hz = 0  # in spite of the refusal
        self.raw_streams = raw_streams
        self._open_fake = open_fake
        self.player = Player(self.problems.append, look_up=self._look_up, open_output=self._open)

    def add(self, name: str, rate_hz: int = RATE_HZ) -> AudioDevice:
        self.devices[name] = AudioDevice(name, "Test API", rate_hz)
        return self.devices[name]

    def open(self, device: AudioDevice | None) -> Any:
        """Opens a device and returns its raw stream."""
        self.player.open(device)
        wait_until(lambda: self.player.status().device is not None)
        return self.raw_streams[-1]

    def play(self, track: Track) -> Any:
        """Plays on the first device, which is added where there is none; returns its raw stream."""
        if not self.devices:
            self.add("Headphones")
        raw = self.open(None)
        self.player.load(track)
        self.player.play()
        return raw

    def hear(self, raw: Any, blocks: int) -> np.ndarray:
        """Lets the device play, never faster than the player feeds it; shape (frames,)."""
        heard = []
        output = raw.callback.__self__
        self.let_it_see()  # a device that took its time would see to that
        for _ in range(blocks):
            wait_until(lambda: output.frames_queued - output.frames_written >= 4 * BLOCK_FRAMES)
            heard.append(raw.tick()[:, 0])
        return np.concatenate(heard)

    def let_it_see(self) -> None:
        """Until the feeder has obeyed what it was told, and taken what is rendered."""
        for _ in range(2):  # it looks after rendering when it has obeyed
            seen = threading.Event()
            self.player._send(seen.set, of_output=True)
            wait_until(seen.is_set)

    def _look_up(self, device: AudioDevice | None, rescan: bool) -> AudioDevice:
        if not self.devices:
            raise no_device()
        return next(iter(self.devices.values())) if device is None else self.devices[device.name]

    def _open(self, device: AudioDevice, buffer_s: float) -> OutputStream:
        if self.refusal is not None and device.default_rate_hz != self.accepted_hz:
            raise self.refusal
        return OutputStream(device, buffer_s, BLOCK_FRAMES, self._open_fake)


def assert_heard(heard: np.ndarray, mixer: Mixer) -> None:
    """A second of what the mixer plays is in what was heard, from the first sample that is not zero."""
    expected = mixer.next_block(RATE_HZ)[:, 0]
    start = int(np.argmax(heard != 0)) - int(np.argmax(expected != 0))
    assert start % BLOCK_FRAMES == 0
    np.testing.assert_allclose(heard[start : start + RATE_HZ], expected, atol=1e-6)


@pytest.fixture
def bench(open_fake: Any, raw_streams: list[Any]) -> Iterator[Bench]:
    bench = Bench(open_fake, raw_streams)
    yield bench
    bench.player.close()


def test_without_a_device_the_playhead_moves_all_the_same(bench: Bench) -> None:
    player = bench.player
    player.open()
    wait_until(lambda: bench.problems != [])
    assert [problem.kind for problem in bench.problems] == [ProblemKind.NO_DEVICE]
    player.load(make_track())
    player.play()
    wait_until(lambda: player.status().position_s > 0)
    began_s, position_s = time.monotonic(), player.status().position_s
    time.sleep(0.3)
    moved_s, elapsed_s = player.status().position_s - position_s, time.monotonic() - began_s
    assert 0 < moved_s < elapsed_s + 0.15  # a busy computer may only be late
    status = player.status()
    assert status.playing
    assert status.device is None
    assert status.problem is not None
    assert "no sound output" in status.problem
    wait_until(lambda: not player.status().playing)
    assert player.status().position_s == pytest.approx(1.0)


def test_the_device_plays_what_the_mixer_renders(bench: Bench) -> None:
    track = make_track()
    raw = bench.play(track)
    heard = bench.hear(raw, 250)
    mixer = Mixer(RATE_HZ)
    mixer.load(track)
    mixer.play()
    assert_heard(heard, mixer)
    assert bench.player.status().underruns == 0
    assert bench.problems == []


def test_a_strike_loads_chooses_and_plays_beside_what_rings(bench: Bench) -> None:
    bench.add("Headphones")
    raw, track, player = bench.open(None), make_track(), bench.player
    player.strike(track, "truth")
    heard = bench.hear(raw, 250)
    mixer = Mixer(RATE_HZ)
    mixer.load(track)
    mixer.select("truth")
    mixer.play()
    assert_heard(heard, mixer)
    player.strike(track, "truth")
    bench.hear(raw, 20)
    player.strike(track, "a source that it has not")
    bench.hear(raw, 20)
    wait_until(lambda: player.status().ringing == 1)
    assert (player.track, player.status().source, player.status().playing) == (track, "truth", True)
    with pytest.raises(ValueError, match="8000 Hz, the player 48000 Hz"):
        player.strike(make_track(8_000), "truth")


def test_a_command_is_heard_within_30_ms_of_device_time(bench: Bench) -> None:
    bench.add("Headphones")
    raw = bench.open(None)
    bench.player.load(make_track())
    bench.hear(raw, 100)  # by now silence is ready for a quarter of a second
    bench.player.play()
    heard = bench.hear(raw, 20)
    assert 0 < np.argmax(heard != 0) <= 0.03 * RATE_HZ


def switched_in(sound: np.ndarray, track: Track) -> int:
    """The block in which a sound of `track` goes over to the truth, without a sample lost on either side."""
    start = int(np.argmax(sound != 0)) // BLOCK_FRAMES
    for block in range(start, len(sound) // BLOCK_FRAMES):
        mixer = Mixer(RATE_HZ)
        mixer.load(track)
        mixer.play()
        before = mixer.next_block((block - start) * BLOCK_FRAMES)
        mixer.select("truth")
        after = mixer.next_block(len(sound) - block * BLOCK_FRAMES)
        if np.abs(sound[start * BLOCK_FRAMES :] - np.concatenate([before, after])[:, 0]).max() < 1e-6:
            return block
    raise AssertionError("it is no such sound")


def test_a_switch_changes_what_was_mixed_ahead_and_loses_no_sample(bench: Bench) -> None:
    track = make_track()
    raw = bench.play(track)
    heard = [bench.hear(raw, 80)]
    bench.player.select("truth")
    heard.append(bench.hear(raw, 80))
    assert 80 <= switched_in(np.concatenate(heard), track) < 86


def test_the_old_sound_goes_on_until_a_command_is_mixed(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """However long that takes: the device plays what was there, and the command is heard later."""
    track = make_track()
    raw = bench.play(track)
    heard = [bench.hear(raw, 100)]
    output = raw.callback.__self__
    wait_until(lambda: output.queued_blocks * BLOCK_FRAMES >= AHEAD_S * RATE_HZ)
    goes_on, began = threading.Event(), threading.Event()
    next_block = Mixer.next_block

    def slow(mixer: Mixer, frames: int) -> np.ndarray:
        began.set()
        goes_on.wait(10)
        return next_block(mixer, frames)

    monkeypatch.setattr(Mixer, "next_block", slow)
    bench.player.select("truth")
    began.wait(10)
    for _ in range(output.prompt_blocks + 5):  # further than the command wanted to begin
        heard.append(raw.tick()[:, 0])
    goes_on.set()
    wait_until(lambda: bench.player.status().source == "truth")
    heard.append(bench.hear(raw, 40))
    assert 100 + output.prompt_blocks + 5 <= switched_in(np.concatenate(heard), track) < 130
    assert bench.player.status().underruns == 0


def test_a_busy_moment_of_the_interpreter_is_not_heard(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    track = make_track()
    raw = bench.play(track)
    heard = [bench.hear(raw, 100)]
    wait_until(lambda: raw.callback.__self__.queued_blocks * BLOCK_FRAMES >= AHEAD_S * RATE_HZ)
    goes_on = threading.Event()
    next_block = Mixer.next_block
    monkeypatch.setattr(Mixer, "next_block", lambda *these: goes_on.wait(10) and next_block(*these))
    heard += [raw.tick()[:, 0] for _ in range(round(0.24 * RATE_HZ / BLOCK_FRAMES))]
    goes_on.set()
    sound = np.concatenate(heard)
    mixer = Mixer(RATE_HZ)
    mixer.load(track)
    mixer.play()
    start = int(np.argmax(sound != 0)) // BLOCK_FRAMES * BLOCK_FRAMES
    np.testing.assert_allclose(sound[start:], mixer.next_block(len(sound) - start)[:, 0], atol=1e-6)
    assert bench.player.status().underruns == 0


def test_a_busy_moment_after_a_command_is_not_heard(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """As long as a few blocks of sound; what is further ahead has been taken back for the command."""
    raw = bench.play(make_track())
    bench.hear(raw, 100)
    bench.player.select("truth")
    bench.let_it_see()
    output = raw.callback.__self__
    wait_until(lambda: output.queued_blocks * BLOCK_FRAMES >= (BUFFER_S + SOON_S - 0.01) * RATE_HZ)
    goes_on = threading.Event()
    next_block = Mixer.next_block
    monkeypatch.setattr(Mixer, "next_block", lambda *these: goes_on.wait(10) and next_block(*these))
    for _ in range(round(0.06 * RATE_HZ / BLOCK_FRAMES)):
        raw.tick()
    goes_on.set()
    assert bench.player.status().underruns == 0


def test_what_rendering_may_change_is_mixed_a_little_ahead_and_changed(bench: Bench) -> None:
    track = Track(RATE_HZ, RATE_HZ, ("model", "truth"))
    raw = bench.play(track)
    bench.hear(raw, 100)  # of silence: the render worker has not begun
    output = raw.callback.__self__
    assert output.queued_blocks * BLOCK_FRAMES <= (BUFFER_S + SOON_S + 0.01) * RATE_HZ
    samples = np.full(RATE_HZ // 2, 0.5)
    track.append({"model": samples, "truth": samples})
    assert np.argmax(bench.hear(raw, 20) != 0) <= 0.03 * RATE_HZ
    bench.hear(raw, 50)
    wait_until(lambda: output.queued_blocks > 4 * output.prompt_blocks)


def test_rendering_that_is_only_just_ahead_is_heard_whole(bench: Bench) -> None:
    """The queue goes further than what is rendered: there it fades out, until more comes."""
    whole = make_track()
    track = Track(RATE_HZ, RATE_HZ, whole.sources)

    def render(frames: int) -> None:
        done = track.ready_frames
        track.append({source: whole.read(source, done, done + frames) for source in whole.sources})

    render(round(0.05 * RATE_HZ))
    bench.add("Headphones")
    raw = bench.open(None)
    heard = [bench.hear(raw, 20)]
    bench.player.strike(track, "model")
    while track.ready_frames < RATE_HZ:
        bench.let_it_see()
        heard.append(bench.hear(raw, 1))
        render(min(BLOCK_FRAMES, RATE_HZ - track.ready_frames))
    track.finish()
    heard.append(bench.hear(raw, 40))
    mixer = Mixer(RATE_HZ)
    mixer.load(whole)
    mixer.play()
    assert_heard(np.concatenate(heard), mixer)


def test_the_position_is_that_of_what_is_heard(bench: Bench) -> None:
    raw = bench.play(make_track())
    start = int(np.argmax(bench.hear(raw, 100) != 0)) // BLOCK_FRAMES * BLOCK_FRAMES
    expected_s = (100 * BLOCK_FRAMES - start) / RATE_HZ - raw.latency
    wait_until(lambda: bench.player.status().position_s == pytest.approx(expected_s, abs=1e-3))


def test_commands_reach_the_mixer(bench: Bench) -> None:
    player = bench.player
    player.load(make_track())
    player.seek(0.4)
    player.select("truth")
    player.set_loop(True)
    player.set_volume_db(-6)
    player.play()
    wait_until(lambda: player.status().position_s > 0.45)
    assert player.status().source == "truth"
    wait_until(lambda: player.status().peak_db == pytest.approx(20 * np.log10(0.5) - 6, abs=0.2))
    wait_until(lambda: player.status().position_s < 0.4)
    player.stop()
    wait_until(lambda: not player.status().playing)


def test_wrong_calls_fail_in_the_callers_thread(bench: Bench) -> None:
    player = bench.player
    with pytest.raises(ValueError, match="44100 Hz, the player 48000 Hz"):
        player.load(make_track(44_100))
    player.load(make_track())
    with pytest.raises(ValueError, match="no source 'physics'"):
        player.select("physics")
    with pytest.raises(ValueError, match="playhead"):
        player.seek(float("nan"))
    with pytest.raises(ValueError, match="volume"):
        player.set_volume_db(float("nan"))


def test_changing_the_device_keeps_the_sound_going(bench: Bench) -> None:
    bench.add("Speakers")
    headphones = bench.add("Headphones")
    old = bench.play(make_track())
    bench.hear(old, 50)
    bench.player.open(headphones)
    wait_until(lambda: bench.player.status().device == headphones)
    new = bench.raw_streams[-1]
    assert old.calls == ["start", "abort", "close"]
    assert new.active
    assert bench.hear(new, 20).any()
    assert bench.player.status().playing
    assert bench.problems == []


def test_a_device_that_fails_to_open_leaves_the_present_one(bench: Bench) -> None:
    speakers = bench.add("Speakers")
    raw = bench.play(make_track())
    bench.hear(raw, 20)
    bench.refusal = AudioUnavailable(AudioProblem(ProblemKind.BUSY, "In use.", "Close the other program."))
    bench.player.open(bench.add("Headphones"))
    wait_until(lambda: bench.problems != [])
    assert bench.hear(raw, 20)[-BLOCK_FRAMES:].any()
    wait_until(lambda: bench.player.status().playing)
    status = bench.player.status()
    assert status.device == speakers
    assert status.problem == "In use. Close the other program."
    bench.player.open(speakers)  # already open: it would be busy with ourselves
    wait_until(lambda: bench.player.status().problem is None)
    assert len(bench.raw_streams) == 1
    assert len(bench.problems) == 1


def test_another_buffer_opens_the_device_again(bench: Bench) -> None:
    old = bench.play(make_track())
    bench.hear(old, 20)
    bench.player.open(None, buffer_s=0.1)
    wait_until(lambda: len(bench.raw_streams) == 2 and bench.raw_streams[1].active)
    assert old.calls == ["start", "abort", "close"]
    assert bench.hear(bench.raw_streams[1], 40).any()
    assert bench.problems == []


def test_a_chosen_rate_and_buffer_open_the_device_again(bench: Bench) -> None:
    bench.add("Speakers")
    bench.open(None)
    bench.player.open(None, rate_hz=96_000, buffer_frames=128)
    wait_until(lambda: bench.player.rate_hz == 96_000)
    assert bench.raw_streams[0].calls == ["start", "abort", "close"]
    assert bench.raw_streams[1].shape == (64, 2)  # two blocks are the buffer
    assert bench.problems == []


def test_a_refused_rate_leaves_the_device_as_it_was(bench: Bench) -> None:
    speakers = bench.add("Speakers")
    bench.play(make_track())
    bench.refusal = AudioUnavailable(AudioProblem(ProblemKind.RATE_REFUSED, "No 96 kHz.", "Choose another."))
    bench.accepted_hz = RATE_HZ
    bench.player.open(None, rate_hz=96_000)
    wait_until(lambda: bench.player.status().changes_done == 2)
    status = bench.player.status()
    assert (status.device, status.rate_hz) == (speakers, RATE_HZ)
    assert status.problem == "No 96 kHz. Choose another."
    assert bench.hear(bench.raw_streams[-1], 20).any()


def test_looking_for_new_devices_finds_one_and_keeps_the_present(bench: Bench) -> None:
    bench.add("Speakers")
    bench.play(make_track())
    bench.player.open(None, rescan=True)
    wait_until(lambda: len(bench.raw_streams) == 2 and bench.player.status().changes_done == 2)
    assert bench.hear(bench.raw_streams[-1], 20).any()
    assert bench.problems == []


def test_a_device_that_is_missing_at_the_start_is_taken_when_it_comes(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(player_module, "TRY_AGAIN_S", 0.05)

    def look_up(device: AudioDevice | None, rescan: bool) -> AudioDevice:
        if "Headphones" not in bench.devices:
            raise vanished("Headphones")
        return bench.devices["Headphones"]

    bench.player._look_up = look_up
    bench.player.open(AudioDevice("Headphones", "Test API"), rate_hz=44_100)
    wait_until(lambda: bench.problems != [])
    bench.add("Headphones")
    wait_until(lambda: bench.player.status().device is not None)
    assert bench.player.rate_hz == 44_100
    assert len(bench.problems) == 1


@pytest.mark.parametrize(("side", "silent"), [("left", 1), ("right", 0)])
def test_the_tone_sounds_on_its_side_alone(bench: Bench, side: Any, silent: int) -> None:
    bench.add("Headphones")
    raw = bench.open(None)
    bench.player.sound_tone(side)
    output = raw.callback.__self__
    heard = []
    for _ in range(240):
        wait_until(lambda: output.frames_queued - output.frames_written >= 4 * BLOCK_FRAMES)
        heard.append(raw.tick())
    both = np.concatenate(heard)
    assert not both[:, silent].any()
    assert np.abs(both[:, 1 - silent]).max() == pytest.approx(0.1, rel=0.01)
    assert not both[-BLOCK_FRAMES:].any()
    crossings = np.count_nonzero(np.diff(np.signbit(both[:, 1 - silent])))
    assert crossings == pytest.approx(880, abs=3)


def test_a_device_of_another_rate_unloads_the_track(bench: Bench) -> None:
    bench.add("Old card", rate_hz=44_100)
    bench.player.load(make_track())
    bench.player.select("truth")
    bench.player.play()
    raw = bench.open(None)
    wait_until(lambda: bench.player.rate_hz == 44_100)
    assert not bench.player.status().playing
    bench.player.load(make_track(44_100))
    bench.player.play()
    assert bench.hear(raw, 20).any()
    assert bench.player.status().source == "truth"


@pytest.mark.parametrize("how", ["stands still", "inactive"])
def test_a_device_that_vanishes_is_reported_once_and_the_clock_goes_on(
    bench: Bench, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream_module, "START_GRACE_S", 0.0)
    monkeypatch.setattr(stream_module, "LOST_AFTER_S", 0.5)  # before it is told as a stall
    bench.add("Headphones")
    raw = bench.open(None)
    bench.player.load(make_track(seconds=10.0))
    bench.player.play()
    bench.hear(raw, 20)
    if how == "inactive":
        raw.active = False
    wait_until(lambda: bench.player.status().device is None)
    assert [problem.kind for problem in bench.problems] == [ProblemKind.VANISHED]
    assert "“Headphones”" in bench.problems[0].message
    position_s = bench.player.status().position_s
    wait_until(lambda: bench.player.status().position_s > position_s + 0.1)
    assert len(bench.problems) == 1
    assert raw.calls == ["start", "abort", "close"]


def test_a_device_that_stalls_is_told_once_and_kept(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream_module, "START_GRACE_S", 0.0)
    monkeypatch.setattr(stream_module, "STALLED_AFTER_S", 0.2)
    bench.add("Headphones")
    raw = bench.open(None)
    bench.player.load(make_track(seconds=10.0))
    bench.player.play()
    bench.hear(raw, 20)
    wait_until(lambda: bench.player.status().problem is not None)
    assert [problem.kind for problem in bench.problems] == [ProblemKind.STALLED]
    assert "keeps trying" in str(bench.problems[0])
    assert bench.player.status().device is not None
    assert bench.hear(raw, 20).any()
    wait_until(lambda: bench.player.status().problem is None)
    assert len(bench.problems) == 1
    assert raw.calls == ["start"]


def test_a_device_that_comes_back_is_taken_again(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(player_module, "TRY_AGAIN_S", 0.05)
    bench.add("Headphones")
    raw = bench.open(None)
    raw.active = False
    wait_until(lambda: bench.player.status().device is None)
    assert bench.player.status().problem is not None
    wait_until(lambda: bench.player.status().device is not None)
    assert bench.player.status().problem is None
    assert len(bench.problems) == 1


def test_a_fault_in_the_feeder_is_reported(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(mixer: Mixer, frames: int) -> np.ndarray:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(Mixer, "next_block", fail)
    wait_until(lambda: bench.player.status().problem is not None)
    (problem,) = bench.problems
    assert problem.kind is ProblemKind.OTHER
    assert "a bug" in problem.detail
    wait_until(lambda: not bench.player._feeder.is_alive())
    for _ in range(3):  # nobody would ever obey them
        bench.player.play()
    assert bench.player._commands.empty()
    bench.player.close()


def test_closing_ends_the_thread_and_frees_the_device(bench: Bench) -> None:
    bench.add("Headphones")
    raw = bench.open(None)
    bench.player.close()
    bench.player.close()
    assert "audio-feeder" not in [thread.name for thread in threading.enumerate()]
    assert raw.calls == ["start", "abort", "close"]
    bench.player.play()


def test_it_is_a_context_manager() -> None:
    with Player() as player:
        player.load(make_track())
    assert "audio-feeder" not in [thread.name for thread in threading.enumerate()]

"""The player: a mixer, an output, and the feeder thread between them.

    any thread ── commands ──► feeder thread ── blocks ──► device callback ──► loudspeaker
    any thread ◄── status() ── (owns mixer and output)

Only the feeder touches the mixer and the output. Public methods put a command into its queue and return at
once; it obeys them right before it renders a block. It mixes further ahead than a command may wait, so for one
it goes back to the earliest block that can still be another, and replaces what it had mixed from there on.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import NamedTuple

import numpy as np

from app.audio.ahead import Ahead, Mixed, Moment
from app.audio.devices import AudioDevice
from app.audio.levels import Levels
from app.audio.mixer import Mixer
from app.audio.output import Output, Wanted, look_up, same_device
from app.audio.player_status import DEFAULT_RATE_HZ, PlayerStatus
from app.audio.problems import AudioProblem, AudioUnavailable, ProblemKind, stalled, vanished
from app.audio.silent import SilentOutput
from app.audio.strand import DECLICK_S
from app.audio.stream import BUFFER_S, OutputStream
from app.audio.timeline import Timeline
from app.audio.tone import Side, Tone
from app.audio.track import Track

TRY_AGAIN_S = 2.0  # between two looks for a device that vanished

_WAIT_S = 0.05  # the longest time that the feeder looks at neither its commands nor the device's pulse
_JOIN_TIMEOUT_S = 5.0


class _Command(NamedTuple):
    """What the feeder is to do; unless it is `of_output`, it changes mixer and tone alone, and may be done again."""

    obey: Callable[[], None]
    of_output: bool


class Player:
    """Plays tracks through a device, or silently against a clock as long as there is none.

    Every public method may be called from any thread and returns at once. After `close`, or a fault that ended the
    feeder and that `on_problem` has heard of, commands do nothing.

    Args:
        on_problem: Called once for each fault of a device, from the feeder thread.
        rate_hz: Rate until a device is open.
        look_up, open_output: Find and open a device; tests put others in.
    """

    def __init__(
        self,
        on_problem: Callable[[AudioProblem], None] | None = None,
        rate_hz: int = DEFAULT_RATE_HZ,
        look_up: Callable[[AudioDevice | None, bool], AudioDevice] = look_up,
        open_output: Callable[[AudioDevice, float], Output] = OutputStream,
    ) -> None:
        self._on_problem = on_problem
        self._look_up = look_up
        self._open_output = open_output
        self._mixer = Mixer(rate_hz)
        self._output: Output = SilentOutput(rate_hz)
        self._buffer_s = BUFFER_S
        self._timeline = Timeline(0)
        self._ahead = Ahead()
        self._wanted = Wanted()
        self._changes_done = 0
        self._tone: Tone | None = None
        self._problem: str | None = None
        self._track: Track | None = None  # the caller's latest, to refuse a wrong `select` on the spot
        self._lost: AudioDevice | None = None  # vanished while it was ours: tried again now and then
        self._try_again_s = 0.0
        self._stalled = False  # and told
        self._commands: SimpleQueue[_Command] = SimpleQueue()
        self._over = False  # nobody obeys any more
        self._closing = threading.Event()
        self._status = PlayerStatus(rate_hz=rate_hz)
        self._feeder = threading.Thread(target=self._feed, name="audio-feeder", daemon=True)
        self._feeder.start()

    def open(
        self,
        device: AudioDevice | None = None,
        buffer_s: float = BUFFER_S,
        rate_hz: int = 0,
        buffer_frames: int = 0,
        rescan: bool = False,
    ) -> None:
        """Changes to another device, known by name and host API, or, for None, to the system's default.

        The present one stays until the new one plays, and is taken again if the same device refuses a new rate
        or buffer; then `on_problem` hears of it. Another rate stops playback and unloads the track: load it again
        at `status().rate_hz`. A longer buffer cures crackles and delays commands; see `OutputStream`.

        Args:
            rate_hz: 0 for the device's own.
            buffer_frames: The buffer in frames at that rate; 0 for `buffer_s`.
            rescan: Looks for devices that were plugged in meanwhile, which interrupts the present one.
        """
        wanted = Wanted(device, buffer_s, rate_hz, buffer_frames)
        self._send(lambda: self._change_output(wanted, rescan), of_output=True)

    def sound_tone(self, side: Side) -> None:
        """A soft tone for a second on one side, whatever else is playing."""
        self._send(lambda: self._start_tone(side))

    def load(self, track: Track, keep_position: bool = False, ring: bool = False) -> None:
        """Takes another track: from its beginning, at the same position, or beside the last; see `Mixer.load`."""
        self._take(track)
        self._send(lambda: self._load(track, keep_position, ring))

    def strike(self, track: Track, source: str) -> None:
        """Another pluck, beside those that ring: `load`, `select` where the track has the source, and `play` at once.

        One command, because each is mixed for.
        """
        self._take(track)

        def obey() -> None:
            self._load(track, ring=True)
            self._select(source)
            self._mixer.play()

        self._send(obey)

    def play(self) -> None:
        self._send(lambda: self._mixer.play())

    def stop(self) -> None:
        self._send(lambda: self._mixer.stop())

    def seek(self, position_s: float) -> None:
        if not math.isfinite(position_s):
            raise ValueError(f"The playhead cannot go to {position_s} s.")
        self._send(lambda: self._mixer.seek(position_s))

    def select(self, source: str) -> None:
        """Cross-fades to another source of the track, at the same position."""
        track = self._track
        if track is not None and source not in track.sources:
            raise ValueError(f"The track has no source {source!r}, only {track.sources}.")
        self._send(lambda: self._select(source))

    def set_loop(self, on: bool) -> None:
        self._send(lambda: self._mixer.set_loop(on))

    def set_volume_db(self, volume_db: float) -> None:
        """0 dB plays the samples as they are, minus infinity mutes."""
        if math.isnan(volume_db) or volume_db == math.inf:
            raise ValueError(f"The volume cannot be {volume_db} dB.")
        self._send(lambda: self._mixer.set_volume_db(volume_db))

    def set_levels(self, levels: Levels) -> None:
        """How loud each source is played; see `Levels`."""
        self._send(lambda: self._mixer.set_levels(levels))

    @property
    def track(self) -> Track | None:
        """The latest that was loaded; it may not be heard yet."""
        return self._track

    @property
    def rate_hz(self) -> int:
        """The rate that tracks need now."""
        return self._status.rate_hz

    def status(self) -> PlayerStatus:
        return self._status

    def close(self) -> None:
        """Cuts the sound, ends the thread and frees the device; may be called again."""
        self._closing.set()
        if threading.current_thread() is not self._feeder:
            self._feeder.join(_JOIN_TIMEOUT_S)

    def _take(self, track: Track) -> None:
        rate_hz = self.rate_hz
        if track.rate_hz != rate_hz:
            raise ValueError(f"The track has {track.rate_hz} Hz, the player {rate_hz} Hz: resample it first.")
        self._track = track

    def _send(self, obey: Callable[[], None], of_output: bool = False) -> None:
        if not self._over:
            self._commands.put(_Command(obey, of_output))
            self._output.stop_waiting()

    def __enter__(self) -> Player:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # All below runs in the feeder thread.

    def _feed(self) -> None:
        try:
            while not self._closing.is_set():
                self._wait_for_space(_WAIT_S)
                self._obey_commands()  # after the wait, so that the block to come knows the latest of them
                self._mend()
                if self._wait_for_space(0):  # again: a command may have used it, or changed the output
                    self._write_block()
                    self._end_stall()
                elif self._output.lost():
                    self._go_silent()
                elif self._output.stalled():
                    self._begin_stall()
                self._look_for_the_lost()
                self._publish()
        except Exception:
            self._report(
                AudioProblem(
                    ProblemKind.OTHER,
                    "Playback has stopped because of a fault in this program.",
                    "Start the app again, and please report the details.",
                    traceback.format_exc(),
                )
            )
            self._status = replace(self._status, playing=False, problem=self._problem)
        finally:
            self._over = True
            self._output.close()
            _emptied(self._commands)  # they may hold tracks

    def _wait_for_space(self, timeout_s: float) -> bool:
        return self._output.wait_for_space(timeout_s, self._mixer.steady(self._output.block_frames))

    def _obey_commands(self) -> None:
        for of_output, commands in groupby(_emptied(self._commands), lambda command: command.of_output):
            if of_output:
                for command in commands:
                    command.obey()
            else:
                self._remix(list(commands))

    def _mend(self) -> None:
        """Mixes anew what was mixed before rendering had come so far."""
        output = self._output
        self._ahead.forget_played(output.queued_blocks)
        if late := self._ahead.settled(output.mendable_blocks, output.block_frames):
            self._remix([], late)

    def _remix(self, commands: Sequence[_Command], mended: int = 0) -> None:
        """Obeys in the earliest block that can still be another, or mends the last so many.

        What was mixed stays in the queue until its place is taken, so that no gap depends on how long that takes. If
        the device comes so far meanwhile, all is done again from a later block.
        """
        output, latest = self._output, Moment(self._mixer, self._tone)
        while True:
            count = min(mended, output.mendable_blocks) if mended else output.changeable_blocks
            self._ahead.forget_played(output.queued_blocks)
            moment = self._ahead.moment_before(count)
            self._mixer, self._tone = (moment or latest).again()
            for command in commands:
                command.obey()
            if moment is None:  # nothing of ours lies there: the next block obeys
                return
            mixed = [self._mixed_block()]
            while len(mixed) < count if mended else self._goes_on(len(mixed)):
                mixed.append(self._mixed_block())
            if output.replace(count, [each.block for each in mixed]):
                break
        self._ahead.forget_last(count)
        first_end = output.frames_queued - (len(mixed) - 1) * output.block_frames
        self._timeline.take_back(first_end - output.block_frames)
        for number, each in enumerate(mixed):
            self._note(each, first_end + number * output.block_frames)

    def _goes_on(self, blocks: int) -> bool:
        """Whether more than so many replace what a command has changed."""
        return blocks < self._output.replaced_blocks and self._mixer.steady(self._output.block_frames)

    def _load(self, track: Track, keep_position: bool = False, ring: bool = False) -> None:
        # If the device has changed meanwhile, the caller will see the new rate in status() and load again.
        if track.rate_hz == self._mixer.rate_hz:
            self._mixer.load(track, keep_position, ring)

    def _select(self, source: str) -> None:
        # select() has checked the source; only a track that another thread loaded meanwhile may refuse it.
        with contextlib.suppress(ValueError):
            self._mixer.select(source)

    def _take_back(self) -> None:
        """Leaves in the queue only what must be ready, and goes on from there."""
        count = self._output.changeable_blocks
        self._ahead.forget_played(self._output.queued_blocks)
        moment = self._ahead.moment_before(count)
        if moment is not None and self._output.replace(count):
            self._mixer, self._tone = moment.again()
            self._ahead.forget_last(count)
            self._timeline.take_back(self._output.frames_queued)

    def _mixed_block(self) -> Mixed:
        before = Moment.of(self._mixer, self._tone)
        steady = self._mixer.steady(self._output.block_frames)
        block = self._mixer.next_block(self._output.block_frames)
        if self._tone is not None:
            block = np.clip(block + self._tone.next_block(len(block)), -1, 1)
            self._tone = None if self._tone.over else self._tone
        return Mixed(before, steady, block, self._mixer.status())

    def _write_block(self) -> None:
        mixed = self._mixed_block()
        self._output.write(mixed.block)
        self._note(mixed, self._output.frames_queued)

    def _note(self, mixed: Mixed, end_frame: int) -> None:
        self._ahead.note(mixed)
        state = mixed.after
        self._timeline.note(end_frame, state.position_frames, state.playing and not state.waiting)

    def _start_tone(self, side: Side) -> None:
        device = self._output.device
        alone = device is not None and device.channels == 1
        self._tone = Tone(self._output.rate_hz, "both" if alone else side)

    def _change_output(self, wanted: Wanted, rescan: bool) -> None:
        present, present_buffer_s = self._output.device, self._buffer_s
        self._take_back()  # what is heard may still play where what was mixed ahead is over
        was_playing = self._mixer.status().playing
        self._lost = self._tone = None
        self._fade_to_silence()  # opening takes a while, in which nobody feeds the present device
        released = False
        try:
            if rescan and present is not None:
                self._adopt_output(SilentOutput(self._output.rate_hz))
                released = True
            # PortAudio may only look for new devices while none is open.
            device = wanted.at_its_rate(self._look_up(wanted.device, present is None or released))
            buffer_s = wanted.buffer_s_at(device.default_rate_hz)
            if released or device != present or buffer_s != present_buffer_s:
                if present is not None and not released and same_device(device, present):
                    self._adopt_output(SilentOutput(self._output.rate_hz))  # it might refuse to be opened twice
                    released = True
                self._adopt_output(self._open_output(device, buffer_s))
                self._buffer_s, self._wanted = buffer_s, wanted
            self._problem = None
        except AudioUnavailable as error:
            if released and present is not None:
                self._reopen(present, present_buffer_s)
            elif present is None and error.kind is ProblemKind.VANISHED:  # it may still be plugged in
                self._lost, self._wanted = wanted.device, wanted
                self._try_again_s = time.monotonic() + TRY_AGAIN_S
            self._report(error.problem)
        self._changes_done += 1
        if was_playing:
            self._mixer.play()

    def _reopen(self, device: AudioDevice, buffer_s: float) -> None:
        """The device as it was before a change that was refused; if it is gone too, it is looked for."""
        try:
            self._adopt_output(self._open_output(device, buffer_s))
        except AudioUnavailable:
            self._lost, self._try_again_s = device, time.monotonic() + TRY_AGAIN_S

    def _fade_to_silence(self) -> None:
        self._mixer.stop()
        fade_frames = round(DECLICK_S * self._output.rate_hz)
        for _ in range(math.ceil(fade_frames / self._output.block_frames)):
            if self._output.wait_for_space(_WAIT_S):
                self._write_block()

    def _begin_stall(self) -> None:
        """The device takes nothing, but has not gone: it is told once, and kept."""
        if not self._stalled:
            self._stalled = True
            device = self._output.device
            self._report(stalled("" if device is None else device.name))

    def _end_stall(self) -> None:
        if self._stalled:
            self._stalled, self._problem = False, None

    def _go_silent(self) -> None:
        """The device has vanished: the pictures move on without sound."""
        device = self._output.device
        self._adopt_output(SilentOutput(self._output.rate_hz, self._output.block_frames))
        self._lost, self._try_again_s = device, time.monotonic() + TRY_AGAIN_S
        self._report(vanished("" if device is None else device.name).problem)

    def _look_for_the_lost(self) -> None:
        """A device that vanished is taken again when it is back; until then nothing more is said of it."""
        if self._lost is None or time.monotonic() < self._try_again_s:
            return
        try:
            device = self._wanted.at_its_rate(self._look_up(self._lost, True))
            output = self._open_output(device, self._buffer_s)
        except AudioUnavailable:
            self._try_again_s = time.monotonic() + TRY_AGAIN_S
            return
        self._adopt_output(output)
        self._lost, self._problem = None, None

    def _adopt_output(self, output: Output) -> None:
        old, self._output, self._stalled = self._output, output, False
        if output.rate_hz != self._mixer.rate_hz:
            self._mixer = self._mixer.emptied(output.rate_hz)
        self._timeline, self._ahead = Timeline(self._mixer.position_frames), Ahead()
        old.close()

    def _report(self, problem: AudioProblem) -> None:
        self._problem = str(problem)
        # who hears of it may look at once
        self._status = replace(self._status, problem=self._problem, device=self._output.device)
        if self._on_problem is not None:
            self._on_problem(problem)

    def _publish(self) -> None:
        output = self._output
        self._ahead.forget_played(output.queued_blocks)
        state = self._ahead.status_in(output.prompt_blocks) or self._mixer.status()
        heard_frame = output.frames_written - round(output.latency_s * output.rate_hz)
        self._status = PlayerStatus(
            position_s=self._timeline.position_at(heard_frame) / output.rate_hz,
            playing=state.playing,
            waiting=state.waiting,
            ringing=state.ringing,
            source=state.source,
            peak_db=state.peak_db,
            gain_reduction_db=state.gain_reduction_db,
            limiting=state.limiting,
            non_finite=state.non_finite,
            underruns=output.underruns,
            device=output.device,
            rate_hz=output.rate_hz,
            latency_s=output.latency_s,
            changes_done=self._changes_done,
            problem=self._problem,
        )


def _emptied(commands: SimpleQueue[_Command]) -> list[_Command]:
    """All that lies in the queue, which is empty then."""
    found = []
    with contextlib.suppress(Empty):
        while True:
            found.append(commands.get_nowait())
    return found

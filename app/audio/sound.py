"""The sound of the app: a mixer, the output that takes its frames, and a thread that supervises the output.

any thread ── voices, gains ──► Mixer ◄── device's own thread (compiled, without the interpreter) ──► loudspeaker
caretaker thread: opens and changes devices, reopens lost ones, frees voices that have ended, reports the load
"""

from __future__ import annotations

import math
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from queue import SimpleQueue

from app.audio.choices import DeviceChoice, SoundChoice
from app.audio.devices import AudioDevice, find
from app.audio.output import ClockOutput, DeviceOutput, Output
from app.audio.problems import AudioProblem, ProblemKind, problem
from app.shared.log import faultless, log_fault
from engine.effects import Effects
from engine.voices.mixer import Gap, Mixer

DEFAULT_RATE_HZ = 48_000  # until a device says otherwise
TRY_AGAIN_S = 0.5  # between two looks for a device that vanished; one takes 25 ms of a processor
LOOK_EVERY_S = 0.05  # the caretaker's period
RESTART_AFTER = 20  # looks at the output that failed, 1 s: it is opened again then
MOST_FAULTS = 20  # different internal ones that are reported
MOST_GAPS = 200  # kept; older ones are dropped
JOIN_TIMEOUT_S = 5.0
# of a device that is not there yet
MAY_COME = (ProblemKind.VANISHED, ProblemKind.NOT_STARTED, ProblemKind.NOT_OPENED, ProblemKind.UNEXPECTED)

LookUp = Callable[[DeviceChoice | None, bool], AudioDevice]  # `devices.find`: the choice, and whether to rescan
Open = Callable[[AudioDevice, float, Mixer], Output]  # `DeviceOutput`: device, length of its buffer in s, mixer


@dataclass(frozen=True)
class SoundStatus:
    """A snapshot, some 50 ms old at most.

    Attributes:
        device: the one that plays; None where none does.
        rate_hz: of the mixer; it may change when a device is opened.
        latency_s: the length of the device's buffer.
        gaps: unintended silences (drop-outs), the last `MOST_GAPS` of them.
        load: the share of the device's time that the mixer takes, 0 … 1.
        changes_done: how many calls of `open` have been carried out or refused.
        problem: why there is no sound, or why the last device could not be opened; None where all is well.
    """

    device: AudioDevice | None = None
    rate_hz: int = DEFAULT_RATE_HZ
    latency_s: float = 0.0
    gaps: tuple[Gap, ...] = ()
    load: float = 0.0
    changes_done: int = 0
    problem: str | None = None


@dataclass(frozen=True)
class _Wish:
    """A wish: the arguments of a call of `Sound.open`. `device`: None for the system's default."""

    device: DeviceChoice | None = None
    sound: SoundChoice = field(default_factory=SoundChoice)
    rescan: bool = False


class Sound:
    """The sound of the app: it owns the mixer, the output, and the caretaker thread that supervises the output.

    Public methods may be called from any thread; all but `set_effects` and `close` return at once.

    Args:
        on_problem: called once for each fault of a device or of the supervision, from the caretaker thread.
        rate_hz: of the mixer until a device is opened.
        look_up, open_output: find and open a device; replaced in tests.
    """

    def __init__(
        self,
        on_problem: Callable[[AudioProblem], None] | None = None,
        rate_hz: int = DEFAULT_RATE_HZ,
        look_up: LookUp = find,
        open_output: Open = DeviceOutput,
    ) -> None:
        self._on_problem = faultless(on_problem or (lambda problem: None), "while a fault of the sound was reported")
        self._look_up, self._open_output = look_up, open_output
        self._watch: Callable[[SoundStatus], None] = lambda status: None
        self.mixer = Mixer(rate_hz)
        self._output: Output = ClockOutput(self.mixer)
        self._volume_db = 0.0
        self._effects: Effects | None = None
        self._wish = _Wish()  # with which the last device was opened
        self._wishes: SimpleQueue[_Wish] = SimpleQueue()  # not yet carried out
        self._woken = threading.Event()  # set: the caretaker is not to wait
        self._closing = threading.Event()  # set: the caretaker is to end
        self._lost: _Wish | None = None  # its device vanished while it was in use: opened again when it is back
        self._try_again_s = 0.0  # when to look for a lost device again, by `time.monotonic`
        self._stalled = False  # whether a stall has been reported
        self._calls_before = 0  # of the mixer, until the present output was opened
        self._gaps: deque[Gap] = deque(maxlen=MOST_GAPS)
        self._status = SoundStatus(rate_hz=rate_hz)
        self._changes_done = self._failed_looks = 0  # wishes done; looks at the output that failed, in a row
        self._faults: set[str] = set()  # stack traces of internal faults that were reported
        self._caretaker = threading.Thread(target=self._supervise, name="sound-caretaker", daemon=True)
        self._caretaker.start()

    def open(
        self, device: DeviceChoice | None = None, sound: SoundChoice | None = None, rescan: bool = False
    ) -> None:
        """Ask the caretaker thread to open another device, or the present one in another way.

        If it is refused, the present device is opened again as it was, and `on_problem` is called. Voices continue
        ringing where rate and channels stay; otherwise there is a new mixer, and notes that ring need new voices.

        Args:
            device: None for the system's default.
            sound: how it is opened; None: as is usual.
            rescan: looks for devices that were plugged in meanwhile, which interrupts the present one.
        """
        self._wishes.put(_Wish(device, sound or SoundChoice(), rescan))
        self._woken.set()

    @property
    def rate_hz(self) -> int:
        return self.mixer.rate_hz

    @property
    def buffer_s(self) -> float:
        """The length of the device's buffer: so much may be rendered at once."""
        return self._status.latency_s

    def now_s(self) -> float:
        """The output's time in seconds, the clock of gestures; 0 while the output is being changed."""
        try:
            return self._output.now_s()
        except Exception:  # the output is being changed
            return 0.0

    def set_volume_db(self, volume_db: float) -> None:
        """Set the volume: 0 dB leaves the samples as they are, minus infinity mutes.

        Raises:
            ValueError: it is not a number, or plus infinity.
        """
        if math.isnan(volume_db) or volume_db == math.inf:
            raise ValueError(f"The volume cannot be {volume_db} dB.")
        self._volume_db = volume_db
        self.mixer.set_volume(10 ** (volume_db / 20))

    def set_effects(self, effects: Effects | None) -> None:
        """Set body and room of all that sounds from now on, within tens of ms; see `Mixer.set_effects`."""
        self._effects = effects
        self.mixer.set_effects(effects)

    def sound_tone(self, side: str) -> None:
        """Play a soft tone for a second on "left", "right" or "both" sides, beside whatever else is playing."""
        self.mixer.sound_tone(side)

    def status(self) -> SoundStatus:
        return self._status

    def watch(self, look: Callable[[SoundStatus], None]) -> None:
        """Call `look` with each status, every LOOK_EVERY_S, in the caretaker's thread. The latest call counts."""
        self._watch = look

    def close(self) -> None:
        """Cut the sound, end the thread, for which it waits, and free the device; may be called again."""
        self._closing.set()
        self._woken.set()
        if threading.current_thread() is not self._caretaker:
            self._caretaker.join(JOIN_TIMEOUT_S)

    def __enter__(self) -> Sound:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # All below runs in the caretaker's thread.

    def _supervise(self) -> None:
        """Carry out wishes and look at the output, every LOOK_EVERY_S or when woken, until `close`."""
        try:
            while not self._closing.is_set():
                self._woken.wait(LOOK_EVERY_S)
                self._woken.clear()
                self._try_work(self._process_requests)
                if self._closing.is_set():
                    break
                if self._try_work(self._look_at_output) and self._try_work(self._publish):
                    self._failed_looks = 0
                else:
                    self._failed_looks += 1
                    if self._failed_looks % RESTART_AFTER == 0:
                        self._try_work(self._restart)
                self._try_work(self._free_ended)
                self._try_work(lambda: self._watch(self._status))
        finally:
            self._close()

    def _try_work(self, work: Callable[[], None]) -> bool:
        """Do `work`; return True if it could be done. A fault of it is reported once, and all else continues."""
        try:
            work()
            return True
        except Exception as error:
            where = "".join(traceback.format_tb(error.__traceback__))
            if where not in self._faults and len(self._faults) < MOST_FAULTS:
                self._faults.add(where)
                self._on_problem(
                    problem(ProblemKind.INTERNAL, detail=log_fault(error, "while the sound was supervised"))
                )
            return False

    def _restart(self) -> None:
        """Open the output again, which cannot be supervised as it is."""
        device = self._output.device
        if device is not None:
            self._be_silent()
            self._lose(replace(self._wish, device=self._wish.device or device.choice))

    def _free_ended(self) -> None:
        self.mixer.forget_ended()
        self._gaps.extend(self.mixer.new_gaps())

    def _process_requests(self) -> None:
        while not self._wishes.empty():
            wish = self._wishes.get()
            try:
                self._change(wish)
            finally:
                self._changes_done += 1  # published with the device and the rate that came of it

    def _change(self, wish: _Wish) -> None:
        """Open the device of a wish.

        Where that fails, the present device is opened again as it was. Where none was open, and the wished one may
        come yet, it counts as lost. Either way the fault is reported.
        """
        before = self._wish if self._output.device is not None else None  # how the present device was opened
        present = self._output.device  # None: the clock
        self._lost = None
        try:
            if wish.rescan or present is None:
                self._be_silent()
            device = self._find_device(wish, wish.rescan or present is None)
            if device == self._output.device and self._wish == wish:
                return
            self._be_silent()  # it might refuse to be opened twice
            self._open_device(device, wish)
        except AudioProblem as error:
            if before is not None and present is not None:
                self._reopen(present, before)
            elif error.kind in MAY_COME:  # it may come yet
                self._lose(wish)
            self._report(error)

    def _find_device(self, wish: _Wish, rescan: bool) -> AudioDevice:
        """The device that is wished for. Raises AudioProblem: there is none now, or it cannot be looked for."""
        try:
            device = self._look_up(wish.device, rescan)
            return replace(device, default_rate_hz=wish.sound.rate_hz or device.default_rate_hz)
        except AudioProblem:
            raise
        except Exception as error:
            raise _unexpected(error, wish.device.name if wish.device else "default") from error

    def _open_device(self, device: AudioDevice, wish: _Wish) -> None:
        """Open a device, with the present mixer where rate and channels stay, else with a new one.

        Raises:
            AudioProblem: it could not be opened; the clock takes the frames then.
        """
        rate_hz, channels = device.default_rate_hz, min(device.channels, 2)
        mixer = self.mixer
        if rate_hz != mixer.rate_hz or channels != mixer.channels:
            mixer = Mixer(rate_hz, channels)
            self._set_up(mixer)  # or its first frames would be loud
        self._close()
        try:
            self._output = self._open_output(device, wish.sound.buffer_s(rate_hz), mixer)
        except Exception as error:
            self._output = ClockOutput(self.mixer)
            if isinstance(error, AudioProblem):
                raise
            raise _unexpected(error, device.name) from error
        self.mixer = mixer
        self._wish = wish
        self._stalled = False
        self._calls_before = mixer.calls
        self._set_up(mixer)  # what was set while the device was being opened went to the old one
        self._status = replace(self._status, problem=None)

    def _set_up(self, mixer: Mixer) -> None:
        """Give the mixer volume and effects, the latest where another thread sets them meanwhile."""
        set_values: object = None
        while set_values != (wanted_values := (self._volume_db, self._effects)):
            mixer.set_volume(10 ** (wanted_values[0] / 20))
            self._try_work(partial(mixer.set_effects, wanted_values[1]))  # else all would be silent
            set_values = wanted_values

    def _reopen(self, device: AudioDevice, wish: _Wish) -> None:
        """Open the device again as before a change that was refused; if that fails too, it counts as lost."""
        try:
            self._open_device(device, wish)
        except AudioProblem:
            self._lose(wish)

    def _be_silent(self) -> None:
        """Close the device, if one plays; the clock takes the frames from then on."""
        if self._output.device is not None:
            self._close()
            self._output = ClockOutput(self.mixer)

    def _close(self) -> None:
        faultless(self._output.close, "while the sound output was closed")()

    def _look_at_output(self) -> None:
        """Resume or give up a lost device, report a stall and its end, and look for a device that was given up."""
        output = self._output
        if output.device is not None and output.lost():
            if not self._resume(output.device):
                self._be_silent()
                self._lose(replace(self._wish, device=self._wish.device or output.device.choice))
                self._report(problem(ProblemKind.VANISHED, output.device.name))
        elif output.stalled() and not self._stalled and output.device is not None:
            self._stalled = True
            self._report(problem(ProblemKind.STALLED, output.device.name))
        elif self._stalled and not output.stalled():
            self._stalled = False
            self._status = replace(self._status, problem=None)
        if self._lost is not None and time.monotonic() >= self._try_again_s:
            self._try_again_s = time.monotonic() + TRY_AGAIN_S
            try:
                self._open_device(self._find_device(self._lost, True), self._lost)
                self._lost = None
            except AudioProblem:
                pass

    def _resume(self, device: AudioDevice) -> bool:
        """Open a device again that was lost after it had played; return True if that succeeded.

        A driver may also give up under load, and then works again at once.
        """
        began_s, mixer = time.monotonic(), self.mixer
        if mixer.calls == self._calls_before:
            return False
        try:
            self._open_device(device, self._wish)
        except AudioProblem:
            return False
        self._gaps.append(Gap(mixer.seconds, "device", 1000 * (time.monotonic() - began_s)))
        return True

    def _lose(self, wish: _Wish) -> None:
        """Mark an output as lost: it is opened again when it is back, and until then no fault is reported."""
        self._lost, self._try_again_s = wish, time.monotonic() + TRY_AGAIN_S

    def _report(self, problem: AudioProblem) -> None:
        # before the call, because the callee may read the status
        self._status = replace(self._status, problem=str(problem), device=self._output.device)
        self._on_problem(problem)

    def _publish(self) -> None:
        """Replace the status that `status` returns by the present one; its problem stays."""
        output = self._output
        self._status = replace(
            self._status,
            device=output.device,
            rate_hz=self.mixer.rate_hz,
            latency_s=output.latency_s,
            gaps=tuple(self._gaps),
            load=output.load(),
            changes_done=self._changes_done,
        )


def _unexpected(error: Exception, device: str) -> AudioProblem:
    return problem(ProblemKind.UNEXPECTED, device, "".join(traceback.format_exception(error)))

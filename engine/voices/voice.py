"""A pluck of a program, as it rings."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from engine.kernels import layout as at
from engine.kernels.layout import ATTACK_S, END_FADE_S, FADE_S, LONGEST_S, SILENT_DB
from engine.kernels.memory import publish
from engine.levels import FULL_SCALE_M, LEAST_PEAK_M, RUNAWAY_FACTOR
from engine.resonators.base import Resonator
from engine.voices.ear import Ear
from engine.voices.program import Program

SPARE_S = 0.1  # of samples that are rendered ahead, behind that fade
LONGEST_WAIT_S = 10.0  # between two readings of a device's clock that are of one sound


def possible_s(seconds: float) -> float | None:
    """The time between two readings of a device's clock; None: it cannot be, as where they have two bases."""
    return float(seconds) if 0.0 <= seconds <= LONGEST_WAIT_S else None


class Voice:
    """A voice, made and commanded by one thread, rendered by another: a command is heard within a quantum.

    Args:
        displacement_m: at its release, (grid_points,), projected on the modes in use.
        gain: with which it is heard, 0 for a source that is only kept ready.
        seconds: of a rendered voice: how much room there is for its samples, of which none is needed after its end.
        begin: what `program.start` gives for this displacement, where it is known.
    """

    def __init__(
        self,
        program: Program,
        displacement_m: NDArray[np.float64],
        ear: Ear,
        gain: float = 1.0,
        seconds: float = 0.0,
        source_rate_hz: int = 0,
        begin: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    ) -> None:
        n = program.modes
        rows = {at.TRUTH: at.TRUTH_ROWS, at.TENSION: at.TENSION_ROWS}.get(program.kind, 0)
        self.program, self.ear = program, ear
        self.memory = memory = np.zeros(_state(n) + rows * n)
        self._counts = counts = memory.view(np.int64)
        counts[at.KIND], counts[at.PROGRAM], counts[at.MODES] = program.kind, program.address, n
        counts[at.POINTS], counts[at.VELOCITY] = len(ear.points), ear.pickup == "velocity"
        memory[at.WANTED_GAIN] = memory[at.GAIN] = memory[at.GAIN_FROM] = memory[at.GAIN_TO] = gain
        counts[at.BEGAN_FRAME] = -1
        counts[at.FADE_FRAMES] = round(FADE_S * program.rate_hz)
        counts[at.ATTACK] = round(ATTACK_S * program.rate_hz)
        counts[at.ENDS_AT] = round(min(program.ends_s, LONGEST_S) * program.rate_hz)
        counts[at.ENDS_IN] = round(END_FADE_S * program.rate_hz)
        memory[at.SILENT] = SILENT_DB * math.log(10) / 20
        memory[at.PEAK] = max(float(np.abs(displacement_m).max()), LEAST_PEAK_M)
        memory[at.LIMIT] = RUNAWAY_FACTOR * ear.largest(displacement_m, program.force) / FULL_SCALE_M
        first, second = program.start(displacement_m) if begin is None else begin
        place = _state(n)
        memory[place : place + len(first)], memory[place + n : place + n + len(second)] = first, second
        self._samples: NDArray[np.float32] | None = None
        self._source_rate_hz = source_rate_hz
        if program.resonator is not None:
            counts[at.MOVING] = n
            memory[place + at.OMEGA_SQUARED * n : place + at.FOLLOWING * n] = _rows(program.resonator)
        else:
            seconds = min(seconds, program.ends_s + END_FADE_S + SPARE_S)
            length = max(1, math.ceil(seconds * source_rate_hz) + 1)
            self._samples = np.zeros((length, len(ear.points)), np.float32)
            counts[at.SAMPLES], counts[at.LENGTH] = self._samples.ctypes.data, length
        if program.grid_points:
            self._set_weights(0, ear)

    @classmethod
    def of_samples(cls, program: Program, samples: NDArray[np.float32]) -> Voice:
        """The voice of samples (frames, points) of full scale at the program's own rate, all of which are there."""
        ear = Ear((0.5,) * samples.shape[1])
        voice = cls(program, np.full(3, FULL_SCALE_M), ear, 1.0, len(samples) / program.rate_hz, program.rate_hz)
        voice.append(samples)
        voice.end_here()
        return voice

    @property
    def address(self) -> int:
        return int(self.memory.ctypes.data)

    @property
    def over(self) -> bool:
        """Return True if it sounds no more and its memory may go."""
        return bool(self._counts[at.STATE] in (at.OVER, at.RUNAWAY))

    def refuse(self) -> None:
        """End a voice that no mixer has.

        It was not handed over, or its mixer is not in use any more.
        """
        self._counts[at.STATE] = at.OVER

    @property
    def ran_away(self) -> bool:
        return bool(self._counts[at.STATE] == at.RUNAWAY)

    @property
    def sounding(self) -> bool:
        return bool(self._counts[at.STATE] == at.SOUNDING)

    @property
    def seconds(self) -> float:
        """The time for which it has been ringing, as far as the device was given it."""
        return float(self._counts[at.FRAME]) / self.program.rate_hz

    @property
    def starved_s(self) -> float:
        """The time for which it had nothing to play."""
        return float(self._counts[at.STARVED]) / self.program.rate_hz

    @property
    def struck_to_began_s(self) -> float | None:
        """The time from the gesture to the callback that gave the device its first samples; None: not known."""
        if self._counts[at.BEGAN_FRAME] < 0 or not self.memory[at.STRUCK_S]:
            return None
        return possible_s(self.memory[at.BEGAN_S] - self.memory[at.STRUCK_S])

    @property
    def level_db(self) -> float:
        """The level of all of the string, in dB of full scale."""
        return float(self.memory[at.LOUDNESS]) * 20 / math.log(10)

    def set_struck(self, time_s: float) -> None:
        """Notes when the gesture was, on the device's clock."""
        self.memory[at.STRUCK_S] = time_s

    def set_gain(self, gain: float) -> None:
        """Fades to another gain."""
        self.memory[at.WANTED_GAIN] = gain

    def start_with_gain(self, gain: float) -> None:
        """Set the gain with which it begins, without a fade, before it is handed over."""
        self.memory[at.WANTED_GAIN] = self.memory[at.GAIN] = gain
        self.memory[at.GAIN_FROM] = self.memory[at.GAIN_TO] = gain

    def begin_at(self, frame: int) -> None:
        """Set the frame of the mixer at which it begins; if that is past, at once.

        Call this before it is handed over.
        """
        self._counts[at.BEGIN_AT] = frame

    def release_at(self, frame: int) -> None:
        """Fade it out from the first quantum that begins at this frame of the mixer or later; 0: do not."""
        self._counts[at.RELEASE_AT] = frame

    def fade_out_by(self, seconds: float) -> None:
        """Fade it to silence by then, where it does not end earlier; call this before it is handed over."""
        end, fade = (round(each * self.program.rate_hz) for each in (seconds, FADE_S))
        if self._counts[at.ENDS_AT] + self._counts[at.ENDS_IN] > end:
            self._counts[at.ENDS_AT] = max(0, min(int(self._counts[at.ENDS_AT]), end - fade))
            self._counts[at.ENDS_IN] = fade

    @property
    def waits(self) -> bool:
        """Return True if it has not begun."""
        return bool(self._counts[at.STATE] == at.WAITING)

    @property
    def began_frame(self) -> int:
        """The frame of the mixer at which it began; 0 until then."""
        return max(0, int(self._counts[at.BEGAN_FRAME]))

    def release(self, seconds: float) -> None:
        """Fades to silence and ends; a release under way continues."""
        if self._counts[at.RELEASE] == 0:
            self._counts[at.RELEASE] = max(1, round(seconds * self.program.rate_hz))

    def listen(self, ear: Ear) -> bool:
        """Fades to other points. False where it cannot now: a fade is under way; ask again.

        One that is rendered ahead, and one that is picked up otherwise, stay as they are: True.
        """
        same = (len(ear.points), ear.pickup) == (len(self.ear.points), self.ear.pickup)
        if self.program.kind == at.RENDERED or not same or ear == self.ear:
            return True
        if self._counts[at.NEXT_WEIGHTS]:
            return False
        self._set_weights(1, ear)
        self._counts[at.WEIGHTS_FADED] = 0
        publish(self._counts, at.NEXT_WEIGHTS, 1)
        self.ear = ear
        return True

    def append(self, samples: NDArray[np.floating]) -> None:
        """Append samples that a rendered voice reads, (frames, points) of full scale at its own rate."""
        assert self._samples is not None
        ready = int(self._counts[at.READY])
        count = min(len(samples), len(self._samples) - ready)
        self._samples[ready : ready + count] = samples[:count]
        publish(self._counts, at.READY, ready + count)

    def level_of_samples(self, seconds: float) -> float:
        """Root mean square of what a rendered voice was given for its first seconds."""
        assert self._samples is not None
        frames = min(int(self._counts[at.READY]), round(seconds * self._source_rate_hz))
        return math.sqrt(float(np.square(self._samples[:frames], dtype=np.float64).mean())) if frames else 0.0

    @property
    def room(self) -> int:
        """Samples that a rendered voice still lacks."""
        return 0 if self._samples is None else len(self._samples) - int(self._counts[at.READY])

    def loop(self) -> None:
        """A rendered voice of the device's own rate begins again after its last sample."""
        self._counts[at.LOOPED] = 1

    def begin_at_once(self) -> None:
        """Begin it without the fade-in, as the string moves; call this before it is handed over."""
        self._counts[at.ATTACK] = 0

    def sound_through_effects(self) -> None:
        """Send it through the mixer's effects: amplifier, body and room. Call this before it is handed over."""
        self._counts[at.OF_INSTRUMENT] = 1

    def never_ends(self) -> None:
        """Let it continue when it has become silent: its renderer knows how long."""
        self.memory[at.SILENT] = -math.inf

    def end_here(self) -> None:
        """A rendered voice has no more samples than it was given."""
        self._counts[at.LENGTH] = max(1, self._counts[at.READY])

    def skip(self, seconds: float, mixer_memory: NDArray[np.float64]) -> None:
        """Let it ring unheard for so long; call this before it is handed over."""
        from engine.kernels.voice import forward

        forward(self.memory, mixer_memory, round(seconds * self.program.rate_hz))
        self._counts[at.ATTACK] = 0
        self.memory[at.GAIN] = self.memory[at.GAIN_FROM] = 0.0

    def _set_weights(self, which: int, ear: Ear) -> None:
        n = self.program.modes
        weights, bias = self.program.weights(ear)
        for point in range(len(ear.points)):
            place = at.HEADER + (which * 2 + point) * 2 * n
            self.memory[place : place + 2 * n] = weights[point]
            self.memory[at.HEADER + 8 * n + which * 2 + point] = bias[point]


def _rows(resonator: Resonator) -> NDArray[np.float64]:
    """ω², σ, k, η² and no part in a bridge of others, one after the other."""
    nothing = np.zeros(resonator.modes)
    return np.concatenate([resonator.omega**2, resonator.sigma, resonator.coupling, resonator.stretch, nothing])


def _state(modes: int) -> int:
    return at.HEADER + 8 * modes + 4 + 8 * at.QUANTUM

"""A pluck of a program, as it rings."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from engine.kernels import voice_records as at
from engine.kernels.fields import record_of, slots
from engine.kernels.mixer_records import SCRATCH_SLOTS
from engine.kernels.voice_records import (
    ATTACK_S,
    BANK_PROGRAM,
    END_FADE_S,
    FADE_S,
    LONGEST_S,
    SILENT_DB,
    VOICE,
    WEIGHT_ROWS,
)
from engine.levels import FULL_SCALE_M, LEAST_PEAK_M, RUNAWAY_FACTOR
from engine.resonators.base import Resonator
from engine.values.ear import Ear
from engine.voices.ear import largest
from engine.voices.memory import KernelMemory
from engine.voices.program import Program

SPARE_S = 0.1  # of samples that are rendered ahead, behind that fade
LONGEST_WAIT_S = 10.0  # between two readings of a device's clock that are of one sound


def possible_s(seconds: float) -> float | None:
    """The time between two readings of a device's clock; None: it cannot be, as where they have two bases."""
    return float(seconds) if 0.0 <= seconds <= LONGEST_WAIT_S else None


class Voice(KernelMemory):
    """A voice, made and commanded by one thread, rendered by another: a command is heard within a quantum.

    A quantum is the 64 frames that a mixer renders at a time. A *rendered* voice plays samples that are appended to
    it, which another thread makes ahead of time; the others are computed as they sound.

    Args:
        displacement_m: at its release, (grid_points,), projected on the modes in use.
        gain: with which it is heard, 0 for a source that is only kept ready.
        seconds: of a rendered voice: how much room there is for its samples, of which none is needed after its end.
        source_rate_hz: of a rendered voice: the rate of its samples.
    """

    layout = VOICE

    def __init__(
        self,
        program: Program,
        displacement_m: NDArray[np.float64],
        ear: Ear,
        gain: float = 1.0,
        seconds: float = 0.0,
        source_rate_hz: int = 0,
    ) -> None:
        n = program.modes
        # rows (n,) of the kind; a rendered voice has none
        rows = {at.BANK: at.BANK_ROWS, at.TRUTH: at.TRUTH_ROWS, at.TENSION: at.TENSION_ROWS}.get(program.kind, 0)
        self.program, self.ear = program, ear
        self.memory = np.zeros(slots(VOICE) + (WEIGHT_ROWS + rows) * n)
        self.record = record = record_of(self.memory, VOICE)
        record["kind"] = program.kind
        record["program"] = program.address
        record["modes"] = n
        record["points"], record["velocity"] = len(ear.points), ear.pickup == "velocity"
        self.start_with_gain(gain)
        record["began_frame"] = -1
        record["fade_frames"] = round(FADE_S * program.rate_hz)
        record["attack"] = round(ATTACK_S * program.rate_hz)
        record["ends_at"] = round(min(program.ends_s, LONGEST_S) * program.rate_hz)
        record["ends_in"] = round(END_FADE_S * program.rate_hz)
        record["silent"] = SILENT_DB * math.log(10) / 20  # in nepers
        record["peak"] = max(float(np.abs(displacement_m).max()), LEAST_PEAK_M)
        # the largest believable output, of full scale: beyond it the voice has run away
        record["limit"] = RUNAWAY_FACTOR * largest(ear, displacement_m, program.force) / FULL_SCALE_M
        if n:
            self.rows[0], self.rows[1] = program.start(displacement_m)
        self._samples: NDArray[np.float32] | None = None  # (frames, points); None: the voice is not a rendered one
        if program.resonator is not None:
            record["moving"] = n
            self.rows[at.OMEGA_SQUARED : at.FOLLOWING] = resonator_rows(program.resonator)
        elif program.kind == at.BANK:
            from engine.kernels.bank import strike

            strike(record, record_of(program.memory, BANK_PROGRAM), np.empty(SCRATCH_SLOTS))
        else:
            seconds = min(seconds, program.ends_s + END_FADE_S + SPARE_S)
            length = max(1, math.ceil(seconds * source_rate_hz) + 1)
            self._samples = np.zeros((length, len(ear.points)), np.float32)
            if program.grid_points:
                # (grid_points, points): displacement in m @ senses is of full scale
                self._senses = (program.grid_weights(ear) / FULL_SCALE_M).astype(np.float32)
            record["samples"], record["length"] = self._samples.ctypes.data, length
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
    def rows(self) -> NDArray[np.float64]:
        """The rows of a voice, (rows, modes); `voice_records` has their numbers."""
        n = self.program.modes
        return self.memory[slots(VOICE) + WEIGHT_ROWS * n :].reshape(-1, n)

    @property
    def over(self) -> bool:
        """Return True if it sounds no more and its memory may go."""
        return bool(self.record["state"] in (at.OVER, at.RUNAWAY))

    def refuse(self) -> None:
        """End a voice that no mixer has.

        It was not handed over, or its mixer is not in use any more.
        """
        self.record["state"] = at.OVER

    @property
    def ran_away(self) -> bool:
        return bool(self.record["state"] == at.RUNAWAY)

    @property
    def sounding(self) -> bool:
        return bool(self.record["state"] == at.SOUNDING)

    @property
    def seconds(self) -> float:
        """The time for which it has been ringing, as far as the device was given it."""
        return float(self.record["frame"]) / self.program.rate_hz

    @property
    def starved_s(self) -> float:
        """The time for which it had nothing to play."""
        return float(self.record["starved"]) / self.program.rate_hz

    @property
    def struck_to_began_s(self) -> float | None:
        """The time from the gesture to the callback that gave the device its first samples; None: not known."""
        if self.record["began_frame"] < 0 or not self.record["struck_s"]:
            return None
        return possible_s(self.record["began_s"] - self.record["struck_s"])

    @property
    def level_db(self) -> float:
        """The present level of the loudest latent (of a bank), or of all of the string, in dB of full scale."""
        return float(self.record["loudness"]) * 20 / math.log(10)

    def set_struck(self, time_s: float) -> None:
        """Note when the gesture was, on the device's clock."""
        self.record["struck_s"] = time_s

    def set_gain(self, gain: float) -> None:
        """Fade to another gain."""
        self.record["wanted_gain"] = gain

    def start_with_gain(self, gain: float) -> None:
        """Set the gain with which it begins, without a fade, before it is handed over."""
        self.record["wanted_gain"] = self.record["gain"] = gain
        self.record["gain_from"] = self.record["gain_to"] = gain

    def begin_at(self, frame: int) -> None:
        """Set the frame of the mixer at which it begins; if that is past, at once.

        Call this before it is handed over.
        """
        self.record["begin_at"] = frame

    def release_at(self, frame: int) -> None:
        """Fade it out from the first quantum that begins at this frame of the mixer or later; 0: do not."""
        self.record["release_at"] = frame

    def fade_out_by(self, seconds: float) -> None:
        """Fade it to silence by `seconds` after the pluck, where it does not end earlier.

        Call this before it is handed over.
        """
        end, fade = (round(time_s * self.program.rate_hz) for time_s in (seconds, FADE_S))
        if self.record["ends_at"] + self.record["ends_in"] > end:
            self.record["ends_at"] = max(0, min(int(self.record["ends_at"]), end - fade))
            self.record["ends_in"] = fade

    @property
    def began_frame(self) -> int:
        """The frame of the mixer at which it began; 0 until then."""
        return max(0, int(self.record["began_frame"]))

    def release(self, seconds: float) -> None:
        """Fade to silence within `seconds` and end; a release under way continues."""
        if self.record["release"] == 0:
            self.record["release"] = max(1, round(seconds * self.program.rate_hz))

    def listen(self, ear: Ear) -> bool:
        """Fade to other listening points. False where it cannot now: a fade is under way; ask again.

        A rendered voice stays as it is, and so does one whose number of points or pick-up is not the ear's: True.
        """
        same = (len(ear.points), ear.pickup) == (len(self.ear.points), self.ear.pickup)
        if self.program.kind == at.RENDERED or not same or ear == self.ear:
            return True
        if self.record["next_weights"]:
            return False
        self._set_weights(1, ear)
        self.record["weights_faded"] = 0
        self.publish("next_weights", 1)
        self.ear = ear
        return True

    def sense(self, frames_m: NDArray[np.float32]) -> NDArray[np.float32]:
        """The samples (frames, points) of full scale that a rendered voice has of a motion (frames, grid_points)."""
        return np.einsum("fg,gp->fp", frames_m, self._senses)

    def append(self, samples: NDArray[np.floating]) -> None:
        """Append samples that a rendered voice reads, (frames, points) of full scale at its own rate."""
        assert self._samples is not None
        ready = int(self.record["ready"])
        count = min(len(samples), len(self._samples) - ready)
        self._samples[ready : ready + count] = samples[:count]
        self.publish("ready", ready + count)

    @property
    def room(self) -> int:
        """Samples that a rendered voice still lacks."""
        return 0 if self._samples is None else len(self._samples) - int(self.record["ready"])

    def loop(self) -> None:
        """Let a rendered voice of the device's own rate begin again after its last sample."""
        self.record["looped"] = 1

    def begin_at_once(self) -> None:
        """Begin it without the fade-in, as the string moves; call this before it is handed over."""
        self.record["attack"] = 0

    def sound_through_effects(self) -> None:
        """Send it through the mixer's effects: amplifier, body and room. Call this before it is handed over."""
        self.record["of_instrument"] = 1

    def never_ends(self) -> None:
        """Let it continue when it has become silent: its renderer knows how long."""
        self.record["silent"] = -math.inf

    def end_here(self) -> None:
        """End a rendered voice after the samples that it was given so far."""
        self.record["length"] = max(1, self.record["ready"])

    def _set_weights(self, which: int, ear: Ear) -> None:
        """Write a set of weights and biases of an ear: 0, the one that is heard, or 1, the one that is faded to."""
        n = self.program.modes
        weights, bias = self.program.weights(ear)
        rows = self.memory[slots(VOICE) : slots(VOICE) + WEIGHT_ROWS * n].reshape(2, 2, 2 * n)
        rows[which, : len(weights)] = weights
        self.record["bias"][which, : len(bias)] = bias


def resonator_rows(resonator: Resonator) -> NDArray[np.float64]:
    """The rows (5, modes) ω², σ, k, η² and, all 0, what it loses to a bridge that it shares with other strings."""
    nothing = np.zeros(resonator.modes)
    return np.stack([resonator.omega**2, resonator.sigma, resonator.coupling, resonator.stretch, nothing])

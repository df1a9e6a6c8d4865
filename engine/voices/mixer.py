"""The mixer: voices are handed to it, and a device's callback, a clock, or a file takes its frames."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.effects import Effects
from engine.effects.responses import convolver_memory, partitioned
from engine.kernels.amplifier import drive
from engine.kernels.constants import AHEAD
from engine.kernels.fields import record_of, slots
from engine.kernels.mixer_records import CAUSE_DEVICE, CAUSE_RUNAWAY, CAUSE_STARVED, GAPS, MIXER, RING
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S
from engine.values.effects import Amp
from engine.voices.ear import differentiator_taps
from engine.voices.memory import KernelMemory, Reading
from engine.voices.player import CompiledPlayer
from engine.voices.voice import Voice, possible_s

LIMITER_RELEASE_S = 0.08  # time constant with which its level falls
VOLUME_SMOOTHING_S = 0.015  # time constant of a change of volume
LEFT_S = 0.03  # of the fade of a player's notes when two others have taken its place
LEFT_FRAMES = 16_384  # after a player was set aside, no quantum plays it: more than a device takes at once
CAUSES = {CAUSE_DEVICE: "device", CAUSE_STARVED: "rendering", CAUSE_RUNAWAY: "runaway"}


@dataclass(frozen=True)
class Gap:
    """A silence that nobody asked for: its time in s of sound since the mixer began, cause and length.

    0 ms: unknown.
    """

    time_s: float
    cause: str
    milliseconds: float


class Mixer(KernelMemory):
    """The mixer of voices, on memory that the kernels use.

    Commands come from any thread, frames are taken by one.

    Args:
        limited: whether the safety limiter is at work: for ears, not for files. It delays by `AHEAD` frames.

    Attributes:
        active: voices that sound or wait, those of a player among them.
        frames: of sound given so far.
        calls: of the callback, by a device or for frames that no device takes.
        non_finite: samples that were replaced by silence.
    """

    layout = MIXER
    channels = Reading(int, "channels")
    active = Reading(int, "active")
    frames = Reading(int, "frames")
    calls = Reading(int, "calls")
    underflows = Reading(int, "underflows")
    non_finite = Reading(int, "non_finite")

    def __init__(self, rate_hz: int, channels: int = 2, limited: bool = True) -> None:
        self.rate_hz = rate_hz
        self.memory = np.zeros(slots(MIXER))
        self.record = record = record_of(self.memory, MIXER)
        self._lock = threading.Lock()
        self._voices: list[Voice] = []  # handed over and not over yet: their memory is in use
        self._gaps_read = 0  # gaps that `new_gaps` has been through
        self._effects_lock = threading.Lock()  # not the voices': a key never waits for a room
        self.effects = Effects()
        self._convolver: NDArray[np.float64] | None = None  # its memory; None: no body or room so far
        self._impulses: dict[int, NDArray[np.float64]] = {}  # by address: those that may be in use
        # whose memory may be in use, each with the mixer's frame at which it was last set, or set aside
        self._players: list[tuple[CompiledPlayer, int]] = []
        record["rate_hz"] = rate_hz
        record["channels"], record["limiting"] = channels, limited
        record["wanted_volume"] = record["volume"] = record["reduction"] = 1.0
        record["gains"][:AHEAD] = 1.0
        # what is left, after a frame, of the limiter's level and of a change of volume
        record["release"] = math.exp(-1 / (LIMITER_RELEASE_S * rate_hz))
        record["smoothing"] = math.exp(-1 / (VOLUME_SMOOTHING_S * rate_hz))
        record["taps"] = differentiator_taps(rate_hz) * (FULL_SCALE_M / FULL_SCALE_M_S)

    def add(self, *voices: Voice) -> None:
        """Hand voices over: they begin together, with the next quantum. Any thread, at once.

        They are heard as they are: an instrument that is played in the same mixer adds nothing to them.
        Those for which there is no room are refused, and over.

        Raises:
            ValueError: a voice is of another rate.
        """
        for voice in voices:
            if voice.program.rate_hz != self.rate_hz:
                raise ValueError(f"the voice has {voice.program.rate_hz} Hz, the mixer {self.rate_hz} Hz")
        with self._lock:
            pushed, taken = int(self.record["pushed"]), int(self.record["taken"])
            room = RING - (pushed - taken)
            for number, voice in enumerate(voices[:room]):
                self.record["ring"][(pushed + number) % RING] = voice.address
                self._voices.append(voice)
            for voice in voices[room:]:
                voice.refuse()
            self.publish("pushed", pushed + min(len(voices), room))

    def skip(self, voice: Voice, seconds: float) -> None:
        """Let a voice ring unheard for so long before it is handed over, in the work space of this mixer.

        Handed over, it fades in from a gain of 0 as after any change of gain.
        """
        from engine.kernels.voice import forward

        forward(voice.record, self.record, round(seconds * self.rate_hz))
        voice.record["attack"] = 0
        voice.record["gain"] = voice.record["gain_from"] = 0.0

    def set_player(self, player: CompiledPlayer) -> None:
        """Set the player whose events are played from the next quantum on; the present one's notes ring on.

        The present one becomes the player before, whose events are still played. The one that was that so far has
        no events any more: its voices, which the mixer holds, fade out in LEFT_S.

        Raises:
            ValueError: it is of another rate.
        """
        if player.rate_hz != self.rate_hz:
            raise ValueError(f"the player has {player.rate_hz} Hz, the mixer {self.rate_hz} Hz")
        with self._lock:
            present, before = (int(self.record[name]) for name in ("player", "player_before"))  # addresses; 0: none
            if present == player.address:
                return
            # All are stamped again: a quantum that has begun may still play those that leave.
            self._players = [(other, self.frames) for other, _ in self._players if other is not player]
            # This comes first: a quantum in between finds the present player twice, and plays it once.
            self.publish("player_before", present)
            self.publish("player", player.address)
            for other, _ in self._players:
                if other.address == before:
                    other.release(LEFT_S)
            self._players.append((player, self.frames))

    def _forget_players(self) -> None:
        """Free the players that play nothing any more. The caller holds the lock."""
        for player, _ in self._players:
            if player.address == int(self.record["player_before"]) and player.rests:
                self.publish("player_before", 0)
                self._players = [(one, self.frames if one is player else frame) for one, frame in self._players]
        held = [int(self.record[name]) for name in ("player", "player_before")]
        # a quantum that has begun may still play one that was taken out
        self._players = [
            (player, frame)
            for player, frame in self._players
            if player.address in held or self.frames <= frame + LEFT_FRAMES or not player.over
        ]

    def set_effects(self, effects: Effects | None) -> None:
        """A player's voices sound through these from now on: amplifier, body and room, before the volume. Any thread.

        What has been played rings on in them. They are faded to within three windows of the convolver (64 ms at
        48 kHz, of which the last is the fade); at once where nothing has been rendered yet. It takes the caller some
        milliseconds, and tens where a body or a room has not been in use before.
        """
        effects = effects or Effects()
        with self._effects_lock:
            if effects == self.effects:
                return
            address = 0
            amp = effects.amp or Amp()
            drive(self.record, float(amp.drive_db), float(amp.tone_db), float(effects.level_db))
            if effects.rings:
                if self._convolver is None:
                    self._convolver = convolver_memory(self.rate_hz)
                memory = partitioned(effects.impulse(self.rate_hz))
                address = int(memory.ctypes.data)
                self._impulses[address] = memory
            if self._convolver is not None:
                self.publish("convolver", self._convolver.ctypes.data)
                self.publish("effects", address)
            self.effects = effects
            self._forget_impulses()

    def _forget_impulses(self) -> None:
        """Free the impulse responses that the kernels use no more.

        The kernel moves a response from "effects" to "effects_next" to "effects_now": in this order none is missed.
        """
        in_use = [int(self.record[name]) for name in ("effects", "effects_next", "effects_now")]
        # one that the kernel has just turned away from may be reported once more, after it was freed
        self._impulses = {address: self._impulses[address] for address in in_use if address in self._impulses}

    def forget_ended(self) -> None:
        """Free voices that are over, and players and impulse responses out of use. Any thread, now and then."""
        with self._lock:
            self._voices = [voice for voice in self._voices if not voice.over]
            self._forget_players()
        with self._effects_lock:
            self._forget_impulses()

    @property
    def voices(self) -> list[Voice]:
        """The voices that have been handed over and are not over."""
        with self._lock:
            return [voice for voice in self._voices if not voice.over]

    def render(self, frames: int) -> NDArray[np.float32]:
        """The next frames, (frames, channels), where no device takes them."""
        from engine.kernels.mixer import call

        # the times of the callback are those of the sound itself
        out, times_s = np.zeros(frames * self.channels, np.float32), np.full(3, self.seconds)
        call.ctypes(None, out.ctypes.data, frames, times_s.ctypes.data, 0, self.address)
        return out.reshape(frames, self.channels)

    def set_volume(self, factor: float) -> None:
        """Set the volume of everything; 1 leaves the samples as they are."""
        self.record["wanted_volume"] = factor

    def sound_tone(self, side: str) -> None:
        """A soft tone for a second, on "left", "right" or "both"."""
        self.record["tone_length"] = 0
        self.record["tone_frame"] = 0
        self.record["tone_side"] = {"left": 1, "right": 2}.get(side, 3)
        self.record["tone_length"] = self.rate_hz

    @property
    def seconds(self) -> float:
        """The seconds of sound given so far."""
        return self.frames / self.rate_hz

    @property
    def output_latency_s(self) -> float:
        """The latency from a voice to the loudspeaker: the limiter's delay, and from a callback to its first sample.

        The latter is what the device said last; 0 where it says nothing, or what cannot be.
        """
        delay_s = AHEAD / self.rate_hz if self.record["limiting"] else 0.0
        return delay_s + (possible_s(self.record["dac_s"] - self.record["now_s"]) or 0.0)

    def take_peak(self) -> float:
        """The highest sample, 1 being full scale, since it was asked for the last time."""
        peak = float(self.record["peak"])
        self.record["peak"] = 0.0
        return peak

    def take_reduction_db(self) -> float:
        """The limiter's strongest reduction since it was asked for the last time; 0: untouched."""
        gain = float(self.record["reduction"])
        self.record["reduction"] = 1.0
        return -20 * math.log10(gain)

    def new_gaps(self) -> list[Gap]:
        """The gaps since this was asked for the last time; of very many only the latest."""
        gaps, total = [], int(self.record["gap_count"])
        for number in range(max(self._gaps_read, total - GAPS), total):
            frame, milliseconds, cause = self.record["gaps"][number % GAPS].tolist()
            lasted_ms = 1000 * (possible_s(milliseconds / 1000) or 0.0)
            gaps.append(Gap(float(frame) / self.rate_hz, CAUSES.get(int(cause), "unknown"), lasted_ms))
        self._gaps_read = total
        return gaps

"""A stage: an instrument that is played without a device, and measures of its sound."""

from collections.abc import Sequence
from dataclasses import replace
from math import log2

import numpy as np
from numpy.typing import NDArray

from app.instruments.instrument import Instrument, OpenString, StringSet
from app.player.compiled import InstrumentPlayer
from app.player.events import Event, NoteOn, TimedEvent
from app.player.offline import render_events
from app.player.strings import KeyString, Strings
from engine.kernels import constants as of
from engine.kernels.constants import QUANTUM
from engine.presets import SHIPPED, Preset, load_preset
from engine.voices import Mixer
from engine.voices.player import NoteReport
from tests.app.player.conftest import STEEL
from tests.app.player.seen import Seen, seen, sounding, taken_up

RATE_HZ = 48_000
PRESET = load_preset(SHIPPED / "studio_any_string.safetensors")
KEY = 45  # an open string of the guitar
SOURCES = ("model", "truth")
OPEN = (40, 45, 50, 55, 59, 64)
Sound = NDArray[np.float64]
Timed = tuple[float, Event]


def changed(instrument: Instrument, **parts: object) -> Instrument:
    """An instrument with other parts; a part that is a mapping changes the values that it names."""
    whole = {
        name: {**(vars(value) if (value := getattr(instrument, name)) else {}), **p} if isinstance(p, dict) else p
        for name, p in parts.items()
    }
    return Instrument.model_validate({**dict(instrument), **whole})


def of_six_strings(guitar: Instrument) -> Instrument:
    """Six strings that differ in thickness."""
    strings = [OpenString(note=key, string=replace(STEEL, area_m2=5e-7 * 1.1**n)) for n, key in enumerate(OPEN)]
    return changed(guitar, strings=StringSet(strings=tuple(strings)))


def string_of(instrument: Instrument, key: int, string: int | None = None) -> KeyString:
    """The string of a key that has one."""
    found = Strings(instrument).of_key(key, string)
    assert found is not None
    return found


def hz_of(key: float) -> float:
    return float(440 * 2 ** ((key - 69) / 12))


def play(instrument: Instrument, seconds: float, *events: Timed, source: str = "model") -> Sound:
    """The left side, without limiter and variation."""
    timed = [TimedEvent(*event) for event in events]
    blocks = list(render_events(instrument, PRESET, timed, RATE_HZ, source, seconds, limited=False, varied=False))
    return np.concatenate(blocks)[:, 0].astype(np.float64)


class Note:
    """A note that was struck, as it is now, or was when it rang last."""

    def __init__(self, player: InstrumentPlayer, seen: Seen) -> None:
        self._player, self._seen = player, seen

    @property
    def now(self) -> Seen:
        self._seen = next((each for each in seen(self._player) if each.id == self._seen.id), self._seen)
        return self._seen

    @property
    def semitones(self) -> float:
        """By how many its string is bent."""
        return 12 * log2(self.now.now.pitch_hz / self.now.own.pitch_hz)

    @property
    def state(self) -> str:
        """As "held", "kept by the pedal", "damped" or "free"."""
        names = {"held": self.now.held, "kept": self.now.kept, "damped": self.now.damped}
        return next((name for name, is_so in names.items() if is_so), "free")


class Stage:
    """A player in a mixer of its own; its notes are seen as well as heard."""

    def __init__(
        self,
        instrument: Instrument,
        sources: Sequence[str] = ("model",),
        varied: bool = True,
        most: int = 40,
        gains: dict[str, float] | None = None,
        preset: Preset = PRESET,
    ) -> None:
        self.mixer = Mixer(RATE_HZ, limited=False)
        gains = gains or dict.fromkeys(sources, 1.0)
        self.player = InstrumentPlayer(instrument, preset, RATE_HZ, gains, most_notes=most, varied=varied)
        self.mixer.set_player(self.player.compiled)
        self.struck: list[Note] = []
        self.reports: list[NoteReport] = []

    def play(self, *events: Event) -> list[Note]:
        """Events, each taken up at once; return all notes that were struck."""
        for event in events:
            number = self.player.handle(event)
            found = taken_up(self.player, self.mixer)
            if isinstance(event, NoteOn):
                self.struck += [Note(self.player, each) for each in found if each.id == number]
        self.reports += self.player.compiled.reports()
        return self.struck

    def take(self, instrument: Instrument) -> None:
        """Another instrument, or the same with a knob turned."""
        self.player.take(self.player.keys_of(instrument))

    def run(self, events: Sequence[tuple[int, Event]], frames: int, block: int = QUANTUM) -> Sound:
        """The sound (frames, 2), before it is rounded; each event is handed over with the block of its frame."""
        left, sound = list(events), []
        for done in range(0, frames, block):
            while left and left[0][0] < done + block:
                frame, event = left.pop(0)
                self.player.handle(event, frame)
            rendered = self.mixer.render(block)
            sound.append(self.mixer.record["mix"].reshape(-1, 2).copy() if block == QUANTUM else rendered)
            self.reports += self.player.compiled.reports()
        return np.concatenate(sound)

    def left(self, frames: int) -> Sound:
        return self.mixer.render(frames)[:, 0].astype(np.float64)

    @property
    def begun(self) -> list[NoteReport]:
        """What began, in order."""
        self.reports += self.player.compiled.reports()
        return [each for each in self.reports if each.kind == of.BEGAN]

    @property
    def sounding(self) -> list[int]:
        return [each.key for each in sounding(self.player)]


# Measures


def level_db(sound: Sound, begin_s: float, end_s: float) -> float:
    part = sound[round(begin_s * RATE_HZ) : round(end_s * RATE_HZ)]
    return float(20 * np.log10(max(np.sqrt(np.mean(part**2)), 1e-12)))


def pitch_hz(sound: Sound, near_hz: float, begin_s: float = 0.1, end_s: float = 1.0, within: float = 0.03) -> float:
    """Of the strongest partial near a frequency, between the bins of a window's transform."""
    part, padded = sound[round(begin_s * RATE_HZ) : round(end_s * RATE_HZ)], 2**20
    spectrum = np.abs(np.fft.rfft(part * np.hanning(len(part)), padded))
    low, high = (int(near_hz * factor * padded / RATE_HZ) for factor in (1 - within, 1 + within))
    peak = low + int(spectrum[low:high].argmax())
    left, middle, right = np.log(spectrum[peak - 1 : peak + 2])
    return float((peak + 0.5 * (left - right) / (left - 2 * middle + right)) * RATE_HZ / padded)


def cents(one_hz: float, other_hz: float) -> float:
    return float(1200 * np.log2(one_hz / other_hz))


def partial(sound: Sound, at_s: float, hz: float, frames: int = 3 * 8_192) -> float:
    """The amplitude of a partial within 1 % of `hz`; others count by less than -90 dB (Blackman-Harris)."""
    first, size, terms = round(at_s * RATE_HZ), 2**18, (0.35875, -0.48829, 0.14128, -0.01168)
    turn = np.arange(frames) * 2 * np.pi / frames
    window = sum(term * np.cos(n * turn) for n, term in enumerate(terms))
    found = np.abs(np.fft.rfft(sound[first : first + frames] * window, size))
    return float(found[round(0.99 * hz / RATE_HZ * size) : round(1.01 * hz / RATE_HZ * size) + 1].max())


def relative(one: Sound, other: Sound) -> float:
    """The energy of a difference, re the second sound's."""
    return float(((one - other) ** 2).sum() / (other**2).sum())

"""Timbre of an instrument in figures, and the ranges in which real instruments lie.

The attack is the first 50 ms from the onset, or eight periods where they are longer, under a Hann window. Its
centroid is weighted by power. Its roll-off is the frequency below which 99 % of the power lies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from app.instrument.events import Event, NoteOff, NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.instrument.strings import Strings
from app.patches.patch import Damping, Noise, Patch
from app.shared.vocabulary import DIFFERENCE
from engine.kernels.constants import QUANTUM
from engine.presets import Preset
from engine.resonators.string import undamped_frequencies

RATE_HZ = 48_000
VELOCITY = 100
SOFT, HARD = 40, 125
WANTED_KEY = 52  # E3
ATTACK_S = 0.050
LEAST_PERIODS = 8.25  # of the attack: a Hann window then separates neighbouring partials
ONSET_DB = -40.0  # re the peak
PARTIALS = 10
SUSTAIN_S = (0.02, 0.52)  # where the level of partials is taken
NEAR = 0.32  # of the fundamental: what is nearer to a partial belongs to it
BELOW = 0.7  # of the fundamental: what is lower is the body's
RIPPLE_S = (0.15, 1.5)
RIPPLE_FLOOR_DB = -45.0  # of a partial re the first, and of its envelope re its peak: below it is left out
EARLY_S, LATE_S = (0.1, 0.5), (2.0, 4.0)
LEVEL_S = 0.02  # of a frame of the whole sound's level
NOTE_S = 4.1
STROKES_APART_S, STROKE_S = 1.2, 0.25
FIFTH = 7  # keys to the second of two notes
FLOOR_DB = -200.0
LEAST_PARTIAL_DB = -50.0  # in a distance

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Timbre:
    """Figures of one instrument at one key; NaN where the sound is too short or too quiet for one.

    Attributes:
        partials_db: levels of partials 1 … 10 re the first.
        between_db: energy of the attack between the partials, re all of it.
        below_db: energy of the attack below the fundamental, re all of it.
        ripple_db: the largest deviation (RMS) of the envelopes of partials 1 … 3 from a straight line in dB.
        t60_early_s, t60_late_s: from straight lines through the level in 0.1 … 0.5 s and 2 … 4 s.
        hard_over_soft: ratio of the centroids at velocities 125 and 40.
        two_notes_db: two keys a fifth apart together, minus the sum of each alone, re that sum.
        repeats_db: the second stroke of a key minus the first, re the first.
        tone: ratio of the centroids at the ends of the macro Tone.
        against_truth: relative mean square of model minus truth over a second, without noise, body and room.
    """

    key: int
    centroid_hz: float
    rolloff_hz: float
    partials_db: tuple[float, ...]
    between_db: float
    below_db: float
    ripple_db: float
    t60_early_s: float
    t60_late_s: float
    hard_over_soft: float
    two_notes_db: float
    repeats_db: float
    tone: float
    against_truth: float

    def figures(self) -> dict[str, float]:
        """All figures by name, in the order of the table; partials as `partial_2` … `partial_10`."""
        found = asdict(self)
        partials = found.pop("partials_db")
        spread = {f"partial_{number + 1}_db": partials[number] for number in range(1, PARTIALS)}
        return {**found, **spread}


@dataclass(frozen=True)
class Reference:
    """The range of a figure for real instruments.

    Attributes:
        patches: names of the instruments it holds for; empty: all acoustic plucked ones.
        taken: how the range was taken.
        everywhere: whether it holds for all instruments of strings.
    """

    figure: str
    low: float
    high: float
    taken: str
    patches: tuple[str, ...] = ()
    everywhere: bool = False

    def holds(self, value: float) -> bool:
        return self.low <= value <= self.high


SAMPLED = (
    "from a sampled instrument of a General MIDI bank at velocity 100, widened to a factor of about 1.5 each way"
)
PIZZICATO = "of a double bass, E3, piano and forte, measured with these functions (D. Smolken, CC0), widened a little"
QUILLS = ("harpsichord", "harpsichord_in_meantone", "harpsichord_lute_stop")
BRIGHT = ("steel_string_acoustic", "harpsichord", "banjo")
ELECTRIC = (
    *("baritone_twang", "electric_guitar_bridge_pick_up", "electric_guitar_neck_pick_up", "jazz_guitar"),
    *("slide_guitar_in_open_d", "electric_bass", "fretless_bass", "picked_bass", "slack_bass"),
)
REFERENCES = (
    Reference("t60_early_s", 0.5, 20, "aim, from short skins to long steel; not measured", everywhere=True),
    Reference("rolloff_hz", 1_500, 6_000, "2 … 5 kHz, resonances of pick-ups with cables (Lemme), widened", ELECTRIC),
    Reference("centroid_hz", 900, 1_800, f"1128 Hz {SAMPLED}", ("steel_string_acoustic",)),
    Reference("rolloff_hz", 5_000, math.inf, f"8417 Hz {SAMPLED}", ("steel_string_acoustic",)),
    Reference("centroid_hz", 1_500, 3_000, f"1962 Hz {SAMPLED}", ("harpsichord",)),
    Reference("rolloff_hz", 6_000, math.inf, f"9617 Hz {SAMPLED}", ("harpsichord",)),
    Reference("partial_10_db", -30, 0, "-11 … -24 dB in the same bank", BRIGHT),
    Reference("between_db", -18, -4, "-10 dB of the bank's steel guitar, ±8 dB", ("steel_string_acoustic",)),
    Reference("below_db", -30, -14, "-22 dB of the bank's steel guitar, ±8 dB", ("steel_string_acoustic",)),
    Reference("ripple_db", 0.3, 5, "0.4 … 4.9 dB in the same bank"),
    Reference("hard_over_soft", 1.3, 3, "1.1 … 3.2 of the pizzicato below from p to f; aim for the others"),
    Reference("hard_over_soft", 0.9, 1.1, "a quill plucks alike at any speed", QUILLS),
    Reference("centroid_hz", 300, 650, f"340 … 563 Hz {PIZZICATO}", ("upright_bass",)),
    Reference("rolloff_hz", 800, 2_000, f"990 … 1550 Hz {PIZZICATO}", ("upright_bass",)),
    Reference("between_db", -20, -5, f"-15.6 … -8 dB {PIZZICATO}", ("upright_bass",)),
    Reference("below_db", -22, -12, f"-17.7 … -15.2 dB {PIZZICATO}", ("upright_bass",)),
    Reference("ripple_db", 1, 7, f"1.8 … 6.5 dB {PIZZICATO}, of all its notes", ("upright_bass",)),
    Reference(
        "two_notes_db", -50, -20, "aim for the harp, whose strings share a board; not measured", ("concert_harp",)
    ),
    Reference("repeats_db", -40, -10, "aim; takes of a player differ by -4 … -12 dB in energy"),
    Reference("tone", 2, 50, "aim: a knob that does much"),
    Reference("against_truth", 0, 1e-6, "aim: of what each patch is, in the equation", everywhere=True),
    Reference("two_stage", 1.5, 10, "late over early T60: two polarisations, after Weinreich", ("classical_guitar",)),
)
PAIRED = ("classical_guitar", "harpsichord", "koto", "banjo", "concert_harp", "electric_bass")
LEAST_DISTANCE_DB = 5.0
BRIGHTEST_FIRST = ("flamenco_guitar", "classical_guitar", "jazz_guitar")  # by the attack's centroid


def timbre(patch: Patch, preset: Preset, source: str = "model") -> Timbre:
    """The figures of a patch at its key nearest to E3 by octaves, without its room.

    Plucks vary from stroke to stroke in `repeats_db` alone.

    Raises:
        ValueError: the key has no possible string.
    """
    varied = patch.with_value("room.mix", 0.0)
    patch = varied.model_copy(update={"pluck": varied.pluck.model_copy(update={"variation": 0.0})})
    key = measured_key(patch)
    string = Strings(patch).of_key(key)
    if string is None:
        raise ValueError(f"{patch.name}: key {key} is silent in its tuning")
    omega = undamped_frequencies(string.parameters, min(string.modes, 3 * PARTIALS))
    partials_hz = np.asarray(omega, np.float64) / math.tau

    def played(seconds: float, *events: tuple[float, Event], by: Patch = patch) -> Array:
        timed = [TimedEvent(*each) for each in events]
        blocks = render_events(by, preset, timed, RATE_HZ, source, seconds, limited=False)
        return np.concatenate(list(blocks)).mean(1, dtype=np.float64)

    note = played(NOTE_S, (0.0, NoteOn(key, VELOCITY)))
    first = attack(note, partials_hz[0])
    centroids = [
        centroid_hz(attack(played(0.4, (0.0, NoteOn(key, velocity))), partials_hz[0])) for velocity in (SOFT, HARD)
    ]
    levels = partials_db(note, partials_hz)
    return Timbre(
        key,
        centroid_hz(first),
        rolloff_hz(first),
        levels,
        between_db(first, partials_hz),
        below_db(first, partials_hz),
        max((ripple_db(note, partials_hz, n) for n in range(3) if levels[n] > RIPPLE_FLOOR_DB), default=math.nan),
        t60_s(note, EARLY_S),
        t60_s(note, LATE_S),
        centroids[1] / centroids[0],
        _two_notes_db(played, patch, key),
        _repeats_db(played, varied, key),
        _tone(played, patch, key, partials_hz[0]),
        _against_truth(patch, preset, key),
    )


def measured_key(patch: Patch) -> int:
    """E3, or the E of another octave nearest to it in the patch's range; C4 for keyboards, as the reference."""
    low, high = patch.range
    wanted = 60 if patch.category == "keys" else WANTED_KEY
    octaves = sorted(range(wanted % 12, 128, 12), key=lambda key: abs(key - wanted))
    return next((key for key in octaves if low <= key <= high), min(max(wanted, low), high))


def attack(sound: Array, first_hz: float) -> Array:
    """The first 50 ms from the onset, or 8.25 periods, under a Hann window."""
    level = np.abs(sound)
    onset = int((level > level.max() * 10 ** (ONSET_DB / 20)).argmax())
    frames = round(max(ATTACK_S, LEAST_PERIODS / first_hz) * RATE_HZ)
    part = sound[onset : onset + frames]
    return part * np.hanning(len(part))


def centroid_hz(windowed: Array) -> float:
    """The mean frequency, weighted by power."""
    frequency_hz, power = _power(windowed)
    return float(np.average(frequency_hz, weights=power))


def rolloff_hz(windowed: Array) -> float:
    """The frequency below which 99 % of the power lies."""
    frequency_hz, power = _power(windowed)
    summed = np.cumsum(power)
    return float(frequency_hz[np.searchsorted(summed, 0.99 * summed[-1])])


def partials_db(sound: Array, partials_hz: Array) -> tuple[float, ...]:
    """Levels of the first ten partials re the first, each at its largest near its frequency; NaN for one it lacks."""
    begin, end = (round(each * RATE_HZ) for each in SUSTAIN_S)
    part = sound[begin:end]
    frequency_hz, power = _power(part * np.hanning(len(part)))
    levels = np.full(PARTIALS, math.nan)
    for number, partial_hz in enumerate(partials_hz[:PARTIALS]):
        near = np.abs(frequency_hz - partial_hz) < NEAR * partials_hz[0]
        levels[number] = 10 * math.log10(max(float(power[near].max()), 1e-30))
    return tuple(float(level) for level in levels - levels[0])


def between_db(windowed: Array, partials_hz: Array) -> float:
    """Energy between the partials and above the fundamental, up to the tenth, re all of it there."""
    frequency_hz, power = _power(windowed)
    highest_hz = partials_hz[min(PARTIALS, len(partials_hz)) - 1] + NEAR * partials_hz[0]
    inside = (frequency_hz > (1 - NEAR) * partials_hz[0]) & (frequency_hz < highest_hz)
    distance = np.abs(frequency_hz[:, None] - partials_hz[None]).min(1)
    between = inside & (distance > NEAR * partials_hz[0])
    return _ratio_db(float(power[between].sum()), float(power[inside].sum()))


def below_db(windowed: Array, partials_hz: Array) -> float:
    """Energy below the fundamental, above 20 Hz, re all."""
    frequency_hz, power = _power(windowed)
    below = (frequency_hz > 20) & (frequency_hz < BELOW * partials_hz[0])
    return _ratio_db(float(power[below].sum()), float(power.sum()))


def ripple_db(sound: Array, partials_hz: Array, number: int) -> float:
    """Deviation (RMS) of a partial's envelope from a straight line in dB."""
    time_s = np.arange(len(sound)) / RATE_HZ
    frames = round(max(0.06, 4 / partials_hz[0]) * RATE_HZ)
    window = np.hanning(frames)
    turned = sound * np.exp(-2j * np.pi * partials_hz[number] * time_s)
    hop = frames // 4
    begins = range(round(RIPPLE_S[0] * RATE_HZ), min(round(RIPPLE_S[1] * RATE_HZ), len(sound) - frames), hop)
    envelope = np.array([abs(np.vdot(window, turned[begin : begin + frames])) for begin in begins])
    level = 20 * np.log10(np.maximum(envelope, 1e-30))
    heard = level > level.max() + RIPPLE_FLOOR_DB
    if heard.sum() < 8:
        return math.nan
    times = np.arange(len(level))[heard]
    line = np.polyval(np.polyfit(times, level[heard], 1), times)
    return float(np.sqrt(np.mean((level[heard] - line) ** 2)))


def t60_s(sound: Array, within_s: tuple[float, float]) -> float:
    """Time of a fall by 60 dB, from a straight line through the level; NaN where it is silent or does not fall."""
    frames = round(LEVEL_S * RATE_HZ)
    begin, end = (round(each * RATE_HZ) for each in within_s)
    part = sound[begin:end]
    blocks = part[: len(part) // frames * frames].reshape(-1, frames)
    power = (blocks**2).mean(1)
    if not power.min(initial=math.inf) > 1e-14:
        return math.nan
    slope = float(np.polyfit(np.arange(len(power)) * LEVEL_S, 10 * np.log10(power), 1)[0])
    return -60 / slope if slope < 0 else math.nan


def distance_db(one: Timbre, other: Timbre) -> float:
    """Spectral distance: the mean difference of the levels of partials 1 … 8, less the difference in overall level.

    Levels below -50 dB re the first count as that, so that a partial that is left out does not rule the mean.
    """
    levels = np.maximum([one.partials_db[:8], other.partials_db[:8]], LEAST_PARTIAL_DB)
    difference = levels[0] - levels[1]
    return float(np.nanmean(np.abs(difference - np.nanmedian(difference))))


def references_of(name: str, acoustic: bool) -> Mapping[str, Reference]:
    """Figure -> range, for the instrument of this name; its own range goes before that of all acoustic ones."""
    general = {each.figure: each for each in REFERENCES if each.everywhere or (acoustic and not each.patches)}
    return {**general, **{each.figure: each for each in REFERENCES if name in each.patches}}


def _two_notes_db(played: Callable[..., Array], patch: Patch, key: int) -> float:
    """On two channels, so that a guitar plays them on two strings."""
    other = key + FIFTH if key + FIFTH <= patch.range[1] else key - FIFTH
    notes = (0.0, NoteOn(key, VELOCITY, 0)), (0.0, NoteOn(other, VELOCITY, 1))
    together = played(1.0, *notes)
    summed = played(1.0, notes[0]) + played(1.0, notes[1])
    return _ratio_db(float(np.square(together - summed).sum()), float(np.square(summed).sum()))


def _repeats_db(played: Callable[..., Array], patch: Patch, key: int) -> float:
    """With a damper, so that nothing of the first stroke is left in the second."""
    damped = patch.model_copy(update={"damping": Damping(release_t60_s=0.05)})
    again_s = round(STROKES_APART_S * RATE_HZ / QUANTUM) * QUANTUM / RATE_HZ
    strokes = (0.0, NoteOn(key, VELOCITY)), (STROKE_S, NoteOff(key)), (again_s, NoteOn(key, VELOCITY))
    sound = played(again_s + STROKE_S, *strokes, by=damped)
    frames, again = round(STROKE_S * RATE_HZ), round(again_s * RATE_HZ)
    first, second = sound[:frames], sound[again : again + frames]
    return _ratio_db(float(np.square(second - first).sum()), float(np.square(first).sum()))


def _tone(played: Callable[..., Array], patch: Patch, key: int, first_hz: float) -> float:
    """NaN for an instrument without that macro."""
    number = next((number for number, macro in enumerate(patch.macros) if macro.name == "Tone"), None)
    if number is None:
        return math.nan
    dark, bright = (
        centroid_hz(attack(played(0.4, (0.0, NoteOn(key, VELOCITY)), by=patch.turned(number, end)), first_hz))
        for end in (0.0, 1.0)
    )
    return bright / dark


def _against_truth(patch: Patch, preset: Preset, key: int) -> float:
    note = [TimedEvent(0.0, NoteOn(key, VELOCITY))]
    quiet = patch.model_copy(update={"noise": Noise()})
    differs, truth = (
        np.concatenate([*render_events(quiet, preset, note, RATE_HZ, each, 1.0, limited=False, dry=True)])
        for each in (DIFFERENCE, "truth")
    )
    return float(np.square(differs, dtype=np.float64).sum() / np.square(truth, dtype=np.float64).sum())


def _power(windowed: Array) -> tuple[Array, Array]:
    """Frequencies in Hz and power, finer than the window resolves."""
    points = 1 << (4 * len(windowed) - 1).bit_length()
    power = np.abs(np.fft.rfft(windowed, points)) ** 2
    return np.asarray(np.fft.rfftfreq(points, 1 / RATE_HZ), np.float64), power


def _ratio_db(part: float, whole: float) -> float:
    return max(FLOOR_DB, 10 * math.log10(part / whole)) if part > 0 and whole > 0 else FLOOR_DB

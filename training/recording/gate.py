"""The findings on a recording before it is fitted, with reasons in words and what to do.

Only what cannot be fitted is refused. All else is a warning, and `verdict` judges the fit. Each check is one function
of the sound; all are made, so that a musician reads every reason at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import ndimage, signal

from engine.resonators.base import Array
from training.recording.note import Note, envelope
from training.recording.numbering import SPECTRUM_S, PartialSeries, Peaks, followed, number, peaks_of

CLIPPED_RUNS = 3  # samples of a run of equal ones at the peak, at least
CLIPPED_SAMPLES = 4  # in such runs, at least: fewer do not count as clipped
MOST_CLIPPED = 0.02  # of the samples of the first half second: more is no string's waveform
SHORTEST_RINGING_S = 0.4
LEAST_PERIODS = 10  # of the pitch, in a note
LEAST_SNR_DB = 18.0  # of the loudest level, above the noise
ONSET_RISE_DB = 6.0  # within 40 ms: another attack
LOUD_ONSET_DB = -20.0  # of the loudest attack: below it a sound is no second note
LEAST_PARTIALS = 4  # that stand out of the noise
LEAST_EXPLAINED = 0.3  # see `PartialSeries.explained`: less is a warning
LEAST_FITTED = 0.12  # the same: less is refused
MOST_MISSING = 0.45  # see `PartialSeries.missing`
BODY_SILENT_S = 0.25  # after the onset
CLEAR_DB = 15.0  # above the floor: less may be noise
BODY_HZ = 200.0  # above it, less may be left of a body's mode
HIGHEST_BODY_HZ = 1_000.0
MOST_OFF = 0.006  # of the energy then, at BODY_HZ: more is not one string's
LOUD_DB = -12.0  # below the loudest peak that is off the law
LEAST_SECOND = 2  # partials of a second note, at least
# numbers that two notes have in a series below both: third, sixth, fourth, fifth. The first that fits is taken
SIMPLE_INTERVALS = ((4, 5), (3, 5), (3, 4), (2, 3))
LEAST_OF_TWO = 0.003  # of the energy, in partials that only one of two notes has
MOST_OF_NEITHER = 1e-4  # of the energy, in partials that neither has
HUM_BLOCK_S = 0.02  # stretches whose median power is the hum's
ATTACK_S = 0.06  # at most so long before the onset the attack begins
SLOWEST_ATTACK_S = 0.12  # that a level rises without a warning
PLUCKED_S = 0.06  # as long rises the level of a pluck, in a window of 0.05 s
MOST_BEFORE_PEAK = 0.5  # of the energy: more is a note reversed
LOOP_S = 0.08  # a stretch that is looked for
LOOP_LAG_S = 0.5  # at least so far before: beats of a pure tone come back sooner
LOUD_LOOP = 1e-4  # of the loudest stretch's energy
LEAST_FILLED_DB = 20.0  # from partials down to what sounds between them, 0.3 to 0.9 s after the onset


@dataclass(frozen=True)
class Finding:
    """A reason against a recording, and the remedy.

    Attributes:
        kind: a short name for tables.
        refused: it cannot be fitted; otherwise it is a warning.
    """

    kind: str
    reason: str
    remedy: str
    refused: bool = False


def examine(samples: Array, note: Note, series: PartialSeries | None) -> tuple[Finding, ...]:
    """The findings against a recording; empty: nothing speaks against it.

    Args:
        samples: of the file, (frames,) or (frames, channels), at any rate.
        note: the same as mono; all times count from its onset.
        series: its partials; None: none were found.
    """
    findings = [
        clipped(samples, note),
        already_playing(note),
        slow_attack(note),
        reverberant(note, series),
        too_short(note, series),
        looped(note),
        more_onsets(note, series),
        no_series(series),
    ]
    if series is not None:
        findings.append(second_series(note, series))
    return tuple(finding for finding in findings if finding is not None)


def clipped(samples: Array, note: Note) -> Finding | None:
    """Runs of equal samples at the peak, as of a converter that is full; refused where they are many."""
    sound = np.asarray(samples, float)
    sound = sound if sound.ndim == 1 else sound[:, int(np.argmax(np.nanmax(np.abs(sound), axis=0)))]
    peak = float(np.nanmax(np.abs(sound)))
    count = 0
    for sign in (1, -1):
        full = sign * sound >= peak * (1 - 1e-4)
        # of each run at the peak, in samples
        lengths = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], full.astype(int), [0]]))))[::2]
        count += int(np.sum(lengths[lengths >= CLIPPED_RUNS]))
    if count < CLIPPED_SAMPLES:
        return None
    # the recording may have a higher rate than its note
    first_half_second = min(len(note.part(0, 0.5)) / len(note.samples), 1.0) * len(sound)
    words, refused = f"it is clipped ({count} samples at the limit)", count > MOST_CLIPPED * first_half_second
    return Finding("clipped", words, "lower the input gain and record it again", refused)


def already_playing(note: Note) -> Finding | None:
    """A waveform that is at a fifth of its peak or more where the file begins; the onset lies within 10 ms."""
    if note.onset > round(0.01 * note.rate_hz):
        return None
    loudest = float(np.abs(note.samples[: round(0.3 * note.rate_hz)]).max())
    if float(np.abs(note.samples[:3]).max()) < 0.2 * loudest:
        return None
    words = "the note is already playing where the file begins"
    return Finding("playing", words, "keep the silence before the attack")


def slow_attack(note: Note) -> Finding | None:
    """A level that rises for longer than any pluck, as in a room; most of the energy before the peak: reversed."""
    level = envelope(note.samples, note.rate_hz, 0.05)  # (frames,), a window of 0.05 s
    peak = int(np.argmax(level))
    quiet = np.flatnonzero(level[:peak] < 0.3 * level[peak])
    rise_s = (peak - (int(quiet[-1]) if len(quiet) else 0)) / note.rate_hz
    before = float(np.sum(level[:peak] ** 2) / np.sum(level**2))
    is_reversed = rise_s > PLUCKED_S and before > MOST_BEFORE_PEAK
    if rise_s < SLOWEST_ATTACK_S and not is_reversed:
        return None
    words = f"its level rises for {rise_s:.2f} s: reversed, faded in, bowed, or in a large room"
    return Finding("edited", words, "give a plucked note as it was recorded", is_reversed)


def reverberant(note: Note, series: PartialSeries | None) -> Finding | None:
    """Sound between the partials half a second after the attack, well above the noise: the room's."""
    if series is None or note.seconds < 0.9 or len(series.present) < LEAST_PARTIALS:
        return None
    part = note.part(0.3, 0.9)  # s after the onset
    power = np.abs(np.fft.rfft(part * np.hanning(len(part)))) ** 2
    hz = np.fft.rfftfreq(len(part), 1 / note.rate_hz)
    noise = note.noise_power * float(np.sum(np.hanning(len(part)) ** 2))
    partials = series.partials_hz(max(series.present))
    ratios = []
    for low, high in pairwise(partials[:12]):
        quarter = 0.25 * (high - low)
        between = float(np.median(power[(hz > low + quarter) & (hz < high - quarter)]))
        peak = float(power[(hz > low - quarter) & (hz < low + quarter)].max())
        if peak > 100 * noise:
            ratios.append(10 * np.log10(peak / max(between - noise, 1e-30)))
    if len(ratios) < 3 or float(np.median(ratios)) > LEAST_FILLED_DB:
        return None
    return Finding("reverberant", "a room rings between its partials", "record closer, or in a drier room")


def too_short(note: Note, series: PartialSeries | None) -> Finding | None:
    """The finding that a note rings too briefly, or stands too little above its noise; None: neither.

    It rings from its onset until its level falls for good below twice the noise, or a thousandth of the loudest.
    """
    remedy = "let the note ring for two seconds or more"
    level = envelope(note.samples[note.onset :], note.rate_hz, 0.03)  # from the onset, a window of 0.03 s
    noise = np.sqrt(note.noise_power)
    above = np.flatnonzero(level > max(2 * noise, 1e-3 * float(level.max())))
    seconds = min(note.seconds, float(above[-1]) / note.rate_hz if len(above) else 0.0)
    if series is not None and note.seconds * series.f0_hz < LEAST_PERIODS:
        words = f"it lasts {note.seconds:.2f} s, fewer than {LEAST_PERIODS} periods"
        return Finding("short", words, remedy, refused=True)
    snr_db = 20 * np.log10(float(level.max()) / max(noise, 1e-12))
    if snr_db < LEAST_SNR_DB:
        return Finding("noisy", f"it stands only {snr_db:.0f} dB above its noise", "record it closer, or louder")
    if seconds < SHORTEST_RINGING_S:
        return Finding("short", f"it rings for only {seconds:.2f} s", remedy)
    return None


def looped(note: Note) -> Finding | None:
    """A last loud stretch of 0.08 s that equals one at least 0.5 s before it, as of a sampler's loop."""
    sound = note.samples[note.onset :]
    block = round(LOOP_S * note.rate_hz)
    energies = np.sum(sound[: len(sound) // block * block].reshape(-1, block) ** 2, axis=1)
    # of a note that has died away only noise is left, or a converter's last bit
    loud = np.flatnonzero(energies > LOUD_LOOP * float(energies.max(initial=0.0)))
    last = int(loud[-1]) * block if len(loud) else 0
    earlier = sound[: max(0, last + block - round(LOOP_LAG_S * note.rate_hz))]
    if last == 0 or len(earlier) < block:
        return None
    pattern, energy = sound[last : last + block], float(energies[loud[-1]])
    products = signal.fftconvolve(earlier, pattern[::-1], mode="valid")
    squares = signal.fftconvolve(earlier**2, np.ones(block), mode="valid")
    # of a loop, the level is the same too; a decaying note's is lower by then
    equal = 1 - (squares + energy - 2 * products) / energy
    if float(equal.max()) < 0.999:
        return None
    words = "a stretch of it comes back sample by sample"
    return Finding("looped", words, "give the recording itself, not a sample loop", refused=True)


def more_onsets(note: Note, series: PartialSeries | None) -> Finding | None:
    """A rise of level from 0.09 s after the onset on, in two of three bands at once; refused where it is loud."""
    rate = note.rate_hz
    sound = note.samples[note.onset : note.onset + round(6 * rate)]
    period = 1 / series.f0_hz if series is not None else 0.02
    window = max(0.02, 2.5 * period)
    noise = np.sqrt(note.noise_power)
    rises, levels = [], []
    for low, high in ((60.0, 500.0), (500.0, 2_000.0), (2_000.0, 8_000.0)):
        if high > 0.45 * rate:
            continue
        sections = signal.butter(2, (low, high), "bandpass", fs=rate, output="sos")
        level = envelope(signal.sosfilt(sections, sound), rate, window)
        step = max(1, round(0.005 * rate))  # 5 ms: from here on times are in these
        db = 20 * np.log10(level[::step] + 2 * noise + 1e-4 * float(level.max()))
        apart = max(1, round(0.04 / 0.005))
        rise = db[apart:] - db[:-apart]  # within 40 ms
        begin = round(0.09 / 0.005)
        if len(rise) > begin:
            rises.append(ndimage.maximum_filter1d(rise[begin:], 3))
            levels.append(ndimage.maximum_filter1d(db[apart:][begin:], 3) - float(db.max()))
    if not rises:
        return None
    # an attack is heard in two bands at once; beats of partials are not
    loud = [np.where(level > LOUD_ONSET_DB, rise, 0.0) for rise, level in zip(rises, levels, strict=True)]
    for rising, refused in ((loud, True), (rises, False)):
        together = np.sort(np.stack(rising), axis=0)[max(-2, -len(rising))]
        if float(together.max()) >= ONSET_RISE_DB:
            at = 0.09 + 0.005 * int(np.argmax(together))
            words = f"another attack begins {at:.2f} s after the first"
            return Finding("onsets", words, "cut out a single note", refused)
    return None


def no_series(series: PartialSeries | None) -> Finding | None:
    """Peaks that are not the partials of one stiff string, or too few of them."""
    words = "its peaks are not the partials of one string"
    remedy = "give one plucked note; drums, slaps and strums are no strings"
    if series is None or not series.present:
        return Finding("no_series", words, remedy, refused=True)
    if series.explained < LEAST_EXPLAINED or series.missing > MOST_MISSING:
        words = f"{words} ({series.explained:.0%} belong to a series at {series.f0_hz:.1f} Hz)"
        return Finding("no_series", words, remedy, refused=series.explained < LEAST_FITTED)
    if len(series.present) < LEAST_PARTIALS:
        return Finding("no_series", f"only {len(series.present)} partials stand out", "record it closer, or louder")
    return None


def second_series(note: Note, series: PartialSeries) -> Finding | None:
    """Sound off the law of one string, once the body is silent: another note's, or a drum's.

    A body's mode loses its energy within a number of periods, so the higher a peak is, the less may be left of it.
    """
    begin_s = BODY_SILENT_S if note.seconds > 2 * BODY_SILENT_S else 0.4 * note.seconds
    part = note.part(begin_s, min(begin_s + SPECTRUM_S, 0.9 * note.seconds))
    if len(part) * series.f0_hz < LEAST_PERIODS * note.rate_hz:
        return None
    peaks = peaks_of(part, note.rate_hz, note.noise_power)
    if len(peaks.hz) == 0:
        return None
    first_series = followed(peaks, series)
    remedy = "record one note alone; drums, slaps and strums are no strings"
    if (both := _two_in(peaks, first_series)) is not None:
        words = "two notes sound, at {:.1f} Hz and {:.1f} Hz".format(*both)
        return Finding("chord", words, remedy, refused=True)
    rest = peaks.without(first_series, CLEAR_DB, _hum_db(note, part))
    lasting = np.minimum(rest.hz, HIGHEST_BODY_HZ) / BODY_HZ
    if float(np.sum(lasting * rest.power)) < MOST_OFF * float(np.sum(peaks.power)):
        return None
    other = number(rest.loudest(LOUD_DB))
    if other is not None and rest.near(other).sum() >= LEAST_SECOND:
        words = f"a second note sounds at {other.f0_hz:.1f} Hz beside {first_series.f0_hz:.1f} Hz"
        return Finding("chord", words, remedy, refused=True)
    loudest_hz = float(rest.hz[np.argmax(rest.level_db)])
    words = f"a sound at {loudest_hz:.1f} Hz is off the partials of one string at {first_series.f0_hz:.1f} Hz"
    return Finding("off the law", words, remedy, refused=True)


def _two_in(peaks: Peaks, series: PartialSeries) -> tuple[float, float] | None:
    """The pitches in Hz of two strings that were numbered as one series; None: it is one string's.

    Of a fifth, for example, only the numbers that are multiples of 2 or of 3 sound.
    """
    numbers = series.numbers_of(peaks.hz)
    power = np.where(peaks.near(series), peaks.power, 0.0)
    for low, high in SIMPLE_INTERVALS:
        of_low, of_high = numbers % low == 0, numbers % high == 0
        least = min(float(power[of_low & ~of_high].sum()), float(power[of_high & ~of_low].sum()))
        if least > LEAST_OF_TWO * power.sum() and power[~of_low & ~of_high].sum() < MOST_OF_NEITHER * power.sum():
            return low * series.f0_hz, high * series.f0_hz
    return None


def _hum_db(note: Note, part: Array) -> float:
    """The level in dB, as in the spectrum of `part`, of a peak with all the power before the attack: a hum's."""
    block = round(HUM_BLOCK_S * note.rate_hz)
    count = max(0, note.onset - round(ATTACK_S * note.rate_hz)) // block
    powers = np.var(note.samples[: count * block].reshape(count, block), axis=1)
    positive = powers[powers > 0]  # no digital silence
    power = float(np.median(positive)) if len(positive) else 0.0
    return float(10 * np.log10(power / 2 * np.sum(np.hanning(len(part) + 2)) ** 2 + 1e-30))

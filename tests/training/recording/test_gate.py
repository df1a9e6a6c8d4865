"""The gate refuses what cannot be fitted, warns of what is unusual, and the verdict judges the fit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import fftconvolve

from tests.training.recording.sounds import CHANGES, membrane
from tests.training.recording.synthetic import SyntheticNote, synthetic_note
from training.recording.gate import second_series
from training.recording.learn import Learned, NotFound, Refused, examined, learn, require_found
from training.recording.note import note_of
from training.recording.numbering import peaks_of, series_at
from training.recording.preset import Source

RATE_HZ = 44_100
Change = Callable[[np.ndarray], np.ndarray]


def kinds(samples: np.ndarray, rate_hz: int = RATE_HZ) -> set[str]:
    return {each.kind for each in examined(samples, rate_hz).findings}


def refused(samples: np.ndarray, rate_hz: int = RATE_HZ) -> set[str]:
    return {each.kind for each in examined(samples, rate_hz).refusals}


def looped(x: np.ndarray) -> np.ndarray:
    return np.concatenate([x[:20_000], *[x[20_000:31_000]] * 7])


def reverberated(x: np.ndarray) -> np.ndarray:
    t = np.arange(RATE_HZ) / RATE_HZ
    room = np.random.default_rng(0).standard_normal(len(t)) * np.exp(-3 * t)
    room[0] = 1
    return 0.02 * fftconvolve(x, room)[: len(x)]


@pytest.mark.parametrize("seed", range(4))
def test_one_note_is_kept(seed: int) -> None:
    assert kinds(synthetic_note(seed).samples) == set()


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (lambda x: np.clip(4 * x, -0.5, 0.5), "clipped"),
        (lambda x: x[::-1].copy(), "edited"),
        (lambda x: np.concatenate([x[:40_000], x]), "onsets"),
        (looped, "looped"),
        (lambda x: x[: RATE_HZ // 3], "short"),
        (lambda x: x + 0.05 * np.random.default_rng(0).standard_normal(len(x)), "noisy"),
        (reverberated, "edited"),  # so much of a room that the level rises for long
    ],
)
def test_reasons(synthetic: SyntheticNote, change: Change, kind: str) -> None:
    assert kind in kinds(change(synthetic.samples))


@pytest.mark.parametrize("kind", [kind for kind in CHANGES if kind != "three changes"])
def test_a_note_is_kept_as_users_record_it(synthetic: SyntheticNote, kind: str) -> None:
    assert refused(*CHANGES[kind](np.random.default_rng(1), (synthetic.samples, RATE_HZ))) == set()


def test_a_note_that_soon_dies_away_is_not_reversed() -> None:
    t = np.arange(RATE_HZ) / RATE_HZ
    sound = sum(np.sin(2 * np.pi * 700 * k * t) * np.exp(-30 * t) / k for k in range(1, 7))
    note = np.concatenate([np.zeros(RATE_HZ // 5), 0.3 * sound])
    assert "edited" not in kinds(note)
    assert refused(note[::-1].copy())


@pytest.mark.parametrize("value", [0.0, -2e-4])
def test_silence_behind_a_note_changes_nothing(synthetic: SyntheticNote, value: float) -> None:
    samples = synthetic.samples[:90_000]
    control, behind = (examined(each, RATE_HZ) for each in (samples, np.append(samples, np.full(33_000, value))))
    assert behind.series == control.series and behind.findings == control.findings == ()
    assert np.array_equal(behind.note.samples, control.note.samples)


def test_a_few_clipped_samples_are_a_warning_and_many_are_refused(synthetic: SyntheticNote) -> None:
    limit = np.sort(np.abs(synthetic.samples))[-8]
    few = np.clip(synthetic.samples, -limit, limit)
    assert kinds(few) == {"clipped"} and refused(few) == set()
    assert refused(np.clip(4 * synthetic.samples, -0.5, 0.5)) == {"clipped"}


def test_a_faint_second_attack_is_a_warning(synthetic: SyntheticNote) -> None:
    knock = np.zeros(len(synthetic.samples))
    knock[40_000:44_000] = np.random.default_rng(0).standard_normal(4_000) * np.geomspace(1, 1e-3, 4_000)
    assert "onsets" in refused(synthetic.samples + 0.3 * knock)
    assert "onsets" not in refused(synthetic.samples + 0.004 * knock)


@pytest.mark.parametrize("change", [lambda x: x[::-1].copy(), looped, lambda x: np.concatenate([x[:40_000], x])])
def test_what_is_edited_is_refused(synthetic: SyntheticNote, change: Change) -> None:
    assert refused(change(synthetic.samples))
    assert refused(np.append(change(synthetic.samples), np.zeros(30_000)))


@pytest.mark.parametrize("level_db", [0, -5, -10])
def test_a_second_note_is_heard(synthetic: SyntheticNote, level_db: float) -> None:
    other = synthetic_note(1).samples  # 148 Hz
    assert refused(synthetic.samples + 10 ** (level_db / 20) * other) == {"chord"}


@pytest.mark.parametrize("hz", [500.0, 640.0, 810.0])
def test_a_second_note_of_few_partials_is_heard(synthetic: SyntheticNote, hz: float) -> None:
    other = synthetic_note(3, f0_range_hz=(hz, 1.001 * hz), highest_hz=2_500.0).samples
    assert refused(synthetic.samples + 10 ** (-10 / 20) * other) & {"chord", "off the law"}


def string(hz: float, count: int, decay: float, begin_s: float = 0.09) -> np.ndarray:
    """A stiff string's first partials, of 1.7 s, from a time on."""
    t = np.arange(round(1.7 * RATE_HZ)) / RATE_HZ - begin_s
    k = np.arange(1, count + 1)[:, None]
    waves = np.sin(2 * np.pi * hz * k * np.sqrt(1 + 3e-5 * k**2) * t + k**2) * np.exp(-decay * (1 + 0.1 * k) * t) / k
    return np.asarray(np.where(t < 0, 0.0, waves.sum(0)))


def together(first: np.ndarray, second: np.ndarray, level_db: float) -> np.ndarray:
    """Two notes and a faint noise, the second so far below the first's energy."""
    second = second * 10 ** (level_db / 20) * np.sqrt(float(first @ first) / float(second @ second))
    return 0.3 * (first + second) + 1e-5 * np.random.default_rng(0).standard_normal(len(first))


@pytest.mark.parametrize("interval", [3 / 2, 2 ** (7 / 12), 4 / 3, 5 / 4, 2 ** (3 / 12)])
@pytest.mark.parametrize("hz", [110.0, 330.0])
@pytest.mark.parametrize("strum_s", [0.0, 0.03])
def test_a_soft_second_note_is_heard_at_each_interval(hz: float, interval: float, strum_s: float) -> None:
    first, second = string(hz, 8, 2.0), string(interval * hz, 6, 4.0, 0.09 + strum_s)
    assert refused(together(first, second, -10)) == {"chord"}
    assert refused(together(first, second, -90)) == set()


@pytest.mark.parametrize("low, high", [(2, 3), (3, 4)])
def test_two_notes_that_were_numbered_as_one_are_heard(low: int, high: int) -> None:
    sound = together(string(55.0 * low, 8, 3.0), string(55.0 * high, 8, 3.0), -3)
    note = note_of(sound, RATE_HZ)
    below = series_at(peaks_of(note.part(0.06, 0.76), RATE_HZ, note.noise_power), 55.0, 0.0)
    found = second_series(note, below)
    assert found is not None and found.reason.startswith(f"two notes sound, at {low * 55}")


def test_an_offset_before_the_attack_is_no_hum() -> None:
    sound, rate_hz = membrane(np.random.default_rng(3))
    lead = 1e-6 * np.random.default_rng(0).standard_normal(rate_hz // 3)
    assert refused(np.append(lead, sound + 0.1 * np.abs(sound))) & {"chord", "off the law"}


def test_silence_before_a_hum_leaves_it_a_hum(synthetic: SyntheticNote) -> None:
    t = np.arange(len(synthetic.samples)) / RATE_HZ
    hum = sum(np.sin(2 * np.pi * 50 * k * t + k) / k for k in (1, 2, 3, 4))
    assert refused(np.append(np.zeros(RATE_HZ), synthetic.samples + 3e-3 * hum)) == set()


@pytest.mark.parametrize("seed", range(4))
def test_a_drum_is_refused(seed: int) -> None:
    assert refused(*membrane(np.random.default_rng(seed)))


def test_what_is_off_the_law_is_refused_once_the_body_is_silent(synthetic: SyntheticNote) -> None:
    t = np.arange(len(synthetic.samples) - 5_000) / RATE_HZ
    for hz, decay, is_refused in ((216.0, 40.0, False), (216.0, 2.0, True)):  # of the body, and of something else
        mode = np.concatenate([np.zeros(5_000), 0.1 * np.sin(2 * np.pi * hz * t) * np.exp(-decay * t)])
        assert ("off the law" in refused(synthetic.samples + mode)) == is_refused


def test_a_note_without_peaks_in_the_end_is_examined() -> None:
    t = np.arange(RATE_HZ) / RATE_HZ
    sound = np.concatenate([np.zeros(4_000), 0.3 * np.sin(2 * np.pi * 300 * t) * np.exp(-60 * t)])
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(sound))
    for each in (sound, sound + noise):
        assert "chord" not in refused(each)


def test_a_hum_is_no_second_note(synthetic: SyntheticNote) -> None:
    t = np.arange(len(synthetic.samples)) / RATE_HZ
    hum = sum(np.sin(2 * np.pi * 50 * k * t + k) / k for k in (1, 2, 3, 4))
    assert refused(synthetic.samples + 3e-3 * hum) == set()


def burst() -> np.ndarray:
    t = np.arange(RATE_HZ) / RATE_HZ
    return np.concatenate([np.zeros(4_000), 0.3 * np.random.default_rng(0).standard_normal(len(t)) * np.exp(-6 * t)])


def drum() -> np.ndarray:
    t = np.arange(RATE_HZ) / RATE_HZ
    modes = sum(np.sin(2 * np.pi * 110 * m * t) * np.exp(-(6 + m) * t) for m in (1, 1.59, 2.14, 2.30, 2.65, 2.92))
    sound = np.concatenate([np.zeros(4_000), 0.1 * modes])
    return sound + 1e-4 * np.random.default_rng(0).standard_normal(len(sound))


def test_a_refusal_says_what_to_do_and_can_be_overruled(synthetic: SyntheticNote) -> None:
    clipped = np.clip(4 * synthetic.samples, -0.5, 0.5)
    source = Source("clipped.wav", "0" * 64, RATE_HZ, len(clipped))
    with pytest.raises(Refused, match="lower the input gain"):
        learn([(examined(clipped, RATE_HZ), source)])


def test_the_verdict_is_of_the_fit(learned: Learned) -> None:
    require_found([learned])
    assert learned.verdict.found and learned.verdict.words.startswith("string found: error 0.0")
    assert learned.verdict.esr < learned.verdict.linear_esr


@pytest.mark.parametrize("made", [burst, drum])
def test_in_drums_and_noise_no_string_is_found(made: Callable[[], np.ndarray]) -> None:
    sound = made()
    source = Source("drum.wav", "0" * 64, RATE_HZ, len(sound))
    learned = learn([(examined(sound, RATE_HZ), source)], anyway=True)
    assert not learned[0].verdict.found
    with pytest.raises(NotFound, match=r"drum\.wav: no string found: .*; record one plucked note alone"):
        require_found(learned)


def test_a_short_note_is_no_loop(synthetic: SyntheticNote) -> None:
    short = synthetic.samples[: round(0.45 * RATE_HZ)]  # 0.35 s of it
    assert refused(short) == set()
    assert "looped" not in kinds(short)

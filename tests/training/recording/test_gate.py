"""The gate refuses what cannot be fitted, warns of what is unusual, and the verdict judges the fit."""

import numpy as np
import pytest
from scipy.signal import fftconvolve

from tests.training.recording.sounds import CHANGES, membrane, noise
from tests.training.recording.synthetic import synthetic_note
from training.recording.learn import NotFound, Refused, examined, learn, require_found
from training.recording.preset import Source

RATE_HZ = 44_100


def refused(samples: np.ndarray, rate_hz: int = RATE_HZ) -> set[str]:
    return {each.kind for each in examined(samples, rate_hz).refusals}


T = np.arange(127_891) / RATE_HZ  # of the synthetic note
NOISE = np.random.default_rng(0).standard_normal(len(T))
HUM = sum(np.sin(2 * np.pi * 50 * k * T + k) / k for k in (1, 2, 3, 4))


def reverberated(x: np.ndarray) -> np.ndarray:
    t = np.arange(RATE_HZ) / RATE_HZ
    room = np.random.default_rng(0).standard_normal(len(t)) * np.exp(-3 * t)
    room[0] = 1
    return 0.02 * fftconvolve(x, room)[: len(x)]


def knocked(x: np.ndarray, level: float) -> np.ndarray:
    knock = NOISE[:4_000] * np.geomspace(1, 1e-3, 4_000)
    return x + level * np.pad(knock, (40_000, len(x) - 44_000))


def with_mode(x: np.ndarray, decay: float) -> np.ndarray:
    """Of 216 Hz, off the law."""
    return x + np.where(T < 0.113, 0, 0.1 * np.sin(2 * np.pi * 216 * T) * np.exp(-decay * (T - 0.113)))


def with_note(x: np.ndarray, level_db: float) -> np.ndarray:
    return x + 10 ** (level_db / 20) * synthetic_note(1).samples  # of 148 Hz


CHANGED = {  # what must be found, and what refused
    "many samples clipped": (lambda x: np.clip(4 * x, -0.5, 0.5), {"clipped"}, {"clipped"}),
    "clipped above alone, as with an offset": (lambda x: np.minimum(x + 0.3, 0.4), {"clipped"}, {"clipped"}),
    "clipped below alone": (lambda x: -np.minimum(x + 0.3, 0.4), {"clipped"}, {"clipped"}),
    "few samples clipped": (lambda x: np.clip(x, np.sort(-np.abs(x))[7], np.sort(np.abs(x))[-8]), {"clipped"}, set()),
    "reversed": (lambda x: x[::-1].copy(), {"edited"}, {"edited"}),
    "so much of a room that the level rises for long": (reverberated, {"edited"}, {"chord"}),
    "two attacks": (lambda x: np.concatenate([x[:40_000], x]), {"onsets"}, {"onsets"}),
    "a knock": (lambda x: knocked(x, 0.3), {"onsets"}, {"onsets"}),
    "a faint knock": (lambda x: knocked(x, 0.004), set(), set()),
    "a loop": (lambda x: np.concatenate([x[:20_000], *[x[20_000:31_000]] * 7]), {"looped"}, {"looped"}),
    "short": (lambda x: x[: RATE_HZ // 3], {"short"}, set()),
    "short, and no loop": (lambda x: x[: round(0.45 * RATE_HZ)], set(), set()),
    "noisy": (lambda x: x + 0.05 * NOISE, {"noisy"}, set()),
    "a hum": (lambda x: x + 3e-3 * HUM, set(), set()),
    "a hum behind silence": (lambda x: np.append(np.zeros(RATE_HZ), x + 3e-3 * HUM), set(), set()),
    "a mode of the body": (lambda x: with_mode(x, 40.0), set(), set()),
    "a mode of something else": (lambda x: with_mode(x, 2.0), {"off the law"}, {"off the law"}),
    "a second note": (lambda x: with_note(x, 0), {"chord"}, {"chord"}),
    "a second note, 10 dB below": (lambda x: with_note(x, -10), {"chord"}, {"chord"}),
}


@pytest.mark.parametrize("name", CHANGED)
def test_what_cannot_be_fitted_is_refused_and_what_is_unusual_is_a_warning(synthetic, name):
    change, found, refused_kinds = CHANGED[name]
    findings = examined(change(synthetic.samples), RATE_HZ)
    assert found <= {each.kind for each in findings.findings}
    assert refused_kinds <= {each.kind for each in findings.refusals}
    assert bool(findings.refusals) == bool(refused_kinds)


@pytest.mark.parametrize("kind", CHANGES)
def test_a_note_is_kept_as_users_record_it(synthetic, kind):
    assert refused(*CHANGES[kind](np.random.default_rng(1), synthetic.samples, RATE_HZ)) == set()


def test_a_note_that_soon_dies_away_is_not_reversed_and_one_without_peaks_in_the_end_is_no_chord():
    t = np.arange(RATE_HZ) / RATE_HZ
    sound = sum(np.sin(2 * np.pi * 700 * k * t) * np.exp(-30 * t) / k for k in range(1, 7))
    note = np.concatenate([np.zeros(RATE_HZ // 5), 0.3 * sound])
    assert "edited" not in {each.kind for each in examined(note, RATE_HZ).findings}
    assert refused(note[::-1].copy())
    sound = np.concatenate([np.zeros(4_000), 0.3 * np.sin(2 * np.pi * 300 * t) * np.exp(-60 * t)])
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(sound))
    for each in (sound, sound + noise):
        assert "chord" not in refused(each)


@pytest.mark.parametrize("value", [0.0, -2e-4])
def test_silence_behind_a_note_changes_nothing(synthetic, value):
    samples = synthetic.samples[:90_000]
    control, behind = (examined(each, RATE_HZ) for each in (samples, np.append(samples, np.full(33_000, value))))
    assert behind.series == control.series and behind.findings == control.findings == ()
    assert np.array_equal(behind.note.samples, control.note.samples)


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
@pytest.mark.parametrize(("hz", "strum_s"), [(110.0, 0.0), (330.0, 0.03)])
def test_a_soft_second_note_is_heard_at_each_interval(hz, interval, strum_s):
    first, second = string(hz, 8, 2.0), string(interval * hz, 6, 4.0, 0.09 + strum_s)
    assert refused(together(first, second, -10)) == {"chord"}


@pytest.mark.parametrize("hz", [110.0, 330.0])
def test_a_second_note_that_nobody_hears_is_none(hz):
    """At any interval its peaks lie below those that are looked for: one of the intervals is enough."""
    assert refused(together(string(hz, 8, 2.0), string(2 ** (3 / 12) * hz, 6, 4.0), -90)) == set()


def test_drums_are_refused():
    assert all(refused(*membrane(np.random.default_rng(seed))) for seed in range(4))


def test_a_refusal_says_what_to_do_and_the_verdict_is_of_the_fit(synthetic, learned):
    clipped = np.clip(4 * synthetic.samples, -0.5, 0.5)
    with pytest.raises(Refused, match=r"clipped\.wav: .*lower the input gain"):
        learn([(examined(clipped, RATE_HZ), Source("clipped.wav", "0" * 64, RATE_HZ, len(clipped)))])
    require_found([learned])
    assert learned.verdict.found and learned.verdict.words.startswith("string found: error 0.0")
    assert learned.verdict.esr < learned.verdict.linear_esr


@pytest.mark.parametrize("sound", [noise(np.random.default_rng(0), 1), membrane(np.random.default_rng(32))])
def test_in_drums_and_noise_no_string_is_found(sound):
    samples = sound[0][: RATE_HZ // 2]
    source = Source("drum.wav", "0" * 64, RATE_HZ, len(samples))
    learned = learn([(examined(samples, RATE_HZ), source)], anyway=True)
    assert not learned[0].verdict.found
    with pytest.raises(NotFound, match=r"drum\.wav: no string found: .*; record one plucked note alone"):
        require_found(learned)

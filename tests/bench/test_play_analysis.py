"""The analysis of a recording, on sounds that are known: plucks that overlap, and what is done to them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.bench.play import analysis
from tests.bench.play.analysis import Span
from tests.bench.play.recording import CardClock

RATE_HZ = 48_000
SECONDS = 3.0
LATE = 2400  # frames from a key to its pluck
STEP = RATE_HZ // 12


def pluck(seconds: float, pitch_hz: float, place: float, heard_at: float = 0.37) -> NDArray[np.float64]:
    """A string that is released at a place: a broad hump runs to both sides, and each partial decays."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    number = np.arange(1, 30)[:, np.newaxis]
    stiff_hz = pitch_hz * number * np.sqrt(1 + 1e-4 * number**2)
    levels = np.sin(number * np.pi * place) * np.sin(number * np.pi * heard_at) * np.exp(-((0.1 * number) ** 2))
    ringing = levels * np.cos(2 * np.pi * stiff_hz * t) * np.exp(-(1 + 0.02 * number**2) * t)
    return 0.1 * np.sum(ringing[stiff_hz[:, 0] < RATE_HZ / 2], axis=0)


@pytest.fixture(scope="module")
def keys() -> list[int]:
    random = np.random.default_rng(1)
    return [RATE_HZ // 4 + STEP * number + int(random.integers(-400, 400)) for number in range(26)]


@pytest.fixture(scope="module")
def clean(keys: list[int]) -> NDArray[np.float32]:
    """Twelve plucks a second at ten places, in both channels, as single precision has them."""
    random = np.random.default_rng(2)
    plucks = [pluck(SECONDS, 123.0, 0.05 + 0.1 * place) for place in range(10)]
    sound = np.zeros(round(SECONDS * RATE_HZ))
    for key in keys:
        start = key + LATE
        sound[start:] += plucks[random.integers(10)][: sound.size - start]
    return np.column_stack([sound, sound]).astype(np.float32)


def found_in(sound: NDArray[np.float32], keys: list[int]) -> tuple[list[Span], list[Span], list[int]]:
    """Holes, fades other than holes, clicks."""
    expected = analysis.expected_sound(sound, keys, RATE_HZ)
    holes = analysis.holes(sound, expected, RATE_HZ)
    fades = [fade for fade in analysis.fades(sound[:, 0], expected, RATE_HZ) if not any(map(fade.meets, holes))]
    rest = analysis.unpredicted(sound[:, 0], RATE_HZ)
    events = analysis.events(rest, RATE_HZ)
    plucked = analysis.matched(keys, events, rest.by_past, LATE, RATE_HZ)
    return holes, fades, analysis.clicks(events, plucked, [*holes, *fades], expected, RATE_HZ)


def test_overlapping_plucks_are_no_fault(clean: NDArray[np.float32], keys: list[int]) -> None:
    assert found_in(clean, keys) == ([], [], [])


def test_one_low_string_alone_is_no_fault() -> None:
    sound = np.zeros((3 * RATE_HZ, 2), np.float32)
    sound[RATE_HZ:] = pluck(2.0, 41.2, 0.11)[:, np.newaxis]
    assert found_in(sound, [RATE_HZ - LATE]) == ([], [], [])


@pytest.mark.parametrize("frames", [48, 256, 9000])
def test_holes_are_found_with_their_length(clean: NDArray[np.float32], keys: list[int], frames: int) -> None:
    sound = clean.copy()
    sound[60_000 : 60_000 + frames] = 0
    sound[90_000:90_040] = 0  # less than a millisecond
    sound[100_000:101_000, 0] = 0  # the other channel sounds
    holes, _, _ = found_in(sound, keys)
    assert holes == [Span(60_000, 60_000 + frames)]


def test_silence_before_and_after_playing_is_no_hole(clean: NDArray[np.float32], keys: list[int]) -> None:
    silence = np.zeros((RATE_HZ, 2), np.float32)
    sound = np.concatenate([silence, clean, silence, clean])
    later = [key + RATE_HZ for key in keys] + [key + 2 * RATE_HZ + len(clean) for key in keys]
    assert found_in(sound, later)[0] == []


def test_silences_are_found_with_how_they_begin_and_end(
    clean: NDArray[np.float32], keys: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(analysis, "LOOKED_AT", 1001)  # silences lie across what is looked at
    sound = clean[keys[0] + LATE :, 0].copy()
    sound[60_000:60_500] = 0
    sound[70_000:70_040] = 0  # less than a millisecond
    fade = np.linspace(1, 0, 576)  # 12 ms
    sound[80_000:80_576] *= fade
    sound[80_576:90_000] = 0
    sound[90_000:90_576] *= fade[::-1]
    found = analysis.silences(np.concatenate([np.zeros(5000, np.float32), sound]), RATE_HZ)
    assert [(each.start, each.end, each.sharp) for each in found] == [(65_000, 65_500, True), (85_575, 95_001, False)]


@pytest.mark.parametrize("frames", [240, 960, 4800])
def test_a_fade_is_found_where_it_is(clean: NDArray[np.float32], keys: list[int], frames: int) -> None:
    sound = clean.copy()
    edge = 0.5 + 0.5 * np.cos(np.linspace(0, np.pi, 96))
    gain = np.concatenate([edge, np.zeros(frames), edge[::-1]]) * 0.9995 + 0.0005
    sound[75_000 : 75_000 + gain.size] *= gain[:, np.newaxis].astype(np.float32)
    holes, fades, _ = found_in(sound, keys)
    assert holes == []
    assert len(fades) == 1
    assert abs(fades[0].start - 75_096) <= 96
    assert abs(fades[0].end - (75_096 + frames)) <= 96


def test_clicks_are_found_and_attacks_are_not(clean: NDArray[np.float32], keys: list[int]) -> None:
    sound = clean.copy()
    places = [key + LATE + STEP // 2 for key in keys[3:24:6]]
    for place in places:
        sound[place : place + 300] += 0.01  # a step up and, 6 ms later, down
    _, _, clicks = found_in(sound, keys)
    for place in places:
        assert min(abs(click - place) for click in clicks) <= 48
    # Near a click a very soft attack may be taken for another; nothing else is.
    known = [edge for place in places for edge in (place, place + 300)] + [key + LATE for key in keys]
    assert all(min(abs(click - place) for place in known) <= 48 for click in clicks)


def test_a_pluck_at_no_keys_time_is_no_click(clean: NDArray[np.float32], keys: list[int]) -> None:
    sound, late = clean[:, 0].copy(), keys[12] + LATE + STEP // 2
    click = keys[20] + LATE + STEP // 2
    sound[late:] += pluck(SECONDS, 123.0, 0.25)[: sound.size - late].astype(np.float32)
    sound[click : click + 300] += 0.02
    rest = analysis.unpredicted(sound, RATE_HZ)
    events = analysis.events(rest, RATE_HZ)
    plucked = analysis.matched(keys, events, rest.by_past, LATE, RATE_HZ)
    untimely = analysis.untimely(events, plucked, RATE_HZ)
    assert len(untimely) == 1 and abs(untimely[0] - late) <= 48
    expected = analysis.expected_sound(sound[:, np.newaxis], keys, RATE_HZ)
    clicks = analysis.clicks(events, [*plucked, *untimely], [], expected, RATE_HZ)
    assert any(abs(each - edge) <= 48 for each in clicks for edge in (click, click + 300))
    assert all(abs(each - late) > STEP for each in clicks)


def test_the_first_frame_after_silence_is_exact() -> None:
    sound = np.zeros(RATE_HZ)
    sound[12_345:] = pluck(1.0, 196.0, 0.8)[: RATE_HZ - 12_345] + 1e-5
    assert analysis.onset(sound, 10_000, RATE_HZ) == 12_345
    assert analysis.onset(sound[:12_000], 10_000, RATE_HZ) is None


@pytest.mark.parametrize("place", [0.12, 0.3, 0.44, 0.61])
def test_a_pluck_among_others_is_found_within_a_millisecond_of_its_sound(place: float) -> None:
    """Of its sound at the listening point, where a far hump arrives later than its release."""
    sound = np.zeros(3 * RATE_HZ)
    for number, other in enumerate((0.2, 0.55, 0.83, 0.35)):
        sound[number * 9000 :] += pluck(3.0, 123.0, other)[: sound.size - number * 9000]
    new = pluck(1.0, 123.0, place)
    sound[100_000:] += new[:44_000]
    arrives = 100_000 + int(np.argmax(np.abs(new) > 1e-3 * np.abs(new).max()))
    found = analysis.onset(sound, 98_000, RATE_HZ)
    assert found is not None
    assert abs(found - arrives) <= RATE_HZ // 1000


def test_the_clock_is_read_off_the_arrivals_that_were_not_late() -> None:
    random = np.random.default_rng(3)
    frames = np.cumsum(random.integers(30, 256, 5000)).astype(float)
    late_s = random.exponential(0.004, frames.size) * (random.random(frames.size) < 0.9)
    clock = CardClock.through(frames, 100.0 + frames / 47_990 + late_s)
    assert clock.time_s(240_000) == pytest.approx(100 + 240_000 / 47_990, abs=1e-6)
    assert clock.frame(100 + 10_000 / 47_990) == 10_000
    assert clock.spread_s < 1e-6

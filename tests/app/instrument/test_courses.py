"""Courses, vibrato, slides, and the aperture and flux of a magnetic pick-up: measured on sound of model and truth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.signal

from app.instrument.events import LEGATO, MOD_WHEEL, PORTAMENTO, SLIDE_TIME, Controller, NoteOff, NoteOn
from app.patches.patch import Course, Fretted, Noise, Patch, Pickup, Technique
from engine.kernels import constants as of
from engine.kernels.playing.channels import SLIDE_S
from engine.presets import Preset
from tests.app.instrument.seen import seen
from tests.app.instrument.test_strokes import Played, level
from tests.app.instrument.test_techniques import KEY, RATE_HZ, hz_of, play

SOURCES = pytest.mark.parametrize("source", ["model", "truth"])


def changed(patch: Patch, **parts: object) -> Patch:
    return Patch.model_validate({**dict(patch), **parts})


@SOURCES
def test_equal_strings_of_a_course_are_one_string(patch: Patch, preset: Preset, source: str) -> None:
    events = (0.0, Controller(LEGATO, 127)), (0.0, NoteOn(KEY, 90)), (0.2, NoteOn(KEY + 3, 90))
    events += (0.4, NoteOff(KEY + 3)), (0.6, NoteOff(KEY))
    one, both = (
        play(each, preset, 0.9, *events, source=source) for each in (patch, changed(patch, course=Course(strings=2)))
    )
    np.testing.assert_allclose(both, one, atol=1e-6 * np.abs(one).max())


@SOURCES
def test_strings_of_a_course_beat_by_their_cents(patch: Patch, preset: Preset, source: str) -> None:
    course = changed(patch, course=Course(strings=2, cents=20))
    player = Played(course, preset)
    player.run([(0, NoteOn(KEY, 40))], 640)
    first, second = (note.now.undamped_frequency(1) for note in seen(player.player))
    apart = 1200 * math.log2(second / first)
    assert 10 <= apart <= 30
    sound = play(course, preset, 2.0, (0.0, NoteOn(KEY, 10)), source=source)
    one = play(patch, preset, 2.0, (0.0, NoteOn(KEY, 10)), source=source)
    dip_s = 0.5 / ((second - first) / math.tau)
    ratios = [
        level(sound, at_s, hz_of(KEY), 4_800) / level(one, at_s, hz_of(KEY), 4_800) for at_s in (0.0, dip_s - 0.05)
    ]
    assert ratios[1] < 0.3 < 0.85 < ratios[0]


def test_a_course_is_one_note_to_all_who_ask(patch: Patch, preset: Preset) -> None:
    played = Played(changed(patch, course=Course(strings=3, cents=3, apart_ms=4)), preset)
    began = played.run([(0, NoteOn(KEY, 90)), (9_600, NoteOff(KEY))], 4 * RATE_HZ)
    assert len(began) == 1
    assert [each.kind for each in played.reports].count(of.ENDED) == 1
    assert seen(played.player) == []


def test_strings_of_a_course_sound_one_after_the_other(patch: Patch, preset: Preset) -> None:
    sound, one = (
        play(changed(patch, course=course), preset, 0.3, (0.0, NoteOn(KEY, 90)))
        for course in (Course(strings=2, apart_ms=25), Course())
    )
    late = round(0.025 * RATE_HZ)
    np.testing.assert_allclose(sound[: late - 1], one[: late - 1] / 2, atol=1e-6)
    both = (one[late:] + one[:-late]) / 2
    np.testing.assert_allclose(sound[late:], both, atol=2e-3 * np.abs(one).max())


def test_low_courses_of_a_set_have_octave_strings(guitar: Patch, preset: Preset) -> None:
    played = Played(changed(guitar, course=Course(strings=2, octaves=4)), preset)
    played.run([(0, NoteOn(41, 60)), (0, NoteOn(66, 60))], 640)
    notes = seen(played.player)
    ratios = {note.key: note.now.undamped_frequency(1) for note in notes}
    by_key = {key: sorted(n.now.undamped_frequency(1) for n in notes if n.key == key) for key in ratios}
    assert by_key[41][1] / by_key[41][0] == pytest.approx(2, rel=1e-4)
    assert by_key[66][1] == pytest.approx(by_key[66][0], rel=1e-9)
    thin = min(notes, key=lambda note: note.own.area_m2)
    assert thin.key == 41


@SOURCES
def test_an_aperture_averages_over_its_length(patch: Patch, preset: Preset, source: str) -> None:
    points, wide_mm = (0.13,), 60.0
    narrow, wide = (
        play(
            changed(patch, pickup=Pickup(points=points, kind="velocity", aperture_mm=each)),
            preset,
            1,
            (0.0, NoteOn(KEY, 20)),
            source=source,
        )
        for each in (0.0, wide_mm)
    )
    string = patch.strings.string  # type: ignore[union-attr]
    length_m = string.length_m * string.undamped_frequency(1) / math.tau / hz_of(KEY)

    def ratio(number: int) -> float:
        return level(wide, 0.05, number * hz_of(KEY)) / level(narrow, 0.05, number * hz_of(KEY))

    for number in (2, 3, 4):
        first, each = (np.sinc(n * wide_mm / 2000 / length_m) for n in (1, number))
        assert ratio(number) / ratio(1) == pytest.approx(each / first, rel=1e-4), number


@SOURCES
def test_flux_that_grows_faster_near_the_pick_up_adds_harmonics(patch: Patch, preset: Preset, source: str) -> None:
    """A node of the second partial hears it by the curve alone: half of x/δ, as of exp(x/δ) differentiated."""
    linear, curved = (
        play(
            changed(patch, pickup=Pickup(points=(0.5,), kind="velocity", flux_mm=each)),
            preset,
            1,
            (0.0, NoteOn(KEY, 60)),
            source=source,
        )
        for each in (0.0, 8.0)
    )
    before, after = (level(each, 0.2, 2 * hz_of(KEY)) for each in (linear, curved))
    assert after > 20 * before
    soft, softly = (
        play(
            changed(patch, pickup=Pickup(points=(0.5,), kind="velocity", flux_mm=each)),
            preset,
            0.3,
            (0.0, NoteOn(KEY, 1)),
            source=source,
        )
        for each in (0.0, 100.0)
    )
    assert np.abs(soft - softly).max() < 0.01 * np.abs(soft).max()


@SOURCES
@pytest.mark.parametrize("bend_by", ["tension", "length"])
def test_the_wheel_makes_vibrato(patch: Patch, preset: Preset, bend_by: str, source: str) -> None:
    wheeled = changed(patch, mod_wheel="technique.vibrato_cents", bend_by=bend_by)
    events = (0.0, Controller(MOD_WHEEL, 127)), (0.0, NoteOn(KEY, 20))
    sound = play(wheeled, preset, 2.0, *events, source=source)
    tuned = changed(patch, technique=Technique(vibrato_cents=35), bend_by=bend_by)
    np.testing.assert_array_equal(play(tuned, preset, 2.0, events[1], source=source), sound)
    near = scipy.signal.butter(2, [0.7 * hz_of(KEY), 1.4 * hz_of(KEY)], "bandpass", fs=RATE_HZ, output="sos")
    phase = np.unwrap(np.angle(scipy.signal.hilbert(scipy.signal.sosfiltfilt(near, sound))))
    slow = scipy.signal.butter(2, 30, fs=RATE_HZ, output="sos")
    hz = scipy.signal.sosfiltfilt(slow, np.gradient(phase) * RATE_HZ / math.tau)[RATE_HZ // 2 : 3 * RATE_HZ // 2]
    cents = 1200 * np.log2(hz / hz_of(KEY))
    assert cents.max() - cents.min() == pytest.approx(70, rel=0.15)
    turns = np.flatnonzero(np.diff(np.sign(cents - cents.mean())) > 0)
    assert len(turns) == pytest.approx(5.5, abs=1)
    plain = changed(patch, bend_by=bend_by)
    still, expected = (play(each, preset, 0.5, events[1], source=source) for each in (wheeled, plain))
    np.testing.assert_array_equal(still, expected)


def test_a_slide_squeaks_at_the_windings_that_pass(patch: Patch, preset: Preset) -> None:
    """Noise is what the instrument with noise has more; plain strings have 12 dB less, slow slides a lower band."""
    string, found = patch.strings.string, []  # type: ignore[union-attr]
    for heavier, time in ((1.0, 80), (5.0, 80), (5.0, 100)):
        events = (
            (0.0, Controller(LEGATO, 127)),
            (0.0, Controller(PORTAMENTO, 127)),
            (0.0, Controller(SLIDE_TIME, time)),
        )
        events += (0.0, NoteOn(KEY, 60)), (0.3, NoteOn(KEY + 7, 60))
        changes = {"density_kg_m3": heavier * string.density_kg_m3, "tension_n": heavier * string.tension_n}
        plain = changed(patch, strings=Fretted(string=replace(string, **changes)))
        noisy = changed(plain, noise=Noise(kind="finger", release_db=-12))
        noise = play(noisy, preset, 1.5, *events) - play(plain, preset, 1.5, *events)
        assert not noise[: round(0.3 * RATE_HZ)].any()
        power = np.abs(np.fft.rfft(noise)) ** 2
        half = np.searchsorted(np.cumsum(power), power.sum() / 2) * RATE_HZ / len(noise)
        found.append((10 * math.log10(power.sum()), half))
    (quiet_db, _), (loud_db, quick_hz), (_, slow_hz) = found
    assert loud_db - quiet_db == pytest.approx(12, abs=2)
    slower = (SLIDE_S[1] / SLIDE_S[0]) ** (20 / 127)
    assert quick_hz / slow_hz == pytest.approx(slower, rel=0.3)


def test_one_key_on_two_strings_is_two_courses(guitar: Patch, preset: Preset) -> None:
    """Legato moves the course of the string that is given, and a release ends that alone."""
    played = Played(changed(guitar, course=Course(strings=2)), preset)
    key = 59
    events = [(0, Controller(LEGATO, 127)), *((64 * n, NoteOn(key, 60, string=n)) for n in (1, 2))]
    played.run([*events, (960, NoteOn(key + 2, 60, string=1))], 1_920)
    assert sorted(note.key for note in seen(played.player)) == [key, key, key + 2, key + 2]
    played.run([(0, NoteOff(key, string=2))], 640)
    assert sorted(note.key for note in seen(played.player) if note.held) == [key + 2, key + 2]

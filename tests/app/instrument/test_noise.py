"""Noise of contact: its energy, when it sounds, and that it never sounds where model and truth are compared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.instrument.compiled import InstrumentPlayer
from app.instrument.events import KEYS, LEGATO, SOUND_OFF, SUSTAIN, Controller, Event, NoteOff, NoteOn, TimedEvent
from app.instrument.offline import render_events, render_note
from app.patches.library import SHIPPED, PatchEntry, list_patches
from app.patches.patch import Damping, Fretted, Noise, Patch
from engine.contact import CONTACTS
from engine.kernels import constants as of
from engine.kernels.constants import PART_S, WANTED_DB
from engine.presets import Preset
from engine.voices import Mixer

RATE_HZ = 48_000
RELEASED_S, SECONDS = 0.3, 0.8
KEY = 52


def noisy(patch: Patch, **levels: object) -> Patch:
    return patch.model_copy(update={"noise": Noise.model_validate(levels)})


def played(
    patch: Patch, preset: Preset, source: str = "model", velocity: int = 100, rate_hz: int = RATE_HZ, keys=(KEY,)
) -> np.ndarray:
    timed = [TimedEvent(0.1 * number, NoteOn(key, velocity)) for number, key in enumerate(keys)]
    timed += [TimedEvent(RELEASED_S, NoteOff(key)) for key in keys]
    blocks = list(render_events(patch, preset, timed, rate_hz, source, SECONDS, limited=False))
    return np.concatenate(blocks)[:, 0].astype(np.float64)


def energy_db(sound: np.ndarray, rate_hz: int = RATE_HZ) -> float:
    """Re a note of the wanted loudness."""
    return float(10 * np.log10(np.square(sound).sum() / rate_hz / PART_S) - WANTED_DB)


@pytest.mark.parametrize("kind", CONTACTS)
@pytest.mark.parametrize(("level", "begins_s"), [("onset_db", 0.0), ("release_db", RELEASED_S)])
def test_a_noise_has_its_energy_and_begins_with_its_contact(
    patch: Patch, preset: Preset, kind: str, level: str, begins_s: float
) -> None:
    noise = played(noisy(patch, kind=kind, **{level: -6.0}), preset) - played(patch, preset)
    assert energy_db(noise) == pytest.approx(-6.0, abs=2.5)  # bursts are random
    begin = round(begins_s * RATE_HZ)
    assert not noise[:begin].any() and noise[begin : begin + 480].any()
    assert np.abs(noise[begin + round(0.35 * RATE_HZ) :]).max() < 1e-6


def test_a_noise_is_as_loud_at_every_rate(patch: Patch, preset: Preset) -> None:
    levels = []
    for rate_hz in (44_100, 96_000):
        noise = played(noisy(patch, kind="hammer", onset_db=0.0), preset, rate_hz=rate_hz)
        levels.append(energy_db(noise - played(patch, preset, rate_hz=rate_hz), rate_hz))
    assert levels[0] == pytest.approx(levels[1], abs=2.0)


def test_a_harder_stroke_is_noisier_and_brighter_but_a_quill_is_not(patch: Patch, preset: Preset) -> None:
    ratio_db = 20 * np.log10(patch.pluck.pluck(110).amplitude_mm / patch.pluck.pluck(50).amplitude_mm)
    for kind, expected_db in (("nail", ratio_db), ("quill", 0.0)):
        loud = noisy(patch, kind=kind, onset_db=0.0)
        soft, hard = (
            played(loud, preset, velocity=each) - played(patch, preset, velocity=each) for each in (50, 110)
        )
        assert energy_db(hard) - energy_db(soft) == pytest.approx(expected_db, abs=1.0)
        power = [np.abs(np.fft.rfft(each[:4_800])) ** 2 for each in (soft, hard)]
        centroids = [np.average(np.arange(len(each)), weights=each) for each in power]
        assert centroids[1] > centroids[0]


def test_comparisons_are_without_noise(patch: Patch, preset: Preset) -> None:
    loud = noisy(patch, kind="plectrum", onset_db=6.0, release_db=6.0)
    np.testing.assert_array_equal(played(loud, preset, "difference"), played(patch, preset, "difference"))
    model, truth = (played(loud, preset, each) - played(patch, preset, each) for each in ("model", "truth"))
    np.testing.assert_allclose(model, truth, atol=1e-6)  # one source alone has it, whichever it is
    assert np.abs(model).max() > 0.01


def test_the_same_strokes_have_the_same_noise_and_others_another(patch: Patch, preset: Preset) -> None:
    steady = noisy(patch, kind="nail", onset_db=0.0)
    np.testing.assert_array_equal(played(steady, preset), played(steady, preset))
    varied = steady.model_copy(update={"pluck": patch.pluck.model_copy(update={"variation": 1e-9})})
    quiet = varied.model_copy(update={"noise": Noise()})
    for each, silent, alike in ((steady, patch, True), (varied, quiet, False)):
        keys = (KEY, KEY)
        noise = played(each, preset, keys=keys) - played(silent, preset, keys=keys)
        first, second = noise[:2_000], noise[4_800:6_800]
        difference = np.square(first - second).sum() / np.square(first).sum()
        assert difference < 1e-6 if alike else difference > 0.3


def tick(patch: Patch, preset: Preset, kind: str, *events: tuple[float, Event], level_db: float = -6.0) -> float:
    """Energy of the noise of releases in these events, re a note's."""
    sounds = []
    for each in (noisy(patch, kind=kind, release_db=level_db), patch):
        timed = [TimedEvent(*event) for event in events]
        blocks = render_events(each, preset, timed, RATE_HZ, seconds=events[-1][0] + 0.4, limited=False)
        sounds.append(np.concatenate(list(blocks))[:, 0].astype(np.float64))
    return energy_db(sounds[0] - sounds[1])


def level_db(patch: Patch, preset: Preset, velocity: int, time_s: float) -> float:
    """Of a key that is held: over 20 ms."""
    blocks = render_events(patch, preset, [TimedEvent(0.0, NoteOn(KEY, velocity))], RATE_HZ, seconds=time_s + 0.02)
    part = np.concatenate(list(blocks))[round(time_s * RATE_HZ) :, 0].astype(np.float64)
    return float(10 * np.log10(np.square(part).mean()))


@pytest.mark.parametrize("kind", [kind for kind in CONTACTS if kind != "quill"])
def test_what_lands_on_a_string_is_as_loud_as_its_motion(patch: Patch, preset: Preset, kind: str) -> None:
    """By velocity, by time, and by a pedal that keeps the string ringing."""
    found = {}
    for velocity in (127, 64, 30, 10):
        for time_s in (0.1, 0.5, 2.0):
            on, off = (0.0, NoteOn(KEY, velocity)), (time_s, NoteOff(KEY))
            found[velocity, time_s] = tick(patch, preset, kind, on, off)
            expected = level_db(patch, preset, velocity, time_s) - level_db(patch, preset, 127, 0.1)
            assert found[velocity, time_s] - found[127, 0.1] == pytest.approx(expected, abs=2.0)
    kept = (
        (0.0, Controller(SUSTAIN, 127)),
        (0.0, NoteOn(KEY, 127)),
        (0.1, NoteOff(KEY)),
        (2.0, Controller(SUSTAIN, 0)),
    )
    assert tick(patch, preset, kind, *kept) == pytest.approx(found[127, 2.0], abs=0.5)


def test_a_mechanism_falls_alike_on_every_string(patch: Patch, preset: Preset) -> None:
    found = [
        tick(patch, preset, "quill", (0.0, NoteOn(KEY, velocity)), (time_s, NoteOff(KEY)))
        for velocity, time_s in ((10, 0.1), (127, 0.1), (64, 2.0))
    ]
    assert max(found) - min(found) < 0.1


def test_what_lands_on_a_string_at_rest_is_hardly_heard(patch: Patch, preset: Preset) -> None:
    string = patch.strings.string  # type: ignore[union-attr]
    dull = replace(string, damping_d1_kg_m_s=400 * string.damping_d1_kg_m_s)
    patch = patch.model_copy(update={"strings": Fretted(string=dull)})
    at_once, late = (
        tick(patch, preset, "finger", (0.0, NoteOn(KEY, 127)), (time_s, NoteOff(KEY))) for time_s in (0.01, 0.4)
    )
    assert level_db(patch, preset, 127, 0.4) < level_db(patch, preset, 127, 0.01) - 50
    assert -36 < late - at_once < -28  # there is a floor


def test_a_finger_that_moves_along_a_string_lands_on_its_motion(patch: Patch, preset: Preset) -> None:
    """Legato; a course has one noise."""
    legato, found = (0.0, Controller(LEGATO, 127)), []
    for velocity in (30, 110):
        pulled_on = (legato, (0.0, NoteOn(KEY, velocity)), (0.2, NoteOn(KEY + 2, velocity)))
        found.append(tick(patch, preset, "finger", *pulled_on))
    quieter = patch.pluck.pluck(30).amplitude_mm / patch.pluck.pluck(110).amplitude_mm
    assert found[0] - found[1] == pytest.approx(20 * np.log10(quieter), abs=1.5)


def test_a_repeated_key_has_the_release_of_its_latest_stroke(patch: Patch, preset: Preset) -> None:
    soft, hard = (NoteOn(KEY, velocity) for velocity in (20, 110))
    off = (0.3, NoteOff(KEY))
    after = tick(patch, preset, "finger", (0.0, hard), (0.2, soft), off, off)  # a release for each stroke
    alone = tick(patch, preset, "finger", (0.2, soft), off)
    assert after == pytest.approx(alone, abs=0.5)


RELEASED = [entry for entry in list_patches(SHIPPED)[0] if entry.patch.noise.release_db > -60]


@pytest.mark.parametrize("entry", RELEASED, ids=lambda entry: entry.name)
def test_no_instrument_releases_louder_than_it_plays(entry: PatchEntry, preset: Preset) -> None:
    """At any velocity the tick is well below its note."""
    dry = entry.patch.with_value("room.mix", 0.0)
    key, frames = sum(dry.range) // 2, round(0.03 * RATE_HZ)
    for velocity in (10, 30, 127):
        note, silent = (
            render_note(each, preset, key, velocity, 0.15, 0.4, RATE_HZ).astype(np.float64).mean(1)
            for each in (dry, dry.with_value("noise.release_db", -60.0))
        )
        loudest = [np.convolve(part**2, np.ones(frames)).max() for part in (note - silent, silent)]
        assert 10 * np.log10(loudest[0] / loudest[1]) < -5.0


def test_strings_that_are_let_ring_have_no_noise_of_release(patch: Patch, preset: Preset) -> None:
    rings = patch.model_copy(update={"damping": Damping(let_ring=True)})
    loud = noisy(rings, kind="finger", release_db=6.0)
    np.testing.assert_array_equal(played(loud, preset), played(rings, preset))


def test_a_stop_silences_noise(patch: Patch, preset: Preset) -> None:
    loud = noisy(patch, kind="hammer", onset_db=6.0)
    sounds = []
    for each in (loud, patch):
        timed = [TimedEvent(0.0, NoteOn(KEY, 100)), TimedEvent(0.002, Controller(SOUND_OFF, 0, KEYS))]
        blocks = list(render_events(each, preset, timed, RATE_HZ, "model", 0.2, limited=False))
        sounds.append(np.concatenate(blocks)[:, 0].astype(np.float64))
    noise = sounds[0] - sounds[1]
    assert np.abs(noise[:400]).max() > 0.01 and not noise[round(0.04 * RATE_HZ) :].any()


def test_many_strokes_at_once_keep_within_the_places_of_noises(patch: Patch, preset: Preset) -> None:
    player = InstrumentPlayer(noisy(patch, onset_db=0.0), preset, RATE_HZ, {"model": 1.0}, most_notes=96)
    mixer = Mixer(RATE_HZ)
    mixer.set_player(player.compiled)
    for key in range(30, 30 + of.MOST_NOISES + 8):
        player.handle(NoteOn(key, 100))
    assert np.isfinite(mixer.render(4_800)).all()
    assert np.all(player.compiled.record["noises"]["left"] >= 0)


def test_a_solo_of_one_partial_is_without_noise(patch: Patch, preset: Preset) -> None:
    from engine.values.ear import Ear

    sounds = []
    for each in (noisy(patch, onset_db=6.0), patch):
        player = InstrumentPlayer(each, preset, RATE_HZ, {"model": 1.0}, Ear((0.2,), solo=2))
        mixer = Mixer(RATE_HZ)
        mixer.set_player(player.compiled)
        player.handle(NoteOn(KEY, 100))
        sounds.append(mixer.render(4_800))
    np.testing.assert_array_equal(*sounds)


def test_old_files_have_no_noise() -> None:
    assert Noise().onset_db == Noise().release_db == -60.0

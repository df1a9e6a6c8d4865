"""Noise of contact: its energy, when it sounds, and that it never sounds where model and truth are compared."""

from __future__ import annotations

import numpy as np
import pytest

from app.instrument.compiled import InstrumentPlayer
from app.instrument.events import KEYS, SOUND_OFF, Controller, NoteOff, NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.patches.patch import Damping, Noise, Patch
from engine.contact import CONTACTS
from engine.kernels import playing_layout as of
from engine.kernels.playing_layout import PART_S, WANTED_DB
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
    noises = player.compiled.memory.view(np.int64)[of.PLAYER_NOISES : of.PLAYER_LIMIT : of.NOISE_SLOTS]
    assert np.count_nonzero(noises) <= of.MOST_NOISES


def test_a_solo_of_one_partial_is_without_noise(patch: Patch, preset: Preset) -> None:
    from engine.voices import Ear

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

"""Noise of contact: its energy, when it sounds, and that it never sounds where model and truth are compared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from app.instruments.instrument import Instrument, Noise
from app.instruments.library import SHIPPED, list_instruments
from app.player.events import KEYS, ControlChange, NoteOff, NoteOn
from app.player.offline import render_note
from engine.contact import CONTACTS
from engine.kernels import constants as of
from engine.kernels.constants import PART_S, WANTED_DB
from engine.kernels.midi import LEGATO, SOUND_OFF, SUSTAIN
from engine.presets import Preset
from engine.values.ear import Ear
from tests.app.player.stage import RATE_HZ, Sound, Stage, Timed, changed, play

RELEASED_S, SECONDS = 0.3, 0.7
KEY = 52
ON, OFF = (0.0, NoteOn(KEY, 100)), (RELEASED_S, NoteOff(KEY))


def noise_of(
    instrument: Instrument,
    preset: Preset,
    *events: Timed,
    seconds: float = SECONDS,
    source: str = "model",
    **levels: object,
) -> Sound:
    """What an instrument with noise has more than the same without."""
    noisy = changed(instrument, noise=Noise.model_validate(levels))
    with_it, without = (play(each, preset, seconds, *events, source=source) for each in (noisy, instrument))
    return with_it - without


def energy_db(sound: Sound) -> float:
    """Re a note of the wanted loudness."""
    return float(10 * np.log10(np.square(sound).sum() / RATE_HZ / PART_S) - WANTED_DB)


@pytest.mark.parametrize("kind", CONTACTS)
@pytest.mark.parametrize(("level", "begins_s"), [("onset_db", 0.0), ("release_db", RELEASED_S)])
def test_a_noise_has_its_energy_and_begins_with_its_contact(
    instrument: Instrument, preset: Preset, kind: str, level: str, begins_s: float
) -> None:
    noise = noise_of(instrument, preset, ON, OFF, kind=kind, **{level: -6.0})
    assert energy_db(noise) == pytest.approx(-6.0, abs=2.5)  # bursts are random
    begin = round(begins_s * RATE_HZ)
    assert not noise[:begin].any() and noise[begin : begin + 480].any()
    assert np.abs(noise[begin + round(0.35 * RATE_HZ) :]).max() < 1e-6


@pytest.mark.parametrize(("kind", "follows"), [("nail", 1.0), ("quill", 0.0)])
def test_a_harder_stroke_is_noisier_and_brighter_but_a_quill_is_not(
    instrument: Instrument, preset: Preset, kind: str, follows: float
) -> None:
    ratio_db = 20 * np.log10(instrument.pluck.pluck(110).amplitude_mm / instrument.pluck.pluck(50).amplitude_mm)
    noises = [noise_of(instrument, preset, (0.0, NoteOn(KEY, v)), kind=kind, onset_db=0.0) for v in (50, 110)]
    assert energy_db(noises[1]) - energy_db(noises[0]) == pytest.approx(follows * ratio_db, abs=1.0)
    soft, hard = (np.average(np.arange(2_401), weights=np.abs(np.fft.rfft(each[:4_800])) ** 2) for each in noises)
    assert hard > soft


LEGATO_ON, PEDAL = (0.0, ControlChange(LEGATO, 127)), (0.0, ControlChange(SUSTAIN, 127))


def struck(velocity: int, held_s: float) -> tuple[Timed, Timed]:
    return (0.0, NoteOn(KEY, velocity)), (held_s, NoteOff(KEY))


def moved(velocity: int) -> tuple[Timed, ...]:
    return LEGATO_ON, (0.0, NoteOn(KEY, velocity)), (0.2, NoteOn(KEY + 2, velocity))


@pytest.mark.parametrize(
    ("kind", "one", "other", "apart"),
    [
        ("quill", struck(10, 0.1), struck(127, 0.1), (-0.1, 0.1)),  # a mechanism falls alike on every string
        ("quill", struck(64, 1.0), struck(127, 0.1), (-0.1, 0.1)),
        ("finger", struck(30, 0.1), struck(127, 0.1), (-26.6, -22.6)),  # as their strings move
        ("nail", struck(30, 0.1), struck(127, 0.1), (-26.6, -22.6)),
        ("finger", (PEDAL, *struck(127, 0.1), (1.0, ControlChange(SUSTAIN, 0))), struck(127, 1.0), (-0.5, 0.5)),
        ("finger", moved(30), moved(110), (-22.0, -19.0)),
        ("finger", (ON, (0.2, NoteOn(KEY, 20)), OFF, OFF), ((0.2, NoteOn(KEY, 20)), OFF), (-0.5, 0.5)),
    ],
)
def test_a_release_is_as_loud_as_what_it_lands_on(
    instrument: Instrument,
    preset: Preset,
    kind: str,
    one: Sequence[Timed],
    other: Sequence[Timed],
    apart: tuple[float, float],
) -> None:
    found = [
        energy_db(noise_of(instrument, preset, *each, seconds=each[-1][0] + 0.4, kind=kind, release_db=-6.0))
        for each in (one, other)
    ]
    assert apart[0] <= found[0] - found[1] <= apart[1]


def test_there_is_no_noise_after_a_stop_nor_of_strings_that_are_let_ring(
    instrument: Instrument, preset: Preset
) -> None:
    rings = changed(instrument, damping={"let_ring": True})
    assert not noise_of(rings, preset, ON, OFF, kind="finger", release_db=6.0).any()
    stop = (0.002, ControlChange(SOUND_OFF, 0, KEYS))
    noise = noise_of(instrument, preset, ON, stop, seconds=0.2, kind="hammer", onset_db=6.0)
    assert np.abs(noise[:400]).max() > 0.01 and not noise[round(0.04 * RATE_HZ) :].any()


def test_comparisons_are_without_noise(instrument: Instrument, preset: Preset) -> None:
    """One source alone has it, whichever it is."""
    model, truth, difference = (
        noise_of(instrument, preset, ON, OFF, source=source, kind="plectrum", onset_db=6.0, release_db=6.0)
        for source in ("model", "truth", "difference")
    )
    np.testing.assert_allclose(model, truth, atol=1e-6)
    assert np.abs(model).max() > 0.01 and not difference.any()


@pytest.mark.parametrize(("variation", "alike"), [(0.0, True), (1e-9, False)])
def test_the_same_strokes_have_the_same_noise_and_others_another(
    instrument: Instrument, preset: Preset, variation: float, alike: bool
) -> None:
    sounds, struck_twice = [], [(frame, NoteOn(KEY, 100)) for frame in (0, 4_800)]
    for onset_db in (0.0, -60.0):
        varied = changed(instrument, pluck={"variation": variation}, noise=Noise(kind="nail", onset_db=onset_db))
        sounds.append(Stage(varied, preset).run(struck_twice, 7_040)[:, 0])
    noise = sounds[0] - sounds[1]
    first, second = noise[:2_000], noise[4_800:6_800]
    apart = np.square(first - second).sum() / np.square(first).sum()
    assert apart < 1e-6 if alike else apart > 0.3


RELEASED = [entry.instrument for entry in list_instruments(SHIPPED)[0] if entry.instrument.noise.release_db > -60]


def test_no_instrument_releases_louder_than_it_plays(preset: Preset) -> None:
    """Soft or hard, the tick is well below its note."""
    for instrument in RELEASED:
        dry, key = instrument.with_value("room.mix", 0.0), sum(instrument.range) // 2
        for velocity in (10, 127):
            note, silent = (
                render_note(each, preset, key, velocity, 0.15, 0.25, RATE_HZ).astype(np.float64).mean(1)
                for each in (dry, dry.with_value("noise.release_db", -60.0))
            )
            tick, loudest = (np.convolve(part**2, np.ones(1_440)).max() for part in (note - silent, silent))
            assert 10 * np.log10(tick / loudest) < -5.0, instrument.name


def test_many_strokes_at_once_keep_within_the_places_of_noises(instrument: Instrument, preset: Preset) -> None:
    stage = Stage(changed(instrument, noise=Noise(onset_db=0.0)), preset, most=96)
    for key in range(30, 30 + of.MOST_NOISES + 8):
        stage.player.handle(NoteOn(key, 100))
    assert np.isfinite(stage.left(4_800)).all()
    assert np.all(stage.player.compiled.record["noises"]["left"] >= 0)


def test_a_solo_of_one_partial_is_without_noise(instrument: Instrument, preset: Preset) -> None:
    sounds = []
    for each in (changed(instrument, noise=Noise(onset_db=6.0)), instrument):
        stage = Stage(each, preset)
        stage.player.take(stage.player.keys_of(each, Ear((0.2,), solo=2)))
        stage.player.handle(NoteOn(KEY, 100))
        sounds.append(stage.left(4_800))
    np.testing.assert_array_equal(*sounds)

"""Pictures of a take: at a moment, over time, and by frequency; growth changes none of them."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from app.analysis.heard import HeardMotion, HeardSignal
from app.analysis.moment import Envelope, frame_at
from app.analysis.space_time import Envelopes, Picture, detail_for, picture
from app.analysis.spectrogram import FLOOR_DB, FrequencyRows, Spectrogram
from app.rendering import Take
from app.rendering.take import Pictures
from app.shared.vocabulary import DIFFERENCE
from engine.values.ear import Ear
from tests.app.takes import append_to

PLACES = np.linspace(0, 1, 101)
TIME_S = np.arange(4_001)[:, None] / 4_000
STILL = np.zeros((4_001, 101), np.float32)
MakeTake = Callable[..., Take]


@pytest.fixture
def sines(make_take: MakeTake) -> Take:
    """A second in which both sources swing as one sine of the fundamental; the model at half the amplitude."""
    turn = 2 * np.pi * make_take(STILL, STILL).fundamental_hz
    truth = (1e-3 * np.cos(turn * TIME_S) * np.sin(np.pi * PLACES)).astype(np.float32)
    return make_take(truth / 2, truth)


def both(take: Take) -> list[HeardMotion]:
    return [HeardMotion(take.motions, name) for name in ("model", "truth")]


def test_signals_are_at_their_points_and_with_their_gain(make_take, hear):
    first, second = (
        size_m * np.cos(2 * np.pi * hz * TIME_S) * np.sin(mode * np.pi * PLACES)
        for mode, size_m, hz in ((1, 1e-3, 200), (2, 1e-4, 440))
    )
    take = make_take((first + 1.1 * second).astype(np.float32), (first + second).astype(np.float32))
    hear(take, Ear((0.37, 0.6)))
    heard = HeardSignal(take.listened.signals, "truth")
    assert (heard.there, heard.ready, heard.frames, heard.rate_hz) == (True, 4_001, 4_001, 4_000)
    assert heard.read(100, 300) == pytest.approx(take.motion_m("truth")[100:300, 37], abs=1e-9)
    assert heard.read_all(100, 300)[:, 1] == pytest.approx(take.motion_m("truth")[100:300, 60], abs=1e-9)
    assert [len(heard.read(take.frames + first, take.frames + 50)) for first in (-3, 1)] == [3, 0]
    hear(take, Ear((0.25,)))  # where the second mode is largest
    difference = HeardSignal(take.listened.signals, DIFFERENCE, 10.0).read(0, 9_999)
    hear(take, Ear((0.25,), solo=2))
    alone = HeardSignal(take.listened.signals, "truth").read(0, 9_999)
    assert np.abs(alone).max() == pytest.approx(1e-4, rel=1e-3)
    assert difference == pytest.approx(alone, abs=1e-7)  # a tenth, ten times as loud


def test_a_picture_has_the_shape_in_mm_and_the_blur_around_it(sines, make_take):
    frame = frame_at(sines, both(sines), 0.5, 1.0)
    expected = np.cos(2 * np.pi * sines.fundamental_hz * 0.5)
    assert frame.shapes["truth"][50] == pytest.approx(expected, abs=0.02)
    assert frame.blurs["truth"][1][50] == pytest.approx(1.0, abs=0.02)
    assert frame.blurs["model"][0][50] == pytest.approx(-0.5, abs=0.02)
    assert frame.caption.endswith("past training")
    assert frame_at(sines, both(sines), 0.05, 1.0).caption == "0.050 s"
    empty = make_take(STILL[:1], STILL[:1])
    assert (frame_at(empty, both(empty), 0.0, 1.0).shapes["model"] == 0).all()


def test_an_envelope_holds_the_last_second_and_forgets_what_was_before(make_take):
    model, truth = (
        np.repeat(np.float32([1e-3, soft]), (4_000, 8_001))[:, None] + STILL[0] for soft in (-1e-4, -5e-5)
    )
    take = make_take(model, truth)
    envelope, motions = Envelope(), both(take)
    assert envelope.before(0.0, motions) == {}
    for position_s, lowest, highest in ((0.5, 1.0, 1.0), (1.5, -0.1, 1.0), (2.5, -0.1, -0.1), (9.0, -0.1, -0.1)):
        low, high = envelope.before(position_s, motions)["model"]
        assert (low[50], high[50]) == (pytest.approx(lowest), pytest.approx(highest))
    assert envelope.before(2.5, motions)["truth"][0][50] == pytest.approx(-0.05)
    assert frame_at(take, motions, 1.5, 1.0, envelope).envelopes["model"][1][50] == pytest.approx(1.0)
    assert frame_at(take, motions, 1.5, 1.0).envelopes == {}


def test_the_difference_and_another_preset_at_its_own_rate_and_grid_move_too(sines):
    sines.motions["preset:other"] = other = Pictures(1_000, 11, 1.0)
    other.append(np.linspace(0, 1e-3, 1_001, dtype=np.float32)[:, None] * np.ones(11, np.float32))
    motions = [HeardMotion(sines.motions, DIFFERENCE, 10.0), HeardMotion(sines.motions, "preset:other")]
    frame = frame_at(sines, motions, 0.5, 1.0, Envelope())
    assert frame.blurs[DIFFERENCE][0][50] == pytest.approx(-5.0, abs=0.1)
    assert frame.shapes["preset:other"] == pytest.approx(np.full(11, 0.5), abs=1e-5)
    for bands in (frame.blurs, frame.envelopes):
        assert bands["preset:other"][1][0] == pytest.approx(0.499, abs=1e-4)


FRAMES, RATE_HZ = 4001, 4000
random = np.random.default_rng(1)
MODEL, TRUTH = (random.standard_normal((FRAMES, 101)).astype(np.float32) for _ in range(2))
MOTIONS = {"model": MODEL, "truth": TRUTH, "error": MODEL - TRUTH}


def grown(take: Take) -> Envelopes:
    envelopes = Envelopes(take)
    while envelopes.advance():
        pass
    return envelopes


def drawn(take: Take, quantity: str, times_s: tuple[float, float], columns: int) -> Picture:
    made = picture(grown(take), quantity, times_s, columns)
    assert made is not None
    return made


def test_envelopes_are_the_same_however_the_take_grows(make_take):
    whole = grown(make_take(MODEL, TRUTH))
    take = make_take(MODEL, TRUTH, 1)
    piecewise = Envelopes(take)
    assert not piecewise.advance()
    for stop in (3, 4, 1000, FRAMES):
        append_to(take, MODEL[take.ready_frames : stop], TRUTH[take.ready_frames : stop])
        while piecewise.advance():
            pass
    assert whole.complete and piecewise.complete
    for name, motion in MOTIONS.items():
        np.testing.assert_array_equal(piecewise.largest_m(name), whole.largest_m(name))
        np.testing.assert_array_equal(whole.largest_m(name)[7], np.abs(motion[28:32]).max(axis=0))


@pytest.mark.parametrize("quantity", ["model", "error"])
def test_zoomed_in_every_frame_is_drawn_at_its_time(make_take, quantity):
    made = drawn(make_take(MODEL, TRUTH), quantity, (0.1, 0.12), 300)
    first, last = round(made.start_s * RATE_HZ), round(made.stop_s * RATE_HZ)
    assert made.detail == "frames" and made.start_s <= 0.1 and made.stop_s >= 0.12
    np.testing.assert_array_equal(made.displacement_m, MOTIONS[quantity][first:last].T)


@pytest.mark.parametrize(("stop_s", "detail", "seen_m"), [(0.05, "extremes", -1e-3), (1.0, "envelope", 1e-3)])
def test_a_single_frame_is_seen_at_any_zoom(make_take, stop_s, detail, seen_m):
    motion = np.zeros((FRAMES, 101), np.float32)
    motion[123, 40] = -1e-3
    made = drawn(make_take(motion, motion), "truth", (0.0, stop_s), 150)
    ((place, column),) = np.argwhere(made.displacement_m)
    assert (made.detail, place, made.displacement_m[place, column]) == (detail, 40, np.float32(seen_m))
    column_s = (made.stop_s - made.start_s) / made.displacement_m.shape[1]
    assert abs(made.start_s + (column + 0.5) * column_s - 123 / RATE_HZ) <= column_s + 0.001


@pytest.mark.parametrize("times_s", [(0.0, 1.0), (0.2, 0.3), (0.24, 0.26)])
def test_what_has_been_drawn_stays_while_the_take_grows(make_take, times_s):
    part, whole = (drawn(make_take(MODEL, TRUTH, ready), "model", times_s, 90) for ready in (1009, None))
    columns = part.displacement_m.shape[1]
    assert 0 < columns < whole.displacement_m.shape[1]
    np.testing.assert_array_equal(part.displacement_m, whole.displacement_m[:, :columns])
    assert picture(grown(make_take(MODEL, TRUTH, 400)), "model", (0.5, 0.6), 100) is None


def test_signs_are_drawn_as_long_as_columns_are_short_against_a_period(make_take):
    take = make_take(MODEL, TRUTH)
    details = [detail_for(take, (0, 10 / take.fundamental_hz), columns) for columns in (125, 115)]
    assert details == ["extremes", "envelope"]


def test_the_typical_displacement_ignores_a_short_peak(make_take):
    motion = np.full((FRAMES, 101), 1e-3, np.float32)
    motion[:40] = 1.0
    envelopes = grown(make_take(motion, motion))
    for quantity, stop_s, typical_m in (("truth", 1.0, 1.5e-3), ("truth", 0.005, 1.5), ("error", 1.0, 0)):
        assert envelopes.typical_m(quantity, (0.0, stop_s)) == pytest.approx(typical_m)


MIDDLE = Ear((0.5,))
Spectrograms = Callable[..., Spectrogram]


def tone(amplitude_m: float) -> NDArray[np.float32]:
    """Half a second (2001, 101) of 750 Hz in the string's first shape, 1 at its middle."""
    shape, phase = np.sin(np.pi * np.linspace(0, 1, 101)), 2 * np.pi * 750 * np.arange(2001)[:, None] / RATE_HZ
    return (amplitude_m * np.cos(phase) * shape).astype(np.float32)


@pytest.fixture
def spectrogram(hear: Callable[[Take, Ear], None]) -> Spectrograms:
    def of(take: Take, ear: Ear = MIDDLE) -> Spectrogram:
        hear(take, ear)
        made = Spectrogram(take, take.listened)
        while made.advance():
            pass
        assert made.complete
        return made

    return of


def test_a_sine_has_its_level_and_frequency_from_the_start(make_take, spectrogram):
    made = spectrogram(make_take(tone(1e-3), tone(1e-2)))
    for name, level_db in (("model", -20.0), ("truth", 0.0), ("error", 20 * np.log10(0.9))):
        levels_db = made.levels_db[name]
        assert levels_db.max(axis=1) == pytest.approx(np.full(made.columns, level_db), abs=0.3)
        assert (levels_db.argmax(axis=1) * made.bin_hz) == pytest.approx(np.full(made.columns, 750), abs=10)


@pytest.mark.parametrize(
    ("ear", "level_db", "near_db"),
    [
        (Ear((0.5,), "velocity"), 20 * np.log10(2e-3 * 2 * np.pi * 750 / 30), 0.3),  # louder by its frequency
        (Ear((1 / 6,)), 20 * np.log10(0.5 * 2e-3 / 1e-2), 0.01),  # where the shape is half of the middle's
        (Ear((0.0,)), FLOOR_DB, 1e-3),
        (Ear((0.5,), solo=2), FLOOR_DB, 30),  # there is the first mode alone
    ],
)
def test_levels_of_the_ear(make_take, spectrogram, ear, level_db, near_db):
    made = spectrogram(make_take(tone(1e-3), tone(2e-3)), ear)
    assert made.levels_db["truth"].max(axis=1) == pytest.approx(np.full(made.columns, level_db), abs=near_db)


def test_growing_in_pieces_is_the_same(make_take, spectrogram):
    motion = np.random.default_rng(2).standard_normal((2001, 101)).astype(np.float32)
    motions, take = (motion, motion[::-1].copy()), make_take(motion, motion, 30)
    whole, made, counts = spectrogram(make_take(*motions)), Spectrogram(take, take.listened), []
    for stop in (31, 130, 131, 777, 2001):
        for name, frames in zip(("model", "truth"), motions, strict=True):
            signal = take.listened.signals[name]
            signal.append(frames[signal.ready_frames : stop, 50:51])
        while made.advance():
            pass
        counts.append(made.ready)
    assert counts == sorted(counts) and 0 < counts[1] < made.columns == counts[-1]
    for name, levels_db in whole.levels_db.items():
        np.testing.assert_allclose(made.levels_db[name], levels_db, atol=1e-3)


@pytest.mark.parametrize("space", [np.geomspace, np.linspace])
@pytest.mark.parametrize("bins", [65, 2049])
def test_no_partial_falls_between_two_rows_and_a_flat_spectrum_stays_flat(space, bins):
    bin_hz = 8_000 / (bins - 1)
    rows, edges_hz = FrequencyRows(bins, bin_hz, 100, 50.0, space is np.geomspace), space(50.0, 8_000, 101)
    for bin_ in range(round(200 / bin_hz) + 1, bins - 1, 7):
        levels_db = np.full((1, bins), -100, np.float32)
        levels_db[0, bin_] = 0
        found = rows.of(levels_db)[0]
        row = int(found.argmax())
        width_hz = edges_hz[row + 1] - edges_hz[row]
        assert abs((edges_hz[row] + edges_hz[row + 1]) / 2 - bin_ * bin_hz) <= max(width_hz, bin_hz)
        assert found[row] == 0 or width_hz <= 2 * bin_hz
    assert rows.of(np.full((3, bins), -42, np.float32)) == pytest.approx(np.full((3, 100), -42))

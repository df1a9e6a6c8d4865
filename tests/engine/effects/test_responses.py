"""Responses of bodies and rooms, their kernels against NumPy, a plug-in's; loudness and peak in closed form."""

from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, fftconvolve, sosfiltfilt

from engine.effects import Body, Effects, Impulse, responses
from engine.effects.body import body_memory, curves_of, modes_of
from engine.effects.body_table import BODIES
from engine.effects.responses import partitioned
from engine.effects.room import room_noise, room_response
from engine.kernels import constants as of
from engine.kernels import loudness, prepared
from engine.kernels.constants import CURVES_HZ as RATE_HZ
from engine.kernels.records import NEEDS, RESPONSES
from engine.values.effects import Room

Array = NDArray[np.float64]
GUARD = 1234.5


def noise(frames: int, channels: int = 2) -> Array:
    return np.random.default_rng(frames).standard_normal((frames, channels))


@pytest.mark.parametrize(
    ("frames", "from_hz", "to_hz"),
    [(300, 48_000, 44_100), (1, 44_100, 48_000), (777, 31_337, 96_000), (50, 96_000, 8_000)],
)
def test_another_rate_has_the_fourier_series_with_as_much_silence(frames, from_hz, to_hz):
    given = noise(frames)
    ratio = Fraction(to_hz / from_hz).limit_denominator(1000)
    units = -(-frames // ratio.denominator)
    padded, made = 2 * units * ratio.denominator, 2 * units * ratio.numerator
    spectrum = np.zeros((made // 2 + 1, 2), complex)
    kept = min(padded, made) // 2
    spectrum[:kept] = np.fft.rfft(given, padded, axis=0)[:kept]
    expected = np.fft.irfft(spectrum, made, axis=0) * (made / padded)
    found = responses.resampled(given, from_hz, to_hz)
    assert len(found) == max(1, round(frames * to_hz / from_hz))
    np.testing.assert_allclose(found, expected[: len(found)], atol=1e-12)


@pytest.mark.parametrize(("body_mix", "room_mix"), [(1.0, 0.0), (0.3, 0.0), (0.0, 0.6), (0.7, 0.4), (1.0, 1.0)])
def test_a_mix_has_the_level_of_the_noise_that_goes_in_also_of_two_in_series(body_mix, room_mix):
    """Its power at octaves that count alike is 1, in the mean of both channels."""
    rate_hz, body, room = 8_000, noise(900), noise(1_300)
    weights = responses.weights_of(responses.powers_of(body, room, rate_hz), body_mix, room_mix)
    dry, wet = np.zeros((2_199, 2)), responses.in_series(body, room)
    np.testing.assert_allclose(wet, fftconvolve(body, room, axes=0), atol=1e-12)
    dry[0] = 1.0
    found = weights[0] * dry + weights[3] * wet
    found[:900] += weights[1] * body
    found[:1_300] += weights[2] * room
    frames = 2_199 if body_mix and room_mix else 900 if body_mix else 1_300
    size = 1 << (max(frames, rate_hz // 4) - 1).bit_length()
    hz = np.fft.rfftfreq(size, 1 / rate_hz)
    heard = (hz >= 80) & (hz <= 3_000)
    power = (np.abs(np.fft.rfft(found[:frames], size, axis=0)[heard]) ** 2).mean(1)
    assert (power / hz[heard]).sum() / (1 / hz[heard]).sum() == pytest.approx(1.0)
    assert weights[1] * room_mix == pytest.approx(weights[3] * (1 - room_mix))


# The sum of each response times a slow cosine, left plus right, and its largest sample, of NumPy's code before
FROZEN = {
    "room 0.2 48000": (-2.6516992656680634, 0.19009873708926778),
    "room 0.8 44100": (2.1785637987086006, 0.16618795325984778),
    "room 1.5 96000": (-1.1656136432116548, 0.06515379462116891),
    "body guitar 1.0 48000": (0.18136322224393583, 0.1641018368803138),
    "body harp 1.63 44100": (0.07686475989079102, 0.08459428570552732),
    "body cabinet 0.5 96000": (2.3050694810786787, 0.1215099207005202),
    "body piano 1.0 8000": (-0.01181056311124019, 0.3314517663042752),
    "given 1.0 44100": (-1.3491419439693206, 0.12728636247344602),
    "given 1.37 48000": (-1.2759756150392958, 0.09638609191736673),
    "given 0.5 96000": (-1.4390607703145701, 0.14019766746105977),
}


@pytest.mark.parametrize("name", FROZEN)
def test_sounds_are_as_they_were(name):
    kind, *values = name.split()
    if kind == "room":
        found = room_response(float(values[0]), int(values[1]))
    elif kind == "body":
        found = Body(1.0, float(values[1]), values[0]).response(int(values[2]))
    else:
        impulse = Impulse(decaying(5_000, 2, 900), 44_100)
        found = Body(1.0, float(values[0]), impulse=impulse).response(int(values[1]))
    waves = np.cos(0.01 * np.arange(len(found)))[:, None]
    np.testing.assert_allclose([(found * waves).sum(), np.abs(found).max()], FROZEN[name], rtol=1e-10)


@pytest.mark.parametrize("name", BODIES)
def test_each_body_has_modes_up_to_20_khz_and_rings_out(name):
    frequency_hz = modes_of(BODIES[name])[0]
    frequency_hz = frequency_hz[frequency_hz < 20_000.0]
    assert (np.diff(frequency_hz) >= 0).all() and frequency_hz[-1] > 10_000 and len(frequency_hz) < 1_500
    found = Body(name=name).response(48_000)
    assert np.abs(found[-480:]).max() < 3e-3 * np.abs(found).max()


def t60_s(response: Array, band_hz: tuple[float, float], rate_hz: int) -> float:
    """Schroeder's backward integral, from -5 to -35 dB."""
    heard = sosfiltfilt(butter(4, band_hz, "bandpass", fs=rate_hz, output="sos"), response)
    left = np.cumsum(heard[::-1] ** 2)[::-1]
    level_db = 10 * np.log10(left / left[0])
    first, last = (int(np.argmax(level_db < level)) for level in (-5, -35))
    return 2 * (last - first) / rate_hz


@pytest.mark.parametrize("wanted_s", [0.3, 0.8, 1.5, 3.0])
def test_it_rings_as_long_as_asked_and_shorter_where_it_is_high(wanted_s):
    for side in room_response(wanted_s, 48_000).T:
        middle_s = t60_s(side, (400.0, 630.0), 48_000)
        assert middle_s == pytest.approx(wanted_s, rel=0.12)
        assert t60_s(side, (7_000.0, 9_000.0), 48_000) == pytest.approx(0.4 * wanted_s, rel=0.2)
        assert t60_s(side, (1_700.0, 2_300.0), 48_000) < middle_s


def decaying(frames: int, channels: int, time: int = 700) -> Array:
    return noise(frames, channels) * np.exp(-np.arange(frames) / time)[:, None]


PLUG_IN_BODIES = {
    "none": None,
    "guitar": Body(),
    "mono": Body(impulse=Impulse(decaying(4_001, 1), 44_100)),
    "stereo": Body(impulse=Impulse(decaying(9_000, 2), 96_000)),
}


@pytest.mark.parametrize("kind", PLUG_IN_BODIES)
@pytest.mark.parametrize(("rate_hz", "size", "t60_s"), [(48_000, 1.0, 0.3), (44_100, 1.37, 0.2), (8_000, 0.5, 0.5)])
def test_a_plug_in_has_the_responses_of_the_app_within_its_memory(kind, rate_hz, size, t60_s):
    """Noise and samples are whole numbers in it."""
    body, needs = PLUG_IN_BODIES[kind], np.zeros(len(NEEDS), np.int64)
    memory, whole = body_memory(body), np.rint(room_noise() / prepared.NOISE_UNIT).astype(np.int32)
    given = (memory.ctypes.data, float(rate_hz), size, t60_s)
    prepared.measure(*given, needs.ctypes.data)
    need = needs.view(NEEDS)[0]
    found, work = np.zeros(need["found"] + 1), np.full(need["memory"] + 1, np.nan)
    found[-1] = work[-1] = GUARD
    prepared.prepare(given[0], whole.ctypes.data, *given[1:], found.ctypes.data, work.ctypes.data)
    assert found[-1] == work[-1] == GUARD
    for body_mix, room_mix in ((0.0, 0.4), *(((0.6, 0.0), (0.8, 0.3)) if body else ())):
        weights, mixed = np.zeros(4), np.full(need["part"] + 1, GUARD)
        prepared.weigh(found.ctypes.data, body_mix, room_mix, weights.ctypes.data)
        for first in range(0, need["part"], 5_000):
            prepared.mix(found.ctypes.data, weights.ctypes.data, mixed.ctypes.data, first, 5_000)
        assert mixed[-1] == GUARD
        own = body and Body(body_mix, size, body.name, body.impulse)
        expected = Effects(own, Room(room_mix, t60_s)).impulse(rate_hz)
        padded = np.zeros((need["frames"], 2))
        padded[: len(expected)] = expected
        wanted = partitioned(padded)
        np.testing.assert_array_equal(mixed[:4].view(np.int64), wanted[:4].view(np.int64))
        np.testing.assert_allclose(mixed[4:-1], wanted[4:], atol=1e-8 * np.abs(wanted[4:]).max())
    if body is not None:
        curves = found[: RESPONSES.itemsize // 8].view(RESPONSES)[0]["curves"]
        np.testing.assert_allclose(curves, curves_of(Body(1.0, size, body.name, body.impulse)), atol=1e-7)


NO_BODY = np.zeros(0)
DB = 20 / np.log(10)


def sound_of(omega: Array, sigma: Array, *heard: Array) -> Array:
    rows = np.zeros((of.SOUND_ROWS, len(omega)))
    rows[of.SOUND_OMEGA], rows[of.SOUND_SIGMA] = omega, sigma
    rows[of.SOUND_LEFT : of.SOUND_LEFT + len(heard)] = heard
    return rows.ravel()


def drawn(seed: int, modes: int = 30) -> tuple[Array, Array, Array]:
    """ω, σ and amplitudes of a string, 0.01 of full scale."""
    draw = np.random.default_rng(seed)
    partial = np.arange(1, modes + 1)
    omega = 2 * np.pi * draw.uniform(80, 400) * partial * np.sqrt(1 + 1e-4 * partial**2)
    return omega, draw.uniform(1, 8) + 1e-3 * omega / 50, 0.01 * draw.standard_normal(modes) / partial


def samples(omega: Array, sigma: Array, heard: Array, seconds: float, swings: bool = False) -> Array:
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    found = np.exp(np.multiply.outer(t, 1j * omega - sigma)) @ heard
    return np.asarray(found.imag if swings else found.real)


def measured_db(sound: Array) -> float:
    """K-weighted, over the first part."""
    sound = sound[: round(of.PART_S * RATE_HZ)]
    power = np.abs(np.fft.rfft(sound)) ** 2
    weights = loudness.k_weight(np.fft.rfftfreq(len(sound), 1 / RATE_HZ))
    return 10 * float(np.log10(2 * (power * weights).sum() / len(sound) ** 2))


@pytest.mark.parametrize("seed", range(5))
def test_the_gain_brings_a_sound_to_the_wanted_level(seed):
    omega, sigma, heard = drawn(seed)
    gain = loudness.gain(sound_of(omega, sigma, heard), len(omega), 1, NO_BODY, 0.0)
    assert measured_db(gain * samples(omega, sigma, heard, 0.5)) == pytest.approx(of.WANTED_DB, abs=0.2)
    both = loudness.gain(sound_of(omega, sigma, heard, heard), len(omega), 2, NO_BODY, 0.0)
    assert both == pytest.approx(gain)
    other = loudness.gain(sound_of(omega, sigma, heard, 0 * heard), len(omega), 2, NO_BODY, 0.0)
    assert DB * np.log(other / gain) == pytest.approx(3.01, abs=0.01)


@pytest.mark.parametrize("mix", [0.3, 1.0])
@pytest.mark.parametrize("name", ["guitar", "harp"])
def test_it_does_so_through_a_body(name, mix):
    """The level through the body is that of its steady state: an onset takes a body some hundredths of a second."""
    curves = curves_of(Body(name=name))
    impulse = Effects(Body(mix, name=name)).impulse(RATE_HZ)
    off = []
    for seed in range(8):
        omega, sigma, heard = drawn(seed)
        gain = loudness.gain(sound_of(omega, sigma, heard), len(omega), 1, curves, mix)
        dry = gain * samples(omega, sigma, heard, 0.5)
        through = fftconvolve(dry[:, None], impulse, axes=0)[: len(dry)].T
        off.append(10 * np.log10(np.mean([10 ** (measured_db(side) / 10) for side in through])) - of.WANTED_DB)
    assert np.abs(off).max() < 1.5
    assert np.abs(np.mean(off)) < 0.5


@pytest.mark.parametrize("swings", [False, True])
@pytest.mark.parametrize(("mix", "off_db", "mean_db"), [(0.0, 1.5, 1.0), (0.8, 4.0, 2.0)])
def test_the_peak_is_nearly_the_highest_sample(mix, off_db, mean_db, swings):
    """It is looked for in the first period alone; through a body it is an estimate."""
    curves = curves_of(Body(name="guitar")) if mix else NO_BODY
    impulse = Effects(Body(mix)).impulse(RATE_HZ) if mix else np.ones((1, 1))
    off = []
    for seed in range(8):
        omega, sigma, heard = drawn(seed)
        dry = samples(omega, sigma, heard, 0.1, swings)
        highest = np.abs(fftconvolve(dry[:, None], impulse, axes=0)[: len(dry), 0]).max()
        rows = sound_of(omega, sigma, heard)
        found = loudness.peak(rows, len(omega), swings, curves, mix, 0.0)
        off.append(DB * np.log(found / highest))
        assert found <= loudness.peak(rows, len(omega), swings, curves, mix, 10 * found) <= 10 * found
    assert abs(np.mean(off)) < mean_db
    assert np.abs(off).max() < off_db


def test_silence_has_a_gain_of_one_and_gains_and_peaks_have_bounds():
    omega, sigma, heard = drawn(0)
    assert loudness.gain(sound_of(omega, sigma, 0 * heard), len(omega), 1, NO_BODY, 0.0) == 1.0
    for factor, gain_db in ((1e-9, of.GAIN_RANGE_DB[1]), (1e9, of.GAIN_RANGE_DB[0])):
        found = loudness.gain(sound_of(omega, sigma, factor * heard), len(omega), 1, NO_BODY, 0.0)
        assert DB * np.log(found) == pytest.approx(gain_db)
    highest = 10 ** (of.HIGHEST_PEAK_DB / 20)
    assert loudness.limit(0.9 * highest) == 1.0
    assert 3 * highest * loudness.limit(3 * highest) == pytest.approx(highest)
    assert [loudness.looked_at(28, 88, number) for number in range(loudness.LOOKED_AT)] == [28, 43, 58, 73, 88]

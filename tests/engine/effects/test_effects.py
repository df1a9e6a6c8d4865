"""Body, room and amplifier in the mixer: against SciPy, while they are exchanged, and with what is no sound."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import oaconvolve

from engine.effects import Body, Effects, Impulse
from engine.kernels import amplifier
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import MIXER, WINDOW
from engine.values.effects import Amp, Room
from engine.voices import Mixer
from tests.engine.sounds import RATE_HZ, Samples, Signal, noise, through, wet


def apply(effects: Effects | None, sound: Samples) -> Signal:
    """Sound (frames, 2) through effects, by SciPy after the amplifier: its first frames, as many."""
    if effects is not None and effects.amp is not None:
        sound = through(replace(effects, body=None, room=None), sound)
    if effects is None or not effects.rings:
        return sound.astype(np.float64)
    return np.asarray(oaconvolve(sound.astype(np.float64), effects.impulse(RATE_HZ), axes=0)[: len(sound)])


def response(frames: int, channels: int = 1, seed: int = 2) -> Effects:
    """Noise that decays by 60 dB."""
    samples = np.random.default_rng(seed).standard_normal((frames, channels))
    return Effects(Body(1.0, impulse=Impulse(samples * np.geomspace(1, 1e-3, frames)[:, None], RATE_HZ)))


def mixer_with(effects: Effects | None, samples: Samples | None = None) -> Mixer:
    mixer = Mixer(RATE_HZ, limited=False)
    mixer.set_effects(effects)
    if samples is not None:
        mixer.add(wet(samples))
    return mixer


@pytest.mark.parametrize("block", [1, 63, 64, 65, 4097])
def test_blocks_of_any_size_are_the_same_samples(block):
    samples, effects = noise(8000), response(5000, 2)
    whole, parts = mixer_with(effects, samples), mixer_with(effects, samples)
    found = np.concatenate([parts.render(min(block, 8000 - first)) for first in range(0, 8000, block)])
    np.testing.assert_array_equal(found, whole.render(8000))


EDGES = [1, 63, 64, 65, 2 * WINDOW - 1, 2 * WINDOW, 2 * WINDOW + 1, 3 * WINDOW, 3 * WINDOW + 1, 20_000]
CHOICES = [
    *(response(frames, 1 + number % 2) for number, frames in enumerate(EDGES)),
    Effects(Body(0.5, 0.7)),
    Effects(room=Room(0.3, 0.4)),
    Effects(Body(0.8), Room(0.2, 0.8)),
    Effects(Body(0.8), Room(0.2, 0.8), Amp(12.0)),
    Effects(Body(1.0, impulse=Impulse(noise(3 * RATE_HZ).astype(np.float64), RATE_HZ)), Room(1.0, 3.0)),
]


@pytest.mark.parametrize("effects", CHOICES, ids=range(len(CHOICES)))
def test_a_body_and_a_room_are_the_convolution_without_delay_after_the_amplifier(effects):
    """Up to the longest, of six seconds less a frame."""
    samples = noise(min(320_000, max(30_000, 2 * len(effects.impulse(RATE_HZ)))))
    np.testing.assert_allclose(through(effects, samples), apply(effects, samples), atol=1e-6)


def test_what_has_no_mix_is_left_out_and_all_rings_out_within_its_tail():
    samples = noise(5000)
    for effects in (None, Effects(), Effects(Body(0.0), Room(0.0), Amp(0.0))):
        np.testing.assert_array_equal(through(effects, samples), samples)
    np.testing.assert_array_equal(Effects().impulse(RATE_HZ), [[1.0]])
    both, room = (Effects(body, Room(0.2, 0.8)).impulse(RATE_HZ) for body in (Body(0.0), None))
    np.testing.assert_array_equal(both, room)
    assert (np.abs(room).argmax(0) == 0).all() and np.ptp(room[0]) < 0.01 * room[0].mean()  # the direct sound
    effects = Effects(Body(0.5), Room(0.5, 0.5))
    tail, found = round(effects.tail_s(RATE_HZ) * RATE_HZ), effects.impulse(RATE_HZ)
    assert found[tail - 2000 : tail].any() and np.abs(found[tail:]).max() < 1e-12


def test_a_mono_body_is_one_of_equal_sides():
    mono = np.random.default_rng(0).standard_normal((100, 1))
    for room in (None, Room(0.4, 0.5)):  # as wide behind it
        one, two = (Effects(Body(0.7, impulse=Impulse(each, RATE_HZ)), room) for each in (mono, mono.repeat(2, 1)))
        found = one.impulse(RATE_HZ)
        np.testing.assert_allclose(np.broadcast_to(found, (len(found), 2)), two.impulse(RATE_HZ), atol=1e-12)
        assert found.shape[1] == (1 if room is None else 2)


def way(frames: int, begin: int) -> Signal:
    """Of a fade that begins at a frame: the share of what is faded to, (frames, 1)."""
    share = np.clip((np.arange(frames) - begin + 1) / WINDOW, 0, 1)
    return (share * share * (3 - 2 * share))[:, None]


@pytest.mark.parametrize("at_frame", [WINDOW, 10_000, 10_048, 10_239])
def test_another_response_is_faded_to_and_what_was_played_rings_on(at_frame):
    samples, frames = noise(20_000), 30_000
    one, other = response(9000, 1, 3), response(12_000, 2, 4)
    mixer = mixer_with(one, samples)
    first = mixer.render(at_frame)
    mixer.set_effects(other)
    found = np.concatenate([first, mixer.render(frames - at_frame)])
    next_quantum = -(-at_frame // QUANTUM) * QUANTUM
    begin = -(-next_quantum // WINDOW) * WINDOW + WINDOW
    padded = np.pad(samples, ((0, frames - len(samples)), (0, 0)))
    before, after = apply(one, padded), apply(other, padded)
    np.testing.assert_allclose(found, before + (after - before) * way(frames, begin), atol=1e-6)


def test_effects_come_and_go_by_a_fade_and_leave_every_sample_as_it_was():
    samples, frames = noise(60_000), 60_000
    mixer = mixer_with(None, samples)
    first = mixer.render(1000)
    mixer.set_effects(response(3000))
    middle = mixer.render(29_000)
    mixer.set_effects(None)
    found = np.concatenate([first, middle, mixer.render(frames - 30_000)])
    begin = 1024  # the quantum after the first thousand frames
    heard = samples * way(frames, begin)  # the convolver was not there, and begins softly
    through = apply(response(3000), heard)
    # its windows are counted from when it came: 28 of them are over at frame 29 696, the next at 30 720
    share = way(frames, begin + WINDOW) - way(frames, begin + 30 * WINDOW)
    np.testing.assert_allclose(found, samples + (through - samples) * share, atol=1e-6)
    np.testing.assert_array_equal(found[: begin + WINDOW], samples[: begin + WINDOW])
    np.testing.assert_array_equal(found[begin + 31 * WINDOW :], samples[begin + 31 * WINDOW :])


def test_of_many_wishes_the_last_alone_is_heard_and_kept():
    samples = noise(60_000)
    mixer = mixer_with(response(500, 1, 0), samples)
    mixer.render(640)
    wished = [response(500, 1, seed) for seed in range(1, 9)]
    for each in wished:
        mixer.set_effects(each)
    assert len(mixer._impulses) <= 3  # in memory: heard, faded to, or wanted
    found = np.concatenate([mixer.render(WINDOW) for _ in range(10)])
    mixer.forget_ended()
    assert mixer.effects is wished[-1] and len(mixer._impulses) == 1
    expected = apply(mixer.effects, samples)[640 : 640 + len(found)]
    np.testing.assert_allclose(found[6 * WINDOW :], expected[6 * WINDOW :], atol=1e-6)


def test_after_the_end_there_is_silence_and_rest_and_then_it_begins_again():
    """At rest, other effects and none are there at once."""
    samples, effects, other = noise(5000), response(7000, 2), response(100, 1, 9)
    mixer = mixer_with(effects, samples)
    first = mixer.render(12_032)
    assert first[11_900:11_998].any()
    silence = mixer.render(40_000)
    assert np.abs(silence).max() < 1e-15 and not silence[10_000:].any()
    mixer.add(wet(samples))
    np.testing.assert_allclose(mixer.render(12_032), first, atol=1e-7)
    for exchanged in (other, None):
        mixer.render(40_000)
        mixer.set_effects(exchanged)
        mixer.render(64)
        mixer.add(wet(noise(640)))
        padded = np.pad(noise(640), ((0, 384), (0, 0)))
        np.testing.assert_allclose(mixer.render(1024), apply(exchanged, padded), atol=1e-6)
    mixer.forget_ended()
    assert len(mixer._impulses) == 0


@pytest.mark.parametrize("value", [np.nan, -np.inf, 1e9])
def test_what_is_no_sound_does_not_stay_in_it(value):
    samples, effects = noise(20_000), response(4000, 2)
    mixer = mixer_with(effects, samples)
    first = mixer.render(640)
    mixer.add(wet(np.full((64, 2), 0.3, np.float32), value))  # which gets past the voices' own guard
    found = np.concatenate([first, mixer.render(19_360)])
    assert 60 < mixer.non_finite < 1100
    heard = samples.copy()
    heard[640 : 640 + mixer.non_finite] = 0.0
    np.testing.assert_allclose(found, apply(effects, heard), atol=1e-6)


SIZE = 2**15
FULL_DB = 36.0


def tone(hz: float, peak: float, frames: int = 2 * SIZE, rate_hz: int = RATE_HZ) -> tuple[int, Signal]:
    """A sine (frames, 2) with a whole and odd number of periods in SIZE frames, and that number."""
    periods = round(hz / rate_hz * SIZE) | 1
    wave = peak * np.sin(2 * np.pi * periods * np.arange(frames) / SIZE)
    return periods, np.repeat(wave[:, None], 2, 1)


def amplified(sound: Signal, drive_db: float, tone_db: float = 0.0, level_db: float = 0.0, **rate: int) -> Signal:
    effects = Effects(amp=Amp(drive_db, tone_db), level_db=level_db)
    return through(effects, sound.astype(np.float32), **rate).astype(np.float64)


def spectrum(sound: Signal) -> Signal:
    """Peaks of the last SIZE frames, by periods in these."""
    return np.abs(np.fft.rfft(sound[-SIZE:, 0])) * 2 / SIZE


@pytest.mark.parametrize("drive_db", [6.0, 20.0, FULL_DB])
def test_harmonics_are_those_of_its_shape(drive_db):
    """By a sum over one period of x/√(1 + x²), which knows neither filters nor rates."""
    periods, sound = tone(1_000, 0.1)
    found = spectrum(amplified(sound, drive_db))
    hz = periods * RATE_HZ / SIZE
    mixer = np.zeros(1, MIXER)[0]
    amplifier.drive(mixer, drive_db, 0.0, 0.0)
    drive, gain = mixer["amplifier"]["wanted_drive"], mixer["amplifier"]["wanted_gain"]
    low = amplifier.COUPLING_HZ / hz
    angle = 2 * np.pi * np.arange(4096) / 4096
    x = amplifier.BIAS + drive * 0.1 / np.sqrt(1 + low**2) * np.sin(angle)
    expected = np.abs(np.fft.rfft(gain * x / np.sqrt(1 + x * x))) * 2 / 4096
    for harmonic in (1, 2, 3, 5):
        assert 20 * np.log10(found[harmonic * periods] / expected[harmonic]) == pytest.approx(0, abs=0.25), harmonic


@pytest.mark.parametrize("rate_hz", [44_100, 48_000, 96_000])
def test_aliases_of_5_khz_at_full_drive_are_80_db_below(rate_hz):
    periods, sound = tone(5_000, 1.0, rate_hz=rate_hz)
    found = spectrum(amplified(sound, FULL_DB, rate_hz=rate_hz))
    harmonic = np.zeros(len(found), bool)
    harmonic[::periods] = True
    assert found[3 * periods] > 0.2 * found[periods]  # it is driven hard
    assert 20 * np.log10(found[~harmonic].max() / found[periods]) < -80


@pytest.mark.parametrize("drive_db", [1.0, 12.0, FULL_DB])
def test_a_nominal_level_is_kept_another_changes_no_drive_and_tone_tilts(drive_db):
    _, sound = tone(1_000, amplifier.NOMINAL)
    found, gain = amplified(sound, drive_db, 3.0), 10 ** (6 / 20)
    plain = amplified(sound, drive_db)
    assert 20 * np.log10(plain[-SIZE:].std() / sound.std()) == pytest.approx(0, abs=3)
    louder = amplified(sound * gain, drive_db, 3.0, level_db=6.0)
    np.testing.assert_allclose(louder, found * gain, atol=1e-6)
    for hz, sign in ((100, -1), (6_000, 1)):
        plain, bright = (amplified(tone(hz, 0.01)[1], 1.0, each)[-SIZE:].std() for each in (0.0, 6.0))
        assert 20 * np.log10(bright / plain) == pytest.approx(sign * 6, abs=1.5)


def test_a_drive_of_0_leaves_every_sample_and_is_switched_without_a_click():
    sound = tone(200, 0.1, 64 * QUANTUM)[1].astype(np.float32)
    mixer, parts = mixer_with(Effects(amp=Amp()), sound), []
    for drive_db, quanta in ((0.0, 10), (6.0, 30), (0.0, 24)):
        mixer.set_effects(Effects(amp=Amp(drive_db)))
        parts.append(mixer.render(quanta * QUANTUM))
    found = np.concatenate(parts)
    assert np.abs(np.diff(found[:, 0])).max() < 1.6 * np.abs(np.diff(sound[:, 0])).max()
    for quantum, same in ((9, True), (30, False), (60, True)):
        frames = slice(quantum * QUANTUM, (quantum + 1) * QUANTUM)
        assert np.array_equal(found[frames], sound[frames]) == same


def test_through_the_amplifier_silence_stays_silence_after_what_was_driven():
    sound = np.concatenate([tone(200, 1.0, 4_800)[1], np.zeros((RATE_HZ, 2))])
    assert np.abs(amplified(sound, FULL_DB)[-2_400:]).max() < 1e-5

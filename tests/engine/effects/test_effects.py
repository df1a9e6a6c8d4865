"""Body, room and amplifier in the mixer: against SciPy, while they are exchanged, and with what is no sound."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from engine.effects import Body, Effects, Impulse
from engine.kernels import amplifier
from engine.kernels.constants import AHEAD, LOUDNESS_HIGH_HZ, LOUDNESS_LOW_HZ, QUANTUM
from engine.kernels.mixer_records import MIXER, WINDOW
from engine.values.effects import Amp, Room
from engine.voices import Mixer, Voice
from tests.engine.sounds import RATE_HZ, Samples, Signal, amplified, apply, noise, voice_of


def wet(samples: Samples, gain: float = 1.0) -> Voice:
    """A voice that sounds through the effects."""
    voice = voice_of(samples, gain)
    voice.sound_through_effects()
    return voice


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


EDGES = [1, 63, 64, 65, 2 * WINDOW - 1, 2 * WINDOW, 2 * WINDOW + 1, 3 * WINDOW, 3 * WINDOW + 1, 20_000]


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("frames", EDGES)
def test_it_is_the_convolution_without_delay(frames: int, channels: int) -> None:
    samples, effects = noise(30_000), response(frames, channels)
    found = mixer_with(effects, samples).render(30_000)
    np.testing.assert_allclose(found, apply(effects, samples, RATE_HZ), atol=1e-6)


@pytest.mark.parametrize("block", [1, 63, 64, 65, 4097])
def test_blocks_of_any_size_are_the_same_samples(block: int) -> None:
    samples, effects = noise(8000), response(5000, 2)
    whole, parts = mixer_with(effects, samples), mixer_with(effects, samples)
    found = np.concatenate([parts.render(min(block, 8000 - first)) for first in range(0, 8000, block)])
    np.testing.assert_array_equal(found, whole.render(8000))


def pink(frames: int) -> Samples:
    """Noise of equal power in each octave, (frames, 1)."""
    frequency_hz = np.fft.rfftfreq(frames, 1 / RATE_HZ)
    draw = np.random.default_rng(0).standard_normal((2, len(frequency_hz)))
    heard = (frequency_hz > LOUDNESS_LOW_HZ) & (frequency_hz < LOUDNESS_HIGH_HZ)
    spectrum = np.where(heard, (draw[0] + 1j * draw[1]) / np.sqrt(np.maximum(frequency_hz, 1)), 0)
    found = np.fft.irfft(spectrum, frames)[:, None]
    return (0.1 * found / found.std()).astype(np.float32)


LONGEST = Effects(Body(1.0, impulse=Impulse(noise(3 * RATE_HZ).astype(np.float64), RATE_HZ)), Room(1.0, 3.0))


@pytest.mark.parametrize(
    "effects",
    [
        Effects(Body()),
        Effects(Body(0.5, 0.7)),
        Effects(room=Room(0.3, 0.4)),
        Effects(Body(0.8), Room(0.2, 0.8)),
        Effects(amp=Amp(20.0)),
        Effects(Body(0.8), Room(0.2, 0.8), Amp(12.0)),
        LONGEST,
    ],
)
def test_a_body_a_room_and_an_amplifier_follow_one_another(effects: Effects) -> None:
    frames = 320_000 if effects is LONGEST else 60_000
    sound = pink(frames)
    assert len(LONGEST.impulse(RATE_HZ)) == 6 * RATE_HZ - 1
    found = mixer_with(effects, np.repeat(sound, 2, 1)).render(frames)
    np.testing.assert_allclose(found, apply(effects, sound, RATE_HZ), atol=1e-6)


@pytest.mark.parametrize("effects", [None, Effects(), Effects(Body(0.0), Room(0.0), Amp(0.0))])
def test_without_effects_every_sample_is_as_it_was_given(effects: Effects | None) -> None:
    samples = noise(5000)
    np.testing.assert_array_equal(mixer_with(effects, samples).render(5000), samples)


def test_what_has_no_mix_is_left_out_and_all_rings_out_within_its_tail() -> None:
    np.testing.assert_array_equal(Effects().impulse(RATE_HZ), [[1.0]])
    both, room = (Effects(body, Room(0.2, 0.8)).impulse(RATE_HZ) for body in (Body(0.0), None))
    np.testing.assert_array_equal(both, room)
    assert (np.abs(room).argmax(0) == 0).all() and np.ptp(room[0]) < 0.01 * room[0].mean()  # the direct sound
    effects = Effects(Body(0.5), Room(0.5, 0.5))
    tail, found = round(effects.tail_s(RATE_HZ) * RATE_HZ), effects.impulse(RATE_HZ)
    assert found[tail - 2000 : tail].any() and np.abs(found[tail:]).max() < 1e-12


@pytest.mark.parametrize("room", [None, Room(0.4, 0.5)])
def test_a_mono_body_is_one_whose_sides_are_the_same(room: Room | None) -> None:
    """A room is as wide behind it."""
    mono = np.random.default_rng(0).standard_normal((100, 1))
    one, two = (Effects(Body(0.7, impulse=Impulse(each, RATE_HZ)), room) for each in (mono, mono.repeat(2, 1)))
    found = one.impulse(RATE_HZ)
    np.testing.assert_allclose(np.broadcast_to(found, (len(found), 2)), two.impulse(RATE_HZ), atol=1e-12)
    assert found.shape[1] == (1 if room is None else 2)


def test_a_body_of_a_single_frame_is_heard_in_a_room() -> None:
    """Its balance of left and right, and its sign."""
    sample = np.array([[-1.0, 0.2]])
    both = (Impulse(samples, RATE_HZ) for samples in (sample, np.concatenate([sample, np.zeros((1, 2))])))
    found, expected = (Effects(Body(1.0, impulse=each), Room(0.2, 0.5)).impulse(RATE_HZ) for each in both)
    np.testing.assert_allclose(found, expected[: len(found)], atol=1e-9)
    assert found[0, 0] < 0 < found[0, 1]


def way(frames: int, begin: int) -> Signal:
    """Of a fade that begins at a frame: the share of what is faded to, (frames, 1)."""
    share = np.clip((np.arange(frames) - begin + 1) / WINDOW, 0, 1)
    return (share * share * (3 - 2 * share))[:, None]


@pytest.mark.parametrize("at_frame", [WINDOW, 10_000, 10_048, 10_239])
def test_another_response_is_faded_to_and_what_was_played_rings_on(at_frame: int) -> None:
    samples, frames = noise(20_000), 30_000
    one, other = response(9000, 1, 3), response(12_000, 2, 4)
    mixer = mixer_with(one, samples)
    first = mixer.render(at_frame)
    mixer.set_effects(other)
    found = np.concatenate([first, mixer.render(frames - at_frame)])
    next_quantum = -(-at_frame // QUANTUM) * QUANTUM
    begin = -(-next_quantum // WINDOW) * WINDOW + WINDOW
    padded = np.pad(samples, ((0, frames - len(samples)), (0, 0)))
    before, after = apply(one, padded, RATE_HZ), apply(other, padded, RATE_HZ)
    np.testing.assert_allclose(found, before + (after - before) * way(frames, begin), atol=1e-6)


def test_effects_come_and_go_by_a_fade_and_leave_every_sample_as_it_was() -> None:
    samples, frames = noise(60_000), 60_000
    mixer = mixer_with(None, samples)
    first = mixer.render(1000)
    mixer.set_effects(response(3000))
    middle = mixer.render(29_000)
    mixer.set_effects(None)
    found = np.concatenate([first, middle, mixer.render(frames - 30_000)])
    begin = 1024  # the quantum after the first thousand frames
    heard = samples * way(frames, begin)  # the convolver was not there, and begins softly
    through = apply(response(3000), heard, RATE_HZ)
    # its windows are counted from when it came: 28 of them are over at frame 29 696, the next at 30 720
    share = way(frames, begin + WINDOW) - way(frames, begin + 30 * WINDOW)
    np.testing.assert_allclose(found, samples + (through - samples) * share, atol=1e-6)
    np.testing.assert_array_equal(found[: begin + WINDOW], samples[: begin + WINDOW])
    np.testing.assert_array_equal(found[begin + 31 * WINDOW :], samples[begin + 31 * WINDOW :])


@pytest.mark.parametrize("sounding", [True, False])
def test_of_many_wishes_the_last_alone_is_heard_and_kept(sounding: bool) -> None:
    samples = noise(60_000)
    mixer = mixer_with(response(500, 1, 0), samples if sounding else None)
    mixer.render(640)
    impulses = [response(500, 1, seed).impulse(RATE_HZ) for seed in range(9)]
    for seed in range(1, 9):
        mixer.set_effects(response(500, 1, seed))
    assert len(mixer._impulses) <= 3  # in memory: heard, faded to, or wanted
    found = np.concatenate([mixer.render(WINDOW) for _ in range(10)])
    mixer.forget_ended()
    assert mixer.effects is not None and len(mixer._impulses) == 1
    np.testing.assert_array_equal(mixer.effects.impulse(RATE_HZ), impulses[-1])
    if sounding:
        expected = apply(mixer.effects, samples, RATE_HZ)[640 : 640 + len(found)]
        np.testing.assert_allclose(found[6 * WINDOW :], expected[6 * WINDOW :], atol=1e-6)


def test_after_the_end_there_is_silence_and_rest_and_then_it_begins_again() -> None:
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
        np.testing.assert_allclose(mixer.render(1024), apply(exchanged, padded, RATE_HZ), atol=1e-6)
    mixer.forget_ended()
    assert len(mixer._impulses) == 0


@pytest.mark.parametrize("gain", [1e-25, 1e-310])
def test_what_is_too_soft_to_be_sound_is_silence(gain: float) -> None:
    mixer = mixer_with(response(5000))
    mixer.add(wet(noise(40_000), gain))
    assert not mixer.render(20_000).any()


@pytest.mark.parametrize("value", [np.nan, -np.inf, 1e9])
def test_what_is_no_sound_does_not_stay_in_it(value: float) -> None:
    samples, effects = noise(20_000), response(4000, 2)
    mixer = mixer_with(effects, samples)
    first = mixer.render(640)
    mixer.add(wet(np.full((64, 2), 0.3, np.float32), value))  # which gets past the voices' own guard
    found = np.concatenate([first, mixer.render(19_360)])
    assert 60 < mixer.non_finite < 1100
    heard = samples.copy()
    heard[640 : 640 + mixer.non_finite] = 0.0
    np.testing.assert_allclose(found, apply(effects, heard, RATE_HZ), atol=1e-6)


def test_effects_are_exchanged_while_a_thread_renders() -> None:
    mixer = mixer_with(response(3000), noise(2 * RATE_HZ))
    over, found = threading.Event(), []

    def play() -> None:
        while not over.is_set():
            found.append(mixer.render(256))

    thread = threading.Thread(target=play)
    thread.start()
    choices = [response(3000, 2, seed) for seed in range(5)]
    for number in range(100):
        mixer.set_effects(choices[number % 5] if number % 11 else None)
        mixer.forget_ended()
    over.set()
    thread.join()
    assert np.isfinite(np.concatenate(found)).all() and np.abs(np.concatenate(found)).max() < 10


def test_volume_and_limiter_come_after_it_and_one_channel_is_the_mean_of_both() -> None:
    samples, effects = noise(20_000), response(2000, 2)
    expected = 0.25 * apply(effects, samples, RATE_HZ)
    for channels in (1, 2):
        mixer = Mixer(RATE_HZ, channels)
        mixer.set_effects(effects)
        mixer.set_volume(0.25)
        mixer.record["volume"] = 0.25
        mixer.add(wet(samples))
        found = mixer.render(20_000)
        assert mixer.take_reduction_db() == 0.0
        mean = expected.mean(1, keepdims=True) if channels == 1 else expected
        np.testing.assert_allclose(found[AHEAD:], mean[:-AHEAD], atol=1e-6)


SIZE = 2**15
FULL_DB = 36.0


def tone(hz: float, peak: float, frames: int = 2 * SIZE, rate_hz: int = RATE_HZ) -> tuple[int, Signal]:
    """A sine (frames, 2) with a whole and odd number of periods in SIZE frames, and that number."""
    periods = round(hz / rate_hz * SIZE) | 1
    wave = peak * np.sin(2 * np.pi * periods * np.arange(frames) / SIZE)
    return periods, np.repeat(wave[:, None], 2, 1)


def spectrum(sound: Signal) -> Signal:
    """Peaks of the last SIZE frames, by periods in these."""
    return np.abs(np.fft.rfft(sound[-SIZE:, 0])) * 2 / SIZE


@pytest.mark.parametrize("drive_db", [6.0, 20.0, FULL_DB])
def test_harmonics_are_those_of_its_shape(drive_db: float) -> None:
    """By a sum over one period of x/√(1 + x²), which knows neither filters nor rates."""
    periods, sound = tone(1_000, 0.1)
    found = spectrum(amplified(Amp(drive_db), sound, RATE_HZ))
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
def test_aliases_of_5_khz_at_full_drive_are_80_db_below(rate_hz: int) -> None:
    periods, sound = tone(5_000, 1.0, rate_hz=rate_hz)
    found = spectrum(amplified(Amp(FULL_DB), sound, rate_hz))
    harmonic = np.zeros(len(found), bool)
    harmonic[::periods] = True
    assert found[3 * periods] > 0.2 * found[periods]  # it is driven hard
    assert 20 * np.log10(found[~harmonic].max() / found[periods]) < -80


@pytest.mark.parametrize("drive_db", [1.0, 12.0, FULL_DB])
def test_a_tone_of_nominal_level_keeps_it_and_another_level_changes_no_drive(drive_db: float) -> None:
    _, sound = tone(1_000, amplifier.NOMINAL)
    found, gain = amplified(Amp(drive_db, 3.0), sound, RATE_HZ), 10 ** (6 / 20)
    plain = amplified(Amp(drive_db), sound, RATE_HZ)
    assert 20 * np.log10(plain[-SIZE:].std() / sound.std()) == pytest.approx(0, abs=3)
    louder = amplified(Amp(drive_db, 3.0), sound * gain, RATE_HZ, level_db=6.0)
    np.testing.assert_allclose(louder, found * gain, atol=1e-12)


def test_tone_raises_one_side_and_lowers_the_other() -> None:
    for hz, sign in ((100, -1), (6_000, 1)):
        _, sound = tone(hz, 0.01)
        plain, bright = (amplified(Amp(1.0, each), sound, RATE_HZ)[-SIZE:].std() for each in (0.0, 6.0))
        assert 20 * np.log10(bright / plain) == pytest.approx(sign * 6, abs=1.5)


def test_a_drive_of_0_leaves_every_sample_and_is_switched_without_a_click() -> None:
    _, sound = tone(200, 0.1, 64 * QUANTUM)
    np.testing.assert_array_equal(amplified(Amp(), sound, RATE_HZ), sound)
    mixer = np.zeros(1, MIXER)[0]
    mixer["rate_hz"] = RATE_HZ
    mix, found = mixer["mix"], []
    for number, first in enumerate(range(0, len(sound), QUANTUM)):
        amplifier.drive(mixer, 6.0 if 10 <= number < 40 else 0.0, 0.0, 0.0)
        mix[:] = sound[first : first + QUANTUM]
        amplifier.amplify(mixer)
        mixer["frames"] += QUANTUM
        found.append(mix.copy())
    whole = np.concatenate(found)[:, 0]
    assert np.abs(np.diff(whole)).max() < 1.6 * np.abs(np.diff(sound[:, 0])).max()
    assert not np.array_equal(whole[30 * QUANTUM : 31 * QUANTUM], sound[30 * QUANTUM : 31 * QUANTUM, 0])
    np.testing.assert_array_equal(whole[60 * QUANTUM :], sound[60 * QUANTUM :, 0])


def test_through_the_amplifier_silence_stays_silence_after_what_was_driven() -> None:
    sound = np.concatenate([tone(200, 1.0, 4_800)[1], np.zeros((RATE_HZ, 2))])
    found = amplified(Amp(FULL_DB), sound, RATE_HZ)
    assert np.abs(found[-2_400:]).max() < 1e-5

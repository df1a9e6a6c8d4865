"""Laws of the mixer: the same samples for any block size, no clicks, no surprises at the edges of a track."""

from collections.abc import Callable

import numpy as np
import pytest
from app.audio.limiter import CEILING
from app.audio.mixer import MOST_PLUCKS
from app.audio.strand import ATTACK_S, CROSS_FADE_S, DECLICK_S, RESUME_RESERVE_S

from app.audio import Levels, Mixer, Track

RATE_HZ = 48_000
TONE_HZ = 220.0
SECOND = RATE_HZ


def tone(seconds: float, peak: float = 0.5, phase: float = 0.0) -> np.ndarray:
    return peak * np.sin(2 * np.pi * TONE_HZ * np.arange(round(seconds * RATE_HZ)) / RATE_HZ + phase)


def make_track(seconds: float = 1.0, peak: float = 0.5, phase: float = 0.0) -> Track:
    """The truth is the model, a little louder and later, as it is in life."""
    model, truth = tone(seconds, peak, phase), tone(seconds, 1.2 * peak, phase + 0.3)
    track = Track(RATE_HZ, model.size, ("model", "truth"))
    track.append({"model": model, "truth": truth})
    return track


def playing(track: Track) -> Mixer:
    mixer = Mixer(RATE_HZ)
    mixer.load(track)
    mixer.play()
    return mixer


def mono(mixer: Mixer, frames: int) -> np.ndarray:
    block = mixer.next_block(frames)
    assert block.shape == (frames, 2)
    assert block.dtype == np.float32
    np.testing.assert_array_equal(block[:, 0], block[:, 1])
    return block[:, 0]


def frames(seconds: float) -> int:
    return round(seconds * RATE_HZ)


def level_db(samples: np.ndarray) -> float:
    return float(10 * np.log10(np.mean(np.square(samples, dtype=np.float64)) + 1e-30))


def click_db(samples: np.ndarray) -> float:
    """Energy above 5 kHz relative to all energy: the tone has none there, a step has plenty."""
    windowed = samples.astype(np.float64) * np.blackman(samples.size)
    energy = np.abs(np.fft.rfft(windowed)) ** 2
    above = np.fft.rfftfreq(samples.size, 1 / RATE_HZ) > 5000
    return float(10 * np.log10(energy[above].sum() / energy.sum()))


# What is played


def test_the_track_comes_out_as_it_is() -> None:
    track = make_track()
    out = mono(playing(track), SECOND)
    inner = slice(frames(ATTACK_S), SECOND - frames(DECLICK_S))
    np.testing.assert_array_equal(out[inner], track.read("model", 0, SECOND)[inner])


def test_nothing_sounds_before_play_or_without_a_track() -> None:
    mixer = Mixer(RATE_HZ)
    mixer.play()
    assert not mixer.status().playing
    mixer.load(make_track())
    assert not mono(mixer, 1000).any()
    assert mixer.status().position_frames == 0


def test_switching_the_source_keeps_the_position() -> None:
    track = make_track()
    mixer = playing(track)
    mono(mixer, 5000)
    mixer.select("truth")
    out = mono(mixer, 5000)
    fade = frames(CROSS_FADE_S)
    np.testing.assert_array_equal(out[fade:], track.read("truth", 5000 + fade, 10_000))
    assert mixer.status().source == "truth"


def test_a_switch_between_equal_sources_is_inaudible() -> None:
    same = tone(1.0)
    track = Track(RATE_HZ, SECOND, ("model", "truth"))
    track.append({"model": same, "truth": same})
    mixer = playing(track)
    mono(mixer, 5000)
    mixer.select("truth")
    # The gains of a cross-fade add up to one.
    np.testing.assert_allclose(mono(mixer, 5000), track.read("truth", 5000, 10_000), atol=1e-7)


def test_moving_the_listening_point_keeps_the_position() -> None:
    mixer = playing(make_track())
    mono(mixer, 5000)
    moved = make_track(phase=1.0)
    mixer.load(moved, keep_position=True)
    out = mono(mixer, 5000)
    fade = frames(CROSS_FADE_S)
    np.testing.assert_array_equal(out[fade:], moved.read("model", 5000 + fade, 10_000))


def test_the_old_listening_point_sounds_until_the_new_one_is_rendered() -> None:
    old = make_track()
    mixer = playing(old)
    mono(mixer, 5000)
    new = Track(RATE_HZ, SECOND, ("model", "truth"))
    mixer.load(new, keep_position=True)
    np.testing.assert_array_equal(mono(mixer, 5000), old.read("model", 5000, 10_000))
    samples = tone(1.0, phase=1.0)
    new.append({"model": samples, "truth": samples})
    np.testing.assert_array_equal(mono(mixer, 5000)[2000:], new.read("model", 12_000, 15_000))


def test_a_new_pluck_starts_at_the_beginning_and_ends_the_old_sound_soon() -> None:
    mixer = playing(make_track())
    mono(mixer, 5000)
    new = make_track(phase=1.0)
    mixer.load(new)
    out = mono(mixer, 5000)
    old_sound = frames(0.015)
    np.testing.assert_array_equal(out[old_sound:], new.read("model", old_sound, 5000))


def test_a_stopped_mixer_stays_stopped_when_a_track_is_loaded() -> None:
    mixer = Mixer(RATE_HZ)
    mixer.load(make_track())
    mixer.seek(0.5)
    mixer.load(make_track(), keep_position=True)
    assert not mono(mixer, 100).any()
    assert mixer.status().position_frames == SECOND // 2
    mixer.load(make_track())
    assert mixer.status().position_frames == 0


def test_seek_goes_there_and_stays_within_the_track() -> None:
    track = make_track()
    mixer = playing(track)
    mono(mixer, 1000)
    mixer.seek(0.5)
    out = mono(mixer, 5000)
    fade = frames(CROSS_FADE_S)
    np.testing.assert_array_equal(out[fade:], track.read("model", 24_000 + fade, 29_000))
    mixer.seek(-3)
    assert mixer.status().position_frames == 0
    mixer.seek(99)
    assert mixer.status().position_frames == SECOND


def test_stop_fades_quickly_and_play_goes_on_from_there() -> None:
    track = make_track()
    mixer = playing(track)
    mono(mixer, 5000)
    mixer.stop()
    out = mono(mixer, 1000)
    assert not out[frames(DECLICK_S) :].any()
    assert mixer.status().position_frames == 5000
    mixer.play()
    out = mono(mixer, 1000)
    np.testing.assert_array_equal(out[frames(DECLICK_S) :], track.read("model", 5384, 6000))


def test_at_the_end_it_stops_by_itself_and_play_starts_over() -> None:
    mixer = playing(make_track(0.1))
    out = mono(mixer, SECOND)
    assert not out[frames(0.1) :].any()
    status = mixer.status()
    assert not status.playing
    assert status.position_frames == frames(0.1)
    mixer.play()
    np.testing.assert_array_equal(mono(mixer, SECOND), out)


def test_a_loop_has_exactly_the_length_of_the_track() -> None:
    mixer = playing(make_track(0.1))
    mixer.set_loop(True)
    out = mono(mixer, frames(0.5))
    for start in range(frames(0.1), frames(0.5), frames(0.1)):
        np.testing.assert_allclose(out[start : start + frames(0.1)], out[: frames(0.1)], atol=1e-7)
    mixer.set_loop(False)
    mono(mixer, frames(0.2))
    assert not mixer.status().playing


@pytest.mark.parametrize("length_frames", [0, 1, 100])
def test_tracks_shorter_than_a_fade(length_frames: int) -> None:
    track = Track(RATE_HZ, length_frames, ("model",))
    if length_frames:
        track.append({"model": np.full(length_frames, 0.5)})
    mixer = playing(track)
    mixer.set_loop(True)
    assert np.abs(mono(mixer, 1000)).max() <= 0.5
    mixer.set_loop(False)
    mono(mixer, 1000)
    assert not mixer.status().playing


@pytest.mark.parametrize("event", ["stop", "seek", "select", "load"])
def test_a_change_right_where_the_track_has_ended(event: str) -> None:
    """The block ends with the track: its voice has faded out, and has nothing left that could fade."""
    mixer = playing(make_track(0.1))
    mono(mixer, frames(0.1))
    {
        "stop": mixer.stop,
        "seek": lambda: mixer.seek(0.05),
        "select": lambda: mixer.select("truth"),
        "load": lambda: mixer.load(make_track(0.1), ring=True),
    }[event]()
    mono(mixer, 256)
    mono(mixer, frames(0.2))
    assert not mixer.status().playing


def test_unknown_sources_and_wrong_rates_are_refused() -> None:
    mixer = playing(make_track())
    with pytest.raises(ValueError, match=r"no source 'physics', only \('model', 'truth'\)"):
        mixer.select("physics")
    with pytest.raises(ValueError, match="44100 Hz"):
        mixer.load(Track(44_100, 10, ("model",)))


def test_a_track_without_the_chosen_source_plays_its_first() -> None:
    mixer = Mixer(RATE_HZ)
    mixer.select("truth")
    lone = Track(RATE_HZ, 10, ("model",))
    mixer.load(lone)
    assert mixer.status().source == "model"
    mixer.load(make_track())
    assert mixer.status().source == "truth"


# Any splitting into blocks


def perform(mixer: Mixer, block_frames: int) -> np.ndarray:
    """A session of commands at fixed frames, rendered in blocks of at most `block_frames`."""
    other = make_track(0.6, peak=0.7, phase=1.0)
    commands: list[tuple[int, Callable[[], None]]] = [
        (500, lambda: mixer.select("truth")),
        (700, lambda: mixer.select("model")),  # within the cross-fade
        (1500, lambda: mixer.set_volume_db(6.0)),  # into the limiter
        (2500, lambda: mixer.load(other, keep_position=True)),
        (3600, lambda: mixer.seek(0.01)),
        (4600, mixer.stop),
        (4700, mixer.play),
        (5200, lambda: mixer.load(make_track(0.02))),
        (5201, lambda: mixer.set_loop(True)),
        (7000, lambda: mixer.set_loop(False)),
        (8000, lambda: None),
    ]
    out = []
    position = 0
    for at, command in commands:
        while position < at:
            count = min(block_frames, at - position)
            out.append(mono(mixer, count))
            position += count
        command()
    return np.concatenate(out)


@pytest.mark.parametrize("block_frames", [1, 64, 65, 8193])
def test_any_splitting_gives_the_same_samples(block_frames: int) -> None:
    whole = perform(playing(make_track()), 100_000)
    split = perform(playing(make_track()), block_frames)
    assert level_db(whole) > -10
    np.testing.assert_allclose(split, whole, atol=1e-6)


def test_a_copy_goes_its_own_way_from_the_same_state() -> None:
    """Between all commands of a session, blocks are mixed with a copy, which other commands then change."""

    class Wandering(Mixer):
        def next_block(self, frames: int) -> np.ndarray:
            copy = Mixer.copied(self)
            ahead = Mixer.next_block(copy, frames)
            copy.select("truth")
            copy.set_volume_db(-20.0)
            copy.seek(0.3)
            copy.load(make_track(0.1, peak=0.3), ring=True)
            Mixer.next_block(copy, frames)
            own = super().next_block(frames)
            np.testing.assert_array_equal(own, ahead)
            return own

    mixers = [Mixer(RATE_HZ), Wandering(RATE_HZ)]
    for mixer in mixers:
        mixer.load(make_track())
        mixer.play()
    expected, found = (perform(mixer, 64) for mixer in mixers)
    np.testing.assert_array_equal(found, expected)


def test_it_is_steady_where_no_rendering_can_change_what_comes() -> None:
    assert Mixer(RATE_HZ).steady(1000)
    track = Track(RATE_HZ, SECOND, ("model", "truth"))
    mixer = playing(track)
    assert not mixer.steady(1), "it waits for the first samples"
    track.append({"model": tone(0.5), "truth": tone(0.5)})
    mono(mixer, 100)
    fade = frames(DECLICK_S)
    assert mixer.steady(SECOND // 2 - 100 - fade)
    assert not mixer.steady(SECOND // 2 - 100 - fade + 1), "it may run dry"
    point = Track(RATE_HZ, SECOND, ("model", "truth"))
    mixer.load(point, keep_position=True)
    assert not mixer.steady(1), "another listening point takes over once it is rendered"
    point.append({"model": tone(0.5), "truth": tone(0.5)})
    assert mixer.steady(1)
    mono(mixer, 1)
    mixer.load(make_track(), keep_position=True)
    assert mixer.steady(10 * SECOND)
    mono(mixer, 1)
    assert mixer.steady(10 * SECOND)
    plucked_again(mixer, Track(RATE_HZ, SECOND, ("model", "truth")))
    assert not mixer.steady(1)
    mixer.stop()
    assert mixer.steady(SECOND)


# No clicks


def starve(mixer: Mixer) -> None:
    """Leaves the playing mixer with a track of which only a little more is rendered."""
    samples = tone(1.0)[: mixer.position_frames + frames(0.1)]
    track = Track(RATE_HZ, SECOND, ("model", "truth"))
    track.append({"model": samples, "truth": samples})
    mixer.load(track, keep_position=True)


EVENTS: dict[str, Callable[[Mixer], None]] = {
    "nothing": lambda mixer: None,
    "source": lambda mixer: mixer.select("truth"),
    "listening point": lambda mixer: mixer.load(make_track(phase=2.0), keep_position=True),
    "new pluck": lambda mixer: mixer.load(make_track(phase=0.1)),
    "seek": lambda mixer: mixer.seek(0.7123),
    "loop": lambda mixer: mixer.load(make_track(0.3003)),
    "stop": Mixer.stop,
    "starved": starve,
    "volume": lambda mixer: mixer.set_volume_db(-20),
    "mute": lambda mixer: mixer.set_volume_db(-np.inf),
}


@pytest.mark.parametrize("event", EVENTS)
def test_nothing_clicks(event: str) -> None:
    mixer = playing(make_track())
    mixer.set_loop(True)
    before = mono(mixer, frames(0.3) + 17)
    EVENTS[event](mixer)
    after = mono(mixer, frames(0.4))
    assert click_db(np.concatenate([before, after])) < -90


def test_the_measure_of_clicks_hears_a_hard_cut() -> None:
    out = tone(0.7)
    out[frames(0.35) + 17 :] = 0
    assert click_db(out) > -50


def test_the_end_of_a_track_that_is_not_silent_does_not_click() -> None:
    assert click_db(mono(playing(make_track(0.5003)), frames(0.8))) < -90


# When rendering is slower than the sound


def test_the_playhead_waits_for_rendering_and_goes_on_where_it_stopped() -> None:
    samples = tone(1.0)
    track = Track(RATE_HZ, SECOND, ("model",))
    mixer = playing(track)
    assert not mono(mixer, 1000).any()
    assert mixer.status().waiting
    assert mixer.status().position_frames == 0

    first = frames(0.3)
    track.append({"model": samples[:first]})
    out = mono(mixer, frames(0.4))
    status = mixer.status()
    assert status.waiting
    assert status.playing
    assert status.position_frames == first
    np.testing.assert_array_equal(out[: first - 384][96:], track.read("model", 96, first - 384))
    assert not out[first:].any()

    track.append({"model": samples[first : first + frames(RESUME_RESERVE_S) - 1]})
    assert not mono(mixer, 1000).any(), "it must not stutter on for a few samples"
    track.append({"model": samples[first + frames(RESUME_RESERVE_S) - 1 :]})
    out = mono(mixer, frames(0.3))
    assert not mixer.status().waiting
    np.testing.assert_array_equal(out[384:], track.read("model", first + 384, first + frames(0.3)))


def test_a_render_that_ends_early_ends_the_track() -> None:
    track = Track(RATE_HZ, SECOND, ("model",))
    mixer = playing(track)
    track.append({"model": tone(0.2)})
    mono(mixer, frames(0.3))
    assert mixer.status().waiting
    track.finish()
    mono(mixer, 1)
    assert not mixer.status().playing


# Level and safety


def test_the_volume_arrives_at_its_level_without_steps() -> None:
    mixer = playing(make_track(peak=0.1))
    unchanged = mono(mixer, 5000)
    mixer.set_volume_db(6.0)
    mono(mixer, 10_000)
    louder = mono(mixer, 24_000)
    expected = make_track(peak=0.1).read("model", 15_000, 39_000)
    np.testing.assert_allclose(louder, expected * 10**0.3, rtol=1e-5)
    assert level_db(unchanged) < level_db(louder) - 5.5
    for wrong in (np.nan, np.inf):
        with pytest.raises(ValueError, match="volume"):
            mixer.set_volume_db(wrong)


@pytest.mark.parametrize("peak", [0.99, 2.0, 1e4, 1e38])
def test_the_ceiling_is_never_passed(peak: float) -> None:
    mixer = playing(make_track(peak=peak / 1.2))
    mixer.select("truth")
    assert np.abs(mono(mixer, SECOND // 2)).max() <= np.float32(CEILING)
    assert mixer.status().limiting
    assert mixer.status().gain_reduction_db > 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_never_leaves(value: float, monkeypatch: pytest.MonkeyPatch) -> None:
    track = make_track()
    broken = tone(1.0).astype(np.float32)
    broken[6000:6100] = value
    monkeypatch.setattr(track, "read", lambda source, start, stop: broken[start:stop])
    mixer = playing(track)
    mono(mixer, 5000)
    assert not mixer.status().non_finite
    out = mono(mixer, 5000)
    assert np.isfinite(out).all()
    assert not out[1000:1100].any()
    np.testing.assert_array_equal(out[1100:], broken[6100:10_000])
    assert mixer.status().non_finite
    mixer.load(make_track())
    assert not mixer.status().non_finite


def test_the_meter_shows_the_peak_and_falls() -> None:
    mixer = playing(make_track(0.5, peak=0.5))
    assert mixer.status().peak_db == -120
    mono(mixer, SECOND // 2 - frames(DECLICK_S))
    assert mixer.status().peak_db == pytest.approx(20 * np.log10(0.5), abs=0.1)
    mono(mixer, SECOND + frames(DECLICK_S))
    assert mixer.status().peak_db == pytest.approx(20 * np.log10(0.5) - 20, abs=0.2)


# Plucks that ring on


def plucked_again(mixer: Mixer, track: Track) -> None:
    mixer.load(track, ring=True)
    mixer.play()


def test_a_new_pluck_sounds_beside_the_last_which_rings_to_its_end() -> None:
    first, second = make_track(0.5, peak=0.2), make_track(1.0, peak=0.2, phase=1.0)
    mixer = playing(first)
    mono(mixer, 5000)
    plucked_again(mixer, second)
    assert mixer.status().position_frames == 0
    out = mono(mixer, SECOND)
    until = frames(0.5) - frames(DECLICK_S) - 5000
    attack = frames(ATTACK_S)
    both = first.read("model", 5000, SECOND)[:until].astype(np.float64) + second.read("model", 0, until)
    np.testing.assert_allclose(out[attack:until], both[attack:], atol=1e-7)
    alone = slice(frames(0.5) - 5000, SECOND - frames(DECLICK_S))
    np.testing.assert_array_equal(out[alone], second.read("model", alone.start, alone.stop))


def test_the_same_track_plucked_again_rings_beside_itself() -> None:
    track = make_track(0.5, peak=0.2)
    mixer = playing(track)
    mono(mixer, 5000)
    plucked_again(mixer, track)
    out = mono(mixer, 10_000)
    both = track.read("model", 5000, 15_000).astype(np.float64) + track.read("model", 0, 10_000)
    np.testing.assert_allclose(out[frames(ATTACK_S) :], both[frames(ATTACK_S) :], atol=1e-7)


def test_too_many_plucks_fade_the_oldest() -> None:
    mixer = playing(make_track(peak=0.01))
    for _ in range(MOST_PLUCKS + 3):
        mono(mixer, 500)
        plucked_again(mixer, make_track(peak=0.01))
    assert mixer.status().ringing == MOST_PLUCKS - 1
    mono(mixer, 2 * SECOND)
    assert mixer.status().ringing == 0


def test_stop_and_seek_end_what_rings() -> None:
    for end in (Mixer.stop, lambda mixer: mixer.seek(0.9)):
        mixer = playing(make_track(peak=0.2))
        mono(mixer, 5000)
        track = make_track(peak=0.2, phase=1.0)
        plucked_again(mixer, track)
        mono(mixer, 5000)
        end(mixer)
        out = mono(mixer, 2000)
        start = mixer.status().position_frames - 2000
        rest = track.read("model", start, start + 2000) if mixer.status().playing else np.zeros(2000)
        np.testing.assert_array_equal(out[frames(CROSS_FADE_S) :], rest[frames(CROSS_FADE_S) :])
        assert mixer.status().ringing == 0


def test_a_switch_reaches_what_rings_and_the_loop_does_not() -> None:
    first, second = make_track(0.3, peak=0.2), make_track(0.4, peak=0.2, phase=1.0)
    mixer = playing(first)
    mixer.set_loop(True)
    mono(mixer, 2000)
    plucked_again(mixer, second)
    mono(mixer, 2000)
    mixer.select("truth")
    out = mono(mixer, 4000)[frames(CROSS_FADE_S) :]
    fade = frames(CROSS_FADE_S)
    both = first.read("truth", 4000 + fade, 8000).astype(np.float64) + second.read("truth", 2000 + fade, 6000)
    np.testing.assert_allclose(out, both, atol=1e-7)
    out = mono(mixer, SECOND)
    assert mixer.status().ringing == 0
    assert mixer.status().playing
    np.testing.assert_array_equal(out[-100:], second.read("truth", 0, SECOND)[mixer.position_frames - 100 :][:100])


def test_a_replaced_track_does_not_ring_and_leaves_what_rings_alone() -> None:
    first, second, third = (make_track(1.0, 0.2, phase) for phase in (0.0, 1.0, 2.0))
    mixer = playing(first)
    mono(mixer, 1000)
    plucked_again(mixer, second)
    mono(mixer, 1000)
    mixer.load(third)
    out = mono(mixer, 3000)[1000:]
    both = first.read("model", 3000, 5000).astype(np.float64) + third.read("model", 1000, 3000)
    np.testing.assert_allclose(out, both, atol=1e-7)


def test_a_pluck_that_waits_for_its_rendering_rings_too() -> None:
    late = Track(RATE_HZ, SECOND, ("model", "truth"))
    mixer = playing(late)
    mono(mixer, 100)
    plucked_again(mixer, make_track(peak=0.2))
    mono(mixer, 1000)
    samples = tone(1.0, 0.2, 1.0)
    late.append({"model": samples, "truth": samples})
    out = mono(mixer, 5000)[200:]
    both = make_track(peak=0.2).read("model", 1200, 6000).astype(np.float64) + samples[200:5000].astype(np.float32)
    np.testing.assert_allclose(out, both, atol=1e-7)


@pytest.mark.parametrize("block_frames", [1, 65])
def test_any_splitting_gives_the_same_plucks(block_frames: int) -> None:
    def perform(size: int) -> np.ndarray:
        mixer, out = playing(make_track(0.02)), []
        for count in (300, 400, 500, 2000):
            out += [mono(mixer, min(size, count - k)) for k in range(0, count, size)]
            plucked_again(mixer, make_track(0.02, phase=count))
        return np.concatenate(out)

    np.testing.assert_allclose(perform(block_frames), perform(100_000), atol=1e-6)


@pytest.mark.parametrize("event", ["source", "stop", "new pluck"])
def test_nothing_clicks_while_plucks_ring(event: str) -> None:
    mixer = playing(make_track(2.0, 0.2))
    mono(mixer, 3000)
    mixer.load(make_track(2.0, 0.2, phase=0.1), ring=True)
    before = mono(mixer, frames(0.3) + 17)
    if event == "new pluck":
        mixer.load(make_track(2.0, 0.2), ring=True)  # a sine begins at zero: its attack is no click
    else:
        EVENTS[event](mixer)
    after = mono(mixer, frames(0.4))
    assert click_db(np.concatenate([before[frames(0.1) :], after])) < -80


# Stereo and levels


def make_stereo_track(peak: float = 0.4) -> Track:
    track = Track(RATE_HZ, SECOND, ("model", "truth"), channels=2)
    both = np.stack([tone(1.0, peak), tone(1.0, peak / 2, 1.0)], axis=1)
    track.append({"model": both, "truth": both[:, ::-1]})
    return track


def test_a_stereo_track_keeps_its_sides_beside_a_mono_one_in_the_middle() -> None:
    stereo, middle = make_stereo_track(), make_track(peak=0.1)
    mixer = playing(stereo)
    out = mixer.next_block(5000)
    np.testing.assert_array_equal(out[100:], stereo.read("model", 100, 5000))
    mixer.load(middle, ring=True)
    out = mixer.next_block(5000)[200:]
    sum_of_both = stereo.read("model", 5200, 10_000) + middle.read("model", 200, 5000)[:, np.newaxis]
    np.testing.assert_allclose(out, sum_of_both, atol=1e-6)


def test_from_stereo_to_mono_and_back_nothing_clicks() -> None:
    mixer = playing(make_stereo_track())
    parts = [mixer.next_block(frames(0.2))]
    mixer.load(make_track(peak=0.4), keep_position=True)
    parts.append(mixer.next_block(frames(0.2)))
    mixer.load(make_stereo_track(), keep_position=True)
    parts.append(mixer.next_block(frames(0.2)))
    for side in np.concatenate(parts).T:
        assert click_db(side) < -90


def test_the_limiter_keeps_the_sides_in_proportion() -> None:
    out = playing(make_stereo_track(peak=4.0)).next_block(SECOND // 2)[1000:]
    expected = make_stereo_track(peak=4.0).read("model", 1000, SECOND // 2)
    loud = np.abs(expected).min(axis=1) > 0.05
    np.testing.assert_allclose((out[:, 0] / out[:, 1])[loud], (expected[:, 0] / expected[:, 1])[loud], rtol=1e-4)


def test_levels_are_matched_and_gains_stated() -> None:
    track = make_track(peak=0.1)
    mixer = playing(track)
    mixer.set_levels(Levels(matched=True, gains_db={"truth": 6.0}))
    np.testing.assert_array_equal(mono(mixer, 5000)[100:], track.read("model", 100, 5000))  # not known yet
    track.set_match_gains({"model": 0.5})
    parts = [mono(mixer, frames(0.3))]
    np.testing.assert_allclose(parts[0][-100:], 0.5 * track.read("model", 19_300, 19_400), atol=1e-6)
    mixer.select("truth")
    parts.append(mono(mixer, frames(0.2)))
    np.testing.assert_allclose(parts[1][-100:], 10**0.3 * track.read("truth", 28_900, 29_000), atol=1e-6)
    mixer.set_levels(Levels())
    parts.append(mono(mixer, frames(0.2)))
    np.testing.assert_allclose(parts[2][-100:], track.read("truth", 38_500, 38_600), atol=1e-6)
    assert click_db(np.concatenate(parts)) < -90


def test_a_reduction_anywhere_in_a_block_is_told() -> None:
    track = Track(RATE_HZ, SECOND, ("model", "truth"))
    samples = np.zeros(SECOND)
    samples[frames(ATTACK_S) + 10] = 3.0  # by the end of the block the limiter has let go of all of it
    track.append({"model": samples, "truth": samples})
    mixer = playing(track)
    mono(mixer, frames(0.3))
    assert mixer.status().gain_reduction_db == pytest.approx(20 * np.log10(3.0) + 0.3, abs=0.01)
    mono(mixer, frames(0.3))
    assert not mixer.status().limiting

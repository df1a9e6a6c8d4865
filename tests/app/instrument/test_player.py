"""The sound of a player's gestures: everything is measured on rendered sound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, sosfilt

from app.instrument.compiled import InstrumentPlayer
from app.instrument.events import (
    MOD_WHEEL,
    SOUND_OFF,
    SUSTAIN,
    Bend,
    Controller,
    Event,
    NoteOff,
    NoteOn,
    PatchTurned,
    TimedEvent,
)
from app.instrument.offline import BLOCK_FRAMES, SILENT_DB, OfflinePlayer, channels_played, render_events, render_note
from app.instrument.strings import Strings
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.patches.patch import WHEEL, Body, Damping, Fretted, Knobs, Patch, Pickup, PluckChoices
from engine import bounds
from engine.excitation import blow_factor
from engine.kernels import constants as of
from engine.kernels.constants import QUANTUM, WANTED_DB
from engine.kernels.loudness import k_weight
from engine.kernels.playing.notes import PLUCK_STOPS_S
from engine.kernels.pulses import spectrum
from engine.levels import FULL_SCALE_M
from engine.presets import Preset, load_preset
from engine.presets.finding import SHIPPED
from engine.resonators.string import resonator_of
from engine.values.ear import Ear
from engine.values.effects import Room
from engine.values.string import StringParameters
from engine.voices import Mixer, Voice, plain_program
from engine.voices.ear import weights_of
from engine.voices.player import Report
from tests.app.instrument.seen import Seen, seen, sounding, taken_up

RATE_HZ = 48_000
STEEL = StringParameters(0.65, 5e-7, 2e-14, 7850.0, 2e11, 4e-4, 4e-7, 75.0)


def changed(patch: Patch, **parts: object) -> Patch:
    return Patch.model_validate({**dict(patch), **parts})


def play(
    patch: Patch, preset: Preset, seconds: float, *events: tuple[float, Event], source: str = "model"
) -> NDArray[np.float64]:
    timed = [TimedEvent(time_s, event) for time_s, event in events]
    blocks = list(render_events(patch, preset, timed, RATE_HZ, source, seconds, limited=False))
    return np.concatenate(blocks)[:, 0].astype(np.float64)


class Stage:
    """A patch that is played without a device; what was struck is seen as well as heard."""

    def __init__(self, patch: Patch, preset: Preset, sources: tuple[str, ...] = ("model",)) -> None:
        self.mixer = Mixer(RATE_HZ, limited=False)
        self.player = InstrumentPlayer(patch, preset, RATE_HZ, dict.fromkeys(sources, 1.0), varied=False)
        self.mixer.set_player(self.player.compiled)

    def play(self, *played: Event) -> list[Seen]:
        """What rings then, the oldest first."""
        for event in played:
            self.player.handle(event)
        return taken_up(self.player, self.mixer)

    def take(self, patch: Patch) -> None:
        """Another patch, or the same with a knob turned."""
        self.player.take(self.player.tabled(self.player.keys_of(patch)))

    def render(self, frames: int) -> NDArray[np.float64]:
        """(frames,), left."""
        return self.mixer.render(frames)[:, 0].astype(np.float64)

    def begun(self) -> list[Report]:
        return [each for each in self.player.reports() if each.kind == of.BEGAN]


def level_db(sound: NDArray[np.float64], begin_s: float, end_s: float) -> float:
    part = sound[round(begin_s * RATE_HZ) : round(end_s * RATE_HZ)]
    return float(20 * np.log10(max(np.sqrt(np.mean(part**2)), 1e-12)))


def pitch_hz(sound: NDArray[np.float64], near_hz: float, begin_s: float = 0.1, end_s: float = 1.0) -> float:
    """Of the partial near a frequency, by the phase of two windows."""
    part = sound[round(begin_s * RATE_HZ) : round(end_s * RATE_HZ)]
    padded = 2**20
    spectrum = np.abs(np.fft.rfft(part * np.hanning(len(part)), padded))
    low, high = (int(near_hz * factor * padded / RATE_HZ) for factor in (0.97, 1.03))
    peak = low + int(spectrum[low:high].argmax())
    left, middle, right = np.log(spectrum[peak - 1 : peak + 2])
    return float((peak + 0.5 * (left - right) / (left - 2 * middle + right)) * RATE_HZ / padded)


def cents(one_hz: float, other_hz: float) -> float:
    return float(1200 * np.log2(one_hz / other_hz))


@pytest.mark.parametrize("key", [28, 40, 57, 69, 81, 88])
@pytest.mark.parametrize("source", ["model", "truth"])
def test_quiet_keys_are_in_tune_to_half_a_cent(patch: Patch, preset: Preset, key: int, source: str) -> None:
    wanted_hz = 440 * 2 ** ((key - 69) / 12)
    sound = render_note(patch, preset, key, 8, 2.0, 1.2, RATE_HZ, source)[:, 0].astype(np.float64)
    assert abs(cents(pitch_hz(sound, wanted_hz), wanted_hz)) < 0.5


def test_keys_are_equally_loud_within_three_decibels(patch: Patch, preset: Preset) -> None:
    levels = []
    for key in range(28, 89, 6):
        sound = render_note(patch, preset, key, 100, 2.0, 0.4, RATE_HZ)[:, 0].astype(np.float64)
        spectrum = np.abs(np.fft.rfft(sound)) ** 2
        weighted = (spectrum * k_weight(np.fft.rfftfreq(len(sound), 1 / RATE_HZ))).sum()
        levels.append(10 * np.log10(2 * weighted / len(sound) ** 2))
    assert max(levels) - min(levels) < 3
    assert float(np.mean(levels)) == pytest.approx(WANTED_DB, abs=3)


def test_velocity_is_level_and_timbre(patch: Patch, preset: Preset) -> None:
    soft, hard = (play(patch, preset, 0.5, (0.0, NoteOn(45, velocity))) for velocity in (20, 127))
    assert level_db(hard, 0, 0.5) - level_db(soft, 0, 0.5) > 12
    shapes = [np.abs(np.fft.rfft(sound)) / np.linalg.norm(sound) for sound in (soft, hard)]
    assert np.linalg.norm(shapes[0] - shapes[1]) / np.linalg.norm(shapes[0]) > 0.3


def brightness_hz(sound: NDArray[np.float64]) -> float:
    """The centre of its spectrum."""
    spectrum = np.abs(np.fft.rfft(sound)) ** 2
    return float((spectrum * np.fft.rfftfreq(len(sound), 1 / RATE_HZ)).sum() / spectrum.sum())


@pytest.mark.parametrize("source", ["model", "truth"])
@pytest.mark.parametrize(("shape", "wide", "narrow"), [("raised_cosine", 0.3, 0.08), ("gaussian", 0.08, 0.04)])
def test_a_harder_key_is_narrower_and_brighter_however_far_it_pulls(
    patch: Patch, preset: Preset, shape: str, wide: float, narrow: float, source: str
) -> None:
    widths = {"width": wide, "width_hard": narrow, "softest_mm": 0.1, "hardest_mm": 0.1}
    shaped = changed(patch, pluck=PluckChoices(shape=shape, **widths))
    stage = Stage(shaped, preset, (source,))
    stage.play(*(NoteOn(45, velocity) for velocity in (1, 64, 127)))
    assert [each.width for each in stage.begun()] == pytest.approx([wide, (wide * narrow) ** 0.5, narrow])
    heard_hz = [brightness_hz(play(shaped, preset, 0.3, (0.0, NoteOn(45, v)), source=source)) for v in (1, 64, 127)]
    assert heard_hz[0] < heard_hz[1] < heard_hz[2]
    assert heard_hz[2] > 1.3 * heard_hz[0]
    triangle = changed(patch, pluck=PluckChoices(shape="triangular", **widths))
    soft, hard = (play(triangle, preset, 0.3, (0.0, NoteOn(45, velocity)), source=source) for velocity in (1, 127))
    np.testing.assert_array_equal(soft, hard)  # it has no width


def test_letting_go_damps_and_the_pedal_holds(patch: Patch, preset: Preset) -> None:
    on, off = (0.0, NoteOn(57, 90)), (0.3, NoteOff(57))
    held = play(patch, preset, 1.2, on)
    damped = play(patch, preset, 1.2, on, off)
    pedal = play(patch, preset, 1.2, (0.0, Controller(SUSTAIN, 127)), on, off, (0.8, Controller(SUSTAIN, 0)))
    np.testing.assert_array_equal(held[:14_000], damped[:14_000])
    assert level_db(damped, 0.5, 0.6) < level_db(held, 0.5, 0.6) - 50  # 60 dB in 0.15 s
    np.testing.assert_array_equal(held[:38_000], pedal[:38_000])
    assert level_db(pedal, 1.0, 1.1) < level_db(held, 1.0, 1.1) - 50
    ring = changed(patch, damping=Damping(let_ring=True))
    np.testing.assert_array_equal(play(ring, preset, 1.2, on, off), held)


def hammered(patch: Patch) -> Patch:
    """As it is, but struck without being stopped."""
    return changed(patch, pluck=patch.pluck.model_copy(update={"stops": False}))


@pytest.mark.parametrize("source", ["model", "truth"])
@pytest.mark.parametrize(("name", "key"), [("test", 45), ("classical_guitar", 40)])
def test_a_tremolo_keeps_its_level(patch: Patch, preset: Preset, name: str, key: int, source: str) -> None:
    """16 plucks a second of a string that rings on: within ±1 dB; added to the motion they climb and wobble."""
    chosen = patch if name == "test" else read_patch(PATCHES / f"{name}.json")
    plucked = changed(chosen, body=Body(), room=Room())
    strokes: list[tuple[float, Event]] = [(number / 16, NoteOn(key, 90)) for number in range(24)]
    spreads = []
    for each in (plucked, hammered(plucked)):
        sound = play(each, preset, 1.5, *strokes, source=source)
        levels = [level_db(sound, number / 16, (number + 1) / 16) for number in range(24)]
        spreads.append(max(levels) - min(levels))
    assert spreads[0] < 2
    assert spreads[1] > 4


def struck(patch: Patch, **pluck: object) -> Patch:
    """Struck by a hammer."""
    blow = {"shape": "raised_cosine", "width": 0.1, "width_hard": 0.1, "strikes": True, "stops": False, **pluck}
    return changed(patch, pluck=patch.pluck.model_copy(update=blow))


def test_a_hammer_starts_the_string_from_rest_with_speeds(patch: Patch, preset: Preset) -> None:
    """Against modes in closed form, of a blow so soft that the string is linear."""
    soft = struck(patch, softest_mm=1e-3, hardest_mm=1e-3, release_ms=2.0, release_hard_ms=2.0)
    heard = changed(soft, pickup=Pickup(points=(0.37,)))
    found, stage = Strings(soft).of_key(57), Stage(heard, preset)
    assert found is not None
    stage.play(NoteOn(57, 64))
    modes = resonator_of(found.parameters, found.modes, grid_points=preset.info.grid_points)
    shape = soft.pluck.pluck(64).displacement(modes.points)
    amplitudes = modes.to_modes(shape) * found.shortened * blow_factor(modes.omega, shape / 1e-6)
    amplitudes *= spectrum(modes.omega * 1e-3 / np.pi) * (modes.shapes @ weights_of(Ear((0.37,)), modes.points))[:, 0]
    t = np.arange(9_600) / RATE_HZ
    turns = np.exp(np.outer(t, 1j * np.sqrt(modes.omega**2 - modes.sigma**2) - modes.sigma)).imag
    expected = stage.begun()[0].gain / FULL_SCALE_M * turns @ amplitudes
    for source in ("model", "truth"):
        sound = play(heard, preset, 0.2, (0.0, NoteOn(57, 64)), source=source)
        np.testing.assert_allclose(sound[200:], expected[200:], atol=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("kind", ["displacement", "bridge"])
def test_keys_of_hammers_are_alike_in_model_and_truth_and_as_loud(patch: Patch, preset: Preset, kind: str) -> None:
    hard = struck(patch, release_ms=2.0, release_hard_ms=0.7)
    hard = changed(hard, pickup=Pickup(points=(0.3,), kind=kind))
    strokes = [(0.0, NoteOn(45, 127)), (0.15, NoteOn(45, 100)), (0.3, NoteOn(64, 127))]
    model, truth = (play(hard, preset, 1.0, *strokes, source=source) for source in ("model", "truth"))
    assert float(((model - truth) ** 2).sum() / (truth**2).sum()) < 1e-6
    for key in (45, 64):
        sound = render_note(hard, preset, key, 100, 2.0, 0.4, RATE_HZ)[:, 0].astype(np.float64)
        spectrum = np.abs(np.fft.rfft(sound)) ** 2
        weighted = (spectrum * k_weight(np.fft.rfftfreq(len(sound), 1 / RATE_HZ))).sum()
        assert 10 * np.log10(2 * weighted / len(sound) ** 2) == pytest.approx(WANTED_DB, abs=1.5)


@pytest.mark.parametrize("shape", ["triangular", "rounded"])
def test_what_pulls_to_a_point_is_no_hammer(patch: Patch, preset: Preset, shape: str) -> None:
    sounds = [
        play(struck(patch, shape=shape, strikes=each), preset, 0.1, (0.0, NoteOn(57, 90))) for each in (False, True)
    ]
    np.testing.assert_array_equal(*sounds)


HIGH_BANDS_HZ = ((2_000, 5_000), (5_000, 10_000), (10_000, 20_000))
INAUDIBLE_DB = -95.0


def bursts_db(sound: NDArray[np.float64], begin_s: float) -> NDArray[np.float64]:
    """The loudest millisecond of each high band within 15 ms, in dB of full scale."""
    begin, found = round(begin_s * RATE_HZ), []
    for low_hz, high_hz in HIGH_BANDS_HZ:
        band = butter(4, (low_hz, high_hz), "band", fs=RATE_HZ, output="sos")
        powers = uniform_filter1d(sosfilt(band, sound)[begin : begin + 720] ** 2, 48)
        found.append(10 * np.log10(powers.max() + 1e-30))
    return np.array(found)


@pytest.mark.parametrize("source", ["model", "truth"])
@pytest.mark.parametrize("kind", ["displacement", "velocity"])
@pytest.mark.parametrize(("first", "second"), [(90, 90), (127, 127), (127, 30)])
def test_a_string_that_is_stopped_by_the_next_pluck_makes_no_click(
    patch: Patch, preset: Preset, kind: str, first: int, second: int, source: str
) -> None:
    """What is left of the first pluck has no burst above the attack of the second, or above its own ringing."""
    heard = changed(patch, pickup=Pickup(points=(0.3,), kind=kind))
    strike_s = 0.4
    alone, fresh = (
        play(heard, preset, 0.5, (t, NoteOn(45, v)), source=source) for t, v in ((0, first), (0.4, second))
    )
    both = play(heard, preset, 0.5, (0.0, NoteOn(45, first)), (strike_s, NoteOn(45, second)), source=source)
    stopped = both - fresh
    np.testing.assert_array_equal(stopped[:19_200], alone[:19_200])
    end = round((strike_s + PLUCK_STOPS_S) * RATE_HZ) + QUANTUM
    np.testing.assert_allclose(stopped[end:], 0, atol=1e-7)
    allowed = np.maximum(np.maximum(bursts_db(fresh, strike_s), bursts_db(alone, strike_s - 0.02)), INAUDIBLE_DB)
    assert (bursts_db(stopped, strike_s) <= allowed).all()


def test_a_key_that_is_struck_again_sounds_as_soon_as_one_at_rest(patch: Patch, preset: Preset) -> None:
    """Whatever the pick-up, and for model and truth in the same frame."""
    for kind in ("displacement", "velocity"):
        heard = changed(patch, pickup=Pickup(points=(0.3,), kind=kind))
        stage = Stage(heard, preset, ("model", "truth"))
        begun = []
        for frames in (4_800, 640):
            stage.play(NoteOn(45, 90))
            stage.render(frames)
            begun += stage.begun()
        first, again = (stage.player.compiled.playing(each) for each in begun)
        assert first is None, "it is over"
        assert again is not None and again.began_frame == 4_800
        assert again.seconds == pytest.approx(640 / RATE_HZ)


def test_a_string_that_is_hammered_again_keeps_the_loud_tail(patch: Patch, preset: Preset) -> None:
    patch = hammered(patch)
    alone = play(patch, preset, 1.0, (0.0, NoteOn(45, 120)))
    again = play(patch, preset, 1.0, (0.0, NoteOn(45, 120)), (0.4, NoteOn(45, 2)))
    assert level_db(again, 0.45, 0.6) > level_db(alone, 0.45, 0.6) - 1.5
    joint = slice(round(0.395 * RATE_HZ), round(0.41 * RATE_HZ))
    assert np.abs(np.diff(again, 2))[joint].max() < 1.3 * np.abs(np.diff(alone, 2))[joint].max() + 1e-5


def test_a_key_that_two_tracks_strike_at_once_is_one_string_and_is_let_go(patch: Patch, preset: Preset) -> None:
    doubled = [(0.0, NoteOn(57, 90)), (0.0, NoteOn(57, 90)), (0.3, NoteOff(57)), (0.3, NoteOff(57))]
    once = [(0.0, NoteOn(57, 90)), (0.3, NoteOff(57))]
    two, one = play(hammered(patch), preset, 1.0, *doubled), play(patch, preset, 1.0, *once)
    assert level_db(two, 0.1, 0.3) == pytest.approx(level_db(one, 0.1, 0.3) + 6, abs=1)
    assert level_db(two, 0.6, 0.7) < level_db(two, 0.1, 0.3) - 60
    np.testing.assert_array_equal(play(patch, preset, 1.0, *doubled), one)  # the first is stopped before it sounds


@pytest.mark.parametrize(("by", "semitones"), [("tension", 2.0), ("length", 2.0), ("tension", -2.0)])
def test_the_wheel_bends_to_its_range_and_back(patch: Patch, preset: Preset, by: str, semitones: float) -> None:
    bending = changed(patch, bend_by=by)
    half = (0.05, Bend(semitones / 2))
    sound = play(bending, preset, 2.0, (0.0, NoteOn(57, 8)), half, (1.0, Bend(0.0)))
    assert abs(cents(pitch_hz(sound, 220 * 2 ** (semitones / 12), 0.1, 0.95), 220 * 2 ** (semitones / 12))) < 0.5
    assert abs(cents(pitch_hz(sound, 220, 1.1, 2.0), 220)) < 0.5


BUSY = [
    (0.0, NoteOn(45, 110)),
    (0.2, NoteOn(52, 90)),
    *[(0.3 + 0.01 * step, Bend(step / 20)) for step in range(20)],
    (0.6, NoteOff(45)),
    (0.7, NoteOn(52, 127)),
    (0.9, Bend(0.0)),
    (1.0, Controller(SUSTAIN, 127)),
    (1.1, NoteOff(52)),
    (1.2, NoteOn(64, 70)),
    (1.3, Controller(SUSTAIN, 0)),
]


@pytest.mark.parametrize("stops", [True, False])
def test_the_model_is_the_truth_under_the_same_hands(patch: Patch, preset: Preset, stops: bool) -> None:
    patch = patch if stops else hammered(patch)
    model, truth = (play(patch, preset, 2.0, *BUSY, source=source) for source in ("model", "truth"))
    assert float(((model - truth) ** 2).sum() / (truth**2).sum()) < 1e-5


def test_a_file_ends_when_nothing_is_heard(patch: Patch, preset: Preset) -> None:
    lively = changed(patch, room=Room(mix=0.4, t60_s=1.0), sympathy_s_kg=0.01)
    events = [TimedEvent(0.0, NoteOn(60, 100)), TimedEvent(0.2, NoteOff(60))]
    sound = np.concatenate(list(render_events(lively, preset, events, 48_000)))
    heard = np.flatnonzero(np.abs(sound).max(axis=1) >= 10 ** (SILENT_DB / 20))[-1]
    assert heard > 0.2 * 48_000 and len(sound) - heard <= 2 * BLOCK_FRAMES


def test_a_file_ends_with_its_last_note_whatever_controllers_follow(patch: Patch, preset: Preset) -> None:
    timed = [TimedEvent(0.0, NoteOn(57, 90)), TimedEvent(0.1, NoteOff(57))]
    late = [TimedEvent(time_s, Controller(11, 90)) for time_s in (30.0, 50.0)]
    alone, followed = (
        sum(len(block) for block in render_events(patch, preset, events, RATE_HZ)) for events in (timed, timed + late)
    )
    assert followed == alone < 20 * RATE_HZ
    pedal = [TimedEvent(0.05, Controller(SUSTAIN, 127)), TimedEvent(1.0, Controller(SUSTAIN, 0))]
    sound = np.concatenate(list(render_events(patch, preset, timed + pedal, RATE_HZ)))
    assert RATE_HZ < len(sound) < 2 * RATE_HZ  # the pedal after it is followed
    assert level_db(sound[:, 0], 0.8, 0.95) > -60


def test_events_give_the_same_samples_for_ever(patch: Patch, preset: Preset) -> None:
    np.testing.assert_array_equal(play(patch, preset, 1.5, *BUSY), play(patch, preset, 1.5, *BUSY))


@pytest.mark.parametrize("source", ["model", "truth"])
def test_notes_of_a_file_begin_at_their_frames(patch: Patch, preset: Preset, source: str) -> None:
    """Wherever in a quantum; also of a string that is struck again."""
    frames = (0, 4_801, 9_640, 14_463)
    alone = play(patch, preset, 0.5, (0.0, NoteOn(57, 90)), source=source)
    keys = [57, 57, 45, 57]
    sound = play(
        patch,
        preset,
        0.5,
        *((frame / RATE_HZ, NoteOn(key, 90)) for frame, key in zip(frames, keys, strict=True)),
        source=source,
    )
    settled = round(PLUCK_STOPS_S * RATE_HZ) + QUANTUM  # the one before has faded
    np.testing.assert_array_equal(sound[: frames[1] - QUANTUM], alone[: frames[1] - QUANTUM])
    second = slice(frames[1] + settled, frames[2])
    np.testing.assert_allclose(sound[second], alone[settled : frames[2] - frames[1]], atol=1e-6)
    third = play(patch, preset, 0.5, (0.0, NoteOn(45, 90)), source=source)
    both = sound[frames[2] : frames[3] - QUANTUM]
    expected = alone[frames[2] - frames[1] :][: len(both)] + third[: len(both)]
    np.testing.assert_allclose(both, expected, atol=1e-6)


def test_in_guitar_mode_a_channel_is_one_string(guitar: Patch, preset: Preset) -> None:
    stage = Stage(guitar, preset)
    stage.play(NoteOn(60, 100, channel=1))
    for key in (64, 67, 71):
        stage.play(NoteOn(key, 100, channel=0))
        stage.render(4800)
    assert [each.key for each in sounding(stage.player)] == [60, 71]
    assert [each.key for each in seen(stage.player)] == [60, 71], "the others are over"


def test_in_mpe_each_note_bends_alone(patch: Patch, preset: Preset) -> None:
    mpe = changed(patch, mode="mpe")
    sound = play(mpe, preset, 1.2, (0.0, NoteOn(45, 8, 1)), (0.0, NoteOn(57, 8, 2)), (0.02, Bend(4 / 48, 2)))
    assert abs(cents(pitch_hz(sound, 110), 110)) < 0.5
    wanted_hz = 220 * 2 ** (4 / 12)
    assert abs(cents(pitch_hz(sound, wanted_hz), wanted_hz)) < 0.5


def test_a_knob_changes_strings_that_ring(patch: Patch, preset: Preset) -> None:
    stage = Stage(patch, preset)
    stage.play(NoteOn(57, 60))
    before = stage.render(RATE_HZ // 2)
    stage.take(changed(patch, knobs=Knobs(decay=10.0)))
    after = stage.render(RATE_HZ)
    assert float(np.abs(np.diff(after, 2)[:4000]).max()) <= float(np.abs(np.diff(before, 2)).max())
    free = play(patch, preset, 1.5, (0.0, NoteOn(57, 60)))
    fallen = level_db(after, 0.8, 0.9) - level_db(free, 1.3, 1.4)
    assert fallen < -3


TURNS = {
    "knobs.stiffness": 4.0,
    "knobs.decay": 8.0,
    "knobs.brightness_decay": 6.0,
    "knobs.modulus": 3.0,
    "knobs.density": 2.0,
    "knobs.gauge": 1.6,
    "knobs.tension": 3.0,
    "knobs.length": 0.6,
    "tuning.a4_hz": 466.16,
}


def test_every_knob_of_the_string_is_turned_here() -> None:
    assert {f"knobs.{name}" for name in Knobs.model_fields} < TURNS.keys()


@pytest.mark.parametrize("field", TURNS)
def test_every_knob_turned_while_it_rings_changes_model_and_truth_alike_without_a_click(
    patch: Patch, preset: Preset, field: str
) -> None:
    section, _, name = field.partition(".")
    part = getattr(patch, section).model_copy(update={name: TURNS[field]})
    sounds = {}
    for turned in (changed(patch, **{section: part}), patch):
        for source in ("model", "truth"):
            stage = Stage(patch, preset, (source,))
            stage.play(NoteOn(57, 100))
            before = stage.render(RATE_HZ // 2)
            stage.take(turned)
            sounds[source, turned is patch] = np.concatenate([before, stage.render(RATE_HZ // 2)])
    at, glide = RATE_HZ // 2, round(0.1 * RATE_HZ)
    for source in ("model", "truth"):
        sound, free = sounds[source, False], sounds[source, True]
        np.testing.assert_array_equal(sound[:at], free[:at])
        edges = np.abs(np.diff(sound, 2))
        beside = max(edges[at - glide : at - 2].max(), edges[at + glide : at + 2 * glide].max())  # higher partials
        assert edges[at - 2 : at + glide].max() < 1.3 * beside, source
        after = slice(at + glide, None)
        assert np.linalg.norm((sound - free)[after]) > 0.03 * np.linalg.norm(free[after]), source
    model, truth = sounds["model", False], sounds["truth", False]
    assert float(((model - truth)[at:] ** 2).sum() / (truth[at:] ** 2).sum()) < 1e-5


def test_a_knob_turns_no_string_into_an_impossible_one(patch: Patch, preset: Preset) -> None:
    """It goes as far as the bound, for what rings and for the next key."""
    stage = Stage(patch, preset)
    stage.play(NoteOn(57, 60))
    heavy = changed(patch, strings=Fretted(string=replace(STEEL, density_kg_m3=90_000.0)))
    stage.take(changed(heavy, knobs=Knobs(density=3.0)))
    (after,) = stage.play()
    assert after.now.density_kg_m3 == bounds.STRING["density_kg_m3"][1]
    stage.play(NoteOn(52, 60))
    assert stage.begun()[-1].parameters.density_kg_m3 == bounds.STRING["density_kg_m3"][1]  # type: ignore[union-attr]


def test_the_wheel_turns_what_the_patch_says(patch: Patch, preset: Preset) -> None:
    stage = Stage(changed(patch, mod_wheel="pluck.position"), preset)
    stage.play(NoteOn(50, 90), Controller(MOD_WHEEL, 127), NoteOn(52, 90))
    assert [each.position for each in stage.begun()] == [pytest.approx(0.2), pytest.approx(0.5)]


@pytest.mark.parametrize("field", [field for field in WHEEL if field != "damping.mute" and "technique" not in field])
def test_the_wheel_turns_whatever_it_may(patch: Patch, preset: Preset, field: str) -> None:
    """Softly and hard, held and released: something of the next note, or of what it is heard through, is another.

    `test_techniques` and `test_strokes` have the others.
    """

    def heard(value: int) -> object:
        wheel = changed(patch, mod_wheel=field, body=Body(name="guitar"), room=Room(mix=0.1))
        stage = Stage(wheel, preset)
        stage.play(Controller(MOD_WHEEL, value))
        for key, velocity in ((50, 20), (52, 110)):
            stage.play(NoteOn(key, velocity), NoteOff(key))
        plucks = [(each.position, each.amplitude_mm, each.width) for each in stage.begun()]
        return plucks, [each.now for each in seen(stage.player)], stage.player.heard_through

    assert heard(0) != heard(127)


def test_the_wheel_brings_the_room(patch: Patch, preset: Preset) -> None:
    wheel = changed(patch, mod_wheel="room.mix", room=Room(mix=0.0, t60_s=1.0))

    def tail(value: int) -> float:
        events = [(0.0, Controller(MOD_WHEEL, value)), (0.1, NoteOn(50, 100)), (0.4, NoteOff(50))]
        sound = play(wheel, preset, 1.6, *events)
        return float(np.abs(sound[round(1.2 * RATE_HZ) :]).max())

    assert tail(0) < 1e-5
    assert tail(127) > 1e-4
    turned, still = ([TimedEvent(0.0, Controller(MOD_WHEEL, 127))], [TimedEvent(0.0, NoteOn(50, 100))])
    assert [channels_played(wheel, events) for events in (turned, still)] == [2, 1], "its echo has two sides"


def test_all_sound_off_ends_everything(patch: Patch, preset: Preset) -> None:
    sound = play(patch, preset, 1.0, (0.0, NoteOn(45, 90)), (0.1, NoteOn(57, 90)), (0.4, Controller(SOUND_OFF, 0)))
    assert np.abs(sound[round(0.5 * RATE_HZ) :]).max() == 0


def test_velocity_pick_ups_and_two_points_are_heard(patch: Patch, preset: Preset) -> None:
    stereo = changed(patch, pickup=Pickup(points=(0.1, 0.3), kind="velocity"))
    sound = render_note(stereo, preset, 50, 100, 0.5, 1.0, RATE_HZ)
    assert sound.shape == (RATE_HZ, 2)
    assert level_db(sound[:, 0].astype(float), 0, 0.4) > -40
    assert np.abs(sound[:, 0] - sound[:, 1]).max() > 1e-3


def test_a_note_can_be_stopped_while_it_is_rendered(patch: Patch, preset: Preset) -> None:
    reached_s: list[float] = []

    def advanced(seconds: float) -> None:
        reached_s.append(seconds)
        if seconds > 0.5:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        render_note(patch, preset, 50, 100, 60.0, 60.0, RATE_HZ, "model", advanced)
    assert len(reached_s) > 1 and reached_s[-1] < 1.0


def test_a_preset_of_one_string_is_refused(patch: Patch) -> None:
    with pytest.raises(ValueError, match="learned one string only"):
        Stage(patch, load_preset(SHIPPED / "studio_nylon_b3.safetensors"))


def test_a_string_that_rings_is_heard_at_a_point_that_moves(patch: Patch, preset: Preset) -> None:
    """As in the window, and in as many channels as it needs at any time."""
    there, here = (changed(patch, pickup=Pickup(points=points)) for points in ((0.1, 0.2), (0.5,)))
    both = changed(patch, pickup=Pickup(points=(0.5, 0.5)))
    timed = [TimedEvent(0.0, NoteOn(45, 60)), TimedEvent(0.3, PatchTurned(both))]
    sound = np.concatenate(list(render_events(there, preset, timed, RATE_HZ, "model", 1.0, limited=False)))
    assert sound.shape[1] == 2
    assert np.abs(sound[:9_600, 0] - sound[:9_600, 1]).max() > 1e-3
    np.testing.assert_allclose(sound[24_000:, 0], sound[24_000:, 1], atol=1e-6)
    widened = [TimedEvent(0.0, NoteOn(45, 60)), TimedEvent(0.3, PatchTurned(there))]
    assert next(render_events(here, preset, widened, RATE_HZ, seconds=1.0)).shape[1] == 2


def test_the_difference_is_that_of_model_and_truth_with_its_gain(patch: Patch, preset: Preset) -> None:
    note, rendered = (TimedEvent(0.0, NoteOn(45, 120)),), {}
    for source in ("model", "truth", "difference"):
        blocks = render_events(
            patch,
            preset,
            note,
            RATE_HZ,
            source,
            0.5,
            limited=False,
            difference_gain_db=20.0 * (source == "difference"),
        )
        rendered[source] = np.concatenate(list(blocks)).astype(np.float64)
    wanted = 10 * (rendered["model"] - rendered["truth"])
    np.testing.assert_allclose(rendered["difference"], wanted, atol=1e-5)
    with pytest.raises(ValueError, match="source must be model, truth or difference, not 'noise'"):
        next(render_events(patch, preset, note, RATE_HZ, "noise"))


def test_a_ringing_string_stays_as_it_is_where_a_knob_would_overdamp_it(patch: Patch, preset: Preset) -> None:
    stage = Stage(patch, preset)
    (before,) = stage.play(NoteOn(45, 90))
    heavy = replace(STEEL, damping_d3_kg_m_s=2e-2)  # of its highest modes
    stage.take(changed(patch, strings=Fretted(string=heavy)))
    (after,) = stage.play()
    assert after.now == before.now
    with pytest.raises(ValueError, match="overdamped"):
        stage.player.handle(NoteOn(45, 90))
    stage.take(changed(patch, knobs=Knobs(decay=2.0)))
    (after,) = stage.play()
    assert after.now.damping_d1_kg_m_s == pytest.approx(2 * before.now.damping_d1_kg_m_s)


def test_a_wheel_that_moves_while_a_knob_is_turned_is_followed(patch: Patch, preset: Preset) -> None:
    """In the end each string has the patch and the wheel."""
    stage = Stage(patch, preset)
    stage.play(NoteOn(45, 90), NoteOn(50, 90))
    stage.take(changed(patch, knobs=Knobs(decay=2.0)))
    for each in stage.play(Bend(1.0)):
        assert each.now.damping_d1_kg_m_s == pytest.approx(2 * each.own.damping_d1_kg_m_s)
        assert each.now.tension_n > 1.2 * each.own.tension_n


@pytest.mark.parametrize("name", ["brass_strung_harp", "electric_guitar_bridge_pick_up", "tanpura_drone"])
def test_what_is_handed_to_its_mixer_and_what_it_plays_add_up(preset: Preset, name: str) -> None:
    """A string of the Lab neither sounds through an instrument that rings nor moves its other strings."""
    patch = read_patch(PATCHES / f"{name}.json")
    strangers = np.random.default_rng(0).uniform(-0.5, 0.5, (RATE_HZ // 2, 2)).astype(np.float32)

    def mixed(plays: bool, adds: bool) -> NDArray[np.float64]:
        stage = OfflinePlayer(patch, preset, RATE_HZ, {"model": 1.0}, limited=False, varied=False, dry=False)
        if plays:
            stage.handle(NoteOn(sum(patch.range) // 2, 100), 0)
        if adds:
            stage.mixer.add(Voice.of_samples(plain_program(RATE_HZ), strangers))
        return stage.render(RATE_HZ).astype(np.float64)

    both, own, alone = mixed(True, True), mixed(True, False), mixed(False, True)
    np.testing.assert_allclose(both, own + alone, atol=1e-6)
    assert np.abs(own).max() > 0.01
    np.testing.assert_allclose(alone[200 : RATE_HZ // 2], strangers[200:], atol=1e-6)
    assert np.abs(alone[RATE_HZ // 2 :]).max() < 1e-12

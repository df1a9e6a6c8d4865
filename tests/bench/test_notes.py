"""The judgement of a piece, on the same piece rendered without a device: what is as it should be, and what is not."""

from __future__ import annotations

from random import Random
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from app.instrument.events import Controller, NoteOff, NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.patches.patch import Body, Noise, Patch
from app.patches.tuning import Tuning
from engine.presets import SHIPPED, load_preset
from engine.values.effects import Room
from tests.bench.play import hearing, score
from tests.bench.play.hands import KeyHand
from tests.bench.play.judgement import Judgement, judge
from tests.bench.play.screen import Screen
from tests.bench.play.sound_server import RATE_HZ

BEGIN_S = 0.5
Piece = dict[str, list[TimedEvent]]


@pytest.fixture(scope="module")
def patch() -> Patch:
    """One direction, released at once, each stroke alike: what is judged has no beats of its own."""
    patch = read_patch(PATCHES / "classical_guitar.json")
    pluck = patch.pluck.model_copy(update={"variation": 0.0, "release_ms": 0.0, "release_hard_ms": 0.0})
    plain: dict[str, object] = {"pluck": pluck, "polarisations": None, "sympathy_s_kg": 0.0, "noise": Noise()}
    return Patch.model_validate({**dict(patch), "body": Body(), "room": Room(), **plain})


@pytest.fixture(scope="module")
def piece() -> Piece:
    played, now_s = {}, BEGIN_S
    for part in (score.melody(45, 55), score.chords(), score.repeats(), score.bends(), score.pedal()):
        played[part.name] = [TimedEvent(now_s + each.time_s, each.event) for each in part.events]
        now_s += part.seconds
    return played


def rendered(piece: Piece, patch: Patch) -> NDArray[np.float32]:
    events = [each for part in piece.values() for each in part]
    preset = load_preset(SHIPPED / f"{patch.preset}.safetensors")
    mono = np.concatenate(list(render_events(patch, preset, events, RATE_HZ)))
    return np.repeat(mono, 2, axis=1)[:, :2]


@pytest.fixture(scope="module")
def sound(patch: Patch, piece: Piece) -> NDArray[np.float32]:
    return rendered(piece, patch)


def judged(piece: Piece, patch: Patch, sound: NDArray[np.float32]) -> Judgement:
    return judge(piece, patch, sound, lambda time_s: time_s)


def test_what_is_rendered_is_as_it_should_be(patch: Patch, piece: Piece, sound: NDArray[np.float32]) -> None:
    found = judged(piece, patch, sound)
    assert found.melody_cents < 0.05
    assert found.bend_cents is not None and found.bend_cents < 0.05
    assert found.chord_cents < 0.05
    assert found.tones_heard == found.chord_tones == 16
    assert found.repeats_heard == found.repeats == score.REPEATS
    assert found.loudness_spread_db < 1
    assert found.release_t60_s == pytest.approx((found.wanted_t60_s, found.wanted_t60_s), rel=0.05)
    assert found.pedal_t60_s == pytest.approx(found.wanted_t60_s, rel=0.05)
    assert found.pedal_db is not None and found.pedal_db < 0.1
    assert found.restrike_db is not None and found.restrike_db < 0.5
    assert (found.holes, found.fades, found.clicks) == (0, 0, 0)


@pytest.mark.parametrize(("stops", "allowed"), [(True, 0.5), (False, 1.5)])
def test_soft_strikes_of_a_loud_string_are_judged_by_what_the_patch_says(
    patch: Patch, piece: Piece, stops: bool, allowed: float
) -> None:
    """A patch that is played by the other rule is found out. What is added may be out of phase."""
    pedal = {name: piece[name] for name in ("melody", "chords", "repeats", "pedal")}
    said = Patch.model_validate({**dict(patch), "pluck": patch.pluck.model_copy(update={"stops": stops})})
    played = Patch.model_validate({**dict(patch), "pluck": patch.pluck.model_copy(update={"stops": not stops})})
    right, wrong = (judged(pedal, said, rendered(pedal, each)).restrike_db for each in (said, played))
    assert right is not None and right < allowed
    assert wrong is not None and wrong > 2


def test_faults_are_found(patch: Patch, piece: Piece) -> None:
    """No pedal, a tone of a chord and a repeat left out, a key that hangs, a hole and a click."""
    melody, chords, repeats = (piece[name] for name in ("melody", "chords", "repeats"))
    hangs = max(each for each in range(len(melody)) if isinstance(melody[each].event, NoteOff))
    wrong = {
        **piece,
        "melody": [each for number, each in enumerate(melody) if number != hangs],
        "chords": [each for each in chords if not (each.time_s < chords[0].time_s + 0.1 and key_of(each) == 52)],
        "repeats": [each for number, each in enumerate(repeats) if number != 6],
        "pedal": [each for each in piece["pedal"] if not isinstance(each.event, Controller)],
    }
    sound = rendered(wrong, patch)
    middle = round((chords[-1].time_s - 0.4) * RATE_HZ)
    sound[middle : middle + 480] = 0
    sound[middle + 4800] += 0.2
    found = judged(piece, patch, sound)
    assert (found.tones_heard, found.repeats_heard) == (15, score.REPEATS - 1)
    assert found.release_t60_s[1] > 1
    assert found.pedal_db is not None and found.pedal_db > 20
    assert found.holes > 1  # where the pedal should hold, too
    assert min(abs(hole_s - middle / RATE_HZ) for hole_s in found.hole_times_s) < 1e-3
    assert [round(click_s, 2) for click_s in found.click_times_s] == [round((middle + 4800) / RATE_HZ, 2)]
    assert found.melody_cents < 0.05  # which has none of these


def test_pitch_is_reported_in_cents(patch: Patch, sound: NDArray[np.float32], piece: Piece) -> None:
    note = score.sounded(piece["melody"])[0]
    span = (note.pressed_s + hearing.ATTACK_S, note.released_s)
    hz = Tuning(patch.tuning).hz(note.key)
    assert hearing.cents(sound, *span, hz * 2 ** (3 / 1200)) == pytest.approx(-3, abs=0.05)
    assert np.isnan(hearing.cents(np.zeros_like(sound), *span, hz))


def test_the_computers_keys_play_the_whole_piece_but_wheel_and_pedal() -> None:
    pressed: list[tuple[str, bool]] = []

    class Keys:
        def key(self, name: str, down: bool) -> float:
            pressed.append((name, down))
            return float(len(pressed))

    hand = KeyHand(cast(Screen, Keys()))
    for part in score.parts(Random(0), 0, 127):
        if not part.turns:
            for each in part.events:
                hand.do(each.event)
    assert pressed.count(("a", True)) == pressed.count(("a", False)) > 0
    assert not hand._down
    assert {"2", "5", "7", "z", "x"} <= {name for name, _ in pressed}
    with pytest.raises(ValueError, match="neither wheel nor pedal"):
        hand.do(Controller(64, 127))


def key_of(each: TimedEvent) -> int | None:
    return each.event.key if isinstance(each.event, NoteOn | NoteOff) else None

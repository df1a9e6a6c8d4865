"""The session: validated choices, notice of what really changed, and the pluck that a preset brings."""

from dataclasses import asdict

import pytest

from app.instruments.instrument import Fretted, Instrument, Pickup
from app.presets.library import Library, list_presets
from app.presets.words import why_no_middle
from app.session.choices import Choices
from app.session.trained import brought_pluck
from app.stage.session import Session
from engine.pluck import Pluck
from engine.presets import SHIPPED, outside_training
from engine.values.ear import Ear
from engine.values.string import StringParameters

STRING = StringParameters(density_kg_m3=7850.0, youngs_modulus_pa=2e11, tension_n=75.0)


def played_instrument(*points: float, kind: str = "displacement") -> Instrument:
    pickup = Pickup.model_validate({"points": points, "kind": kind})
    return Instrument(name="p", category="harp", preset="many", strings=Fretted(string=STRING), pickup=pickup)


def recorded(session: Session) -> list[frozenset[str]]:
    seen: list[frozenset[str]] = []
    session.changed.connect(seen.append)
    return seen


BAD = {
    "position": 1.0,
    "listen": -0.1,
    "seconds": 99,
    "volume_db": 40,
    "shape": "saw",
    "heard": "both",
    "colour": "red",
    "pickup": "velocity",  # of earlier versions
}


@pytest.mark.parametrize(("field", "value"), [*BAD.items(), ("a", "noise"), ("a", "preset:"), ("a", "model ")])
def test_a_bad_value_changes_nothing_and_is_named(field, value):
    session = Session()
    seen, before = recorded(session), session.choices
    with pytest.raises(ValueError, match=field):
        session.update(**{"listen": 0.5, field: value})
    assert session.choices is before and seen == []


def test_gestures_are_clamped_and_slots_are_switched_there_and_back():
    session = Session(Choices(a="preset:other one", b="difference"))
    session.move_pluck(-3, 400)
    session.move_listening_point(7)
    choices = session.choices
    assert (choices.pluck.position, choices.pluck.amplitude_mm, choices.listen) == (0.02, 20.0, 1)
    for heard, source in (("a", "preset:other one"), ("b", "difference"), ("a", "preset:other one")):
        assert (session.choices.heard, session.choices.source_heard) == (heard, source)
        session.switch_source()


def test_keys_play_what_was_chosen_last():
    instrument = played_instrument(0.2)
    session = Session(Choices(instrument=instrument, string=STRING))
    session.update(preset="one")
    choices = session.choices
    assert (choices.single, choices.instrument, choices.string) == ("one", instrument, None)
    session.update(preset="many")
    assert (session.choices.played, session.choices.single) == (instrument, None), (
        "it is the preset of the instrument"
    )
    session.update(preset="one")
    session.play_instrument()
    assert (session.choices.preset, session.choices.plays_instrument) == ("many", True)
    session.play(string=STRING)
    session.play_string()
    choices = session.choices
    assert (choices.single, choices.instrument, choices.string) == ("many", instrument, STRING)
    session.update(instrument=instrument.model_copy(update={"name": "turned"}))
    assert (session.choices.plays_instrument, session.choices.instrument and session.choices.instrument.name) == (
        False,
        "turned",
    )


@pytest.mark.parametrize("plays", ["pitch", "place", None])
@pytest.mark.parametrize("preset", ["many", "one"])
def test_choices_from_before_the_instrument_are_understood(plays, preset):
    instrument = played_instrument(0.2)
    old = {"preset": preset, "patch": instrument.model_dump(), "string": asdict(STRING), "position": 0.4}
    choices = Choices.model_validate(old if plays is None else {**old, "keys_play": plays})
    assert (choices.instrument, choices.pluck) == (instrument, Pluck(0.4))
    assert choices.single == (preset if plays == "place" else None)
    assert (choices.string is None) == (preset == "one" and plays != "place"), "it is no string of that preset"
    assert Choices.model_validate({"preset": preset}).single == preset
    flat = {"listen": 0.2, "listen_right": 0.7, "stereo": True, "pickup": "velocity"}
    choices = Choices.model_validate({**old, **flat, "keys_play": plays or "pitch"})
    assert choices.string_pickup == Pickup(points=(0.2, 0.7), kind="velocity")
    assert choices.ear == (Ear((0.2, 0.7), "velocity") if plays == "place" else Ear((0.2,)))
    assert Choices.model_validate_json(choices.model_dump_json()) == choices


def test_choices_of_two_kinds_of_instruments_are_understood():
    instrument = played_instrument(0.2)
    played, beside, alone = (
        Choices.model_validate({"position": 0.4, **old})
        for old in (
            {"instrument": instrument.model_dump(), "kept": None},
            {"instrument": {"preset": "one"}, "kept": instrument.model_dump(), "string": asdict(STRING)},
            {"instrument": {"preset": "one"}, "kept": None},
        )
    )
    assert (played.played, played.single, played.preset) == (instrument, None, "many")
    assert (beside.played, beside.single, beside.instrument, beside.string) == (None, "one", instrument, STRING)
    assert alone.instrument is None


def pickup_of(session: Session) -> tuple[tuple[float, ...], str]:
    instrument = session.choices.instrument
    assert instrument is not None
    return instrument.pickup.points, instrument.pickup.kind


def test_a_pick_up_is_that_of_the_instrument_while_keys_play_it():
    session = Session()
    session.update(played=played_instrument(0.2))
    session.update(pickup_kind="velocity")
    session.move_listening_point(0.3)
    assert pickup_of(session) == ((0.3,), "velocity")
    session.update(stereo=True, listen_right=0.9)
    assert pickup_of(session) == ((0.3, 0.9), "velocity")
    session.update(stereo=False)
    assert pickup_of(session) == ((0.3,), "velocity")
    seen = recorded(session)
    session.update(instrument=played_instrument(0.6, 0.8))  # the other way
    assert session.choices.ear == Ear((0.6, 0.8))
    assert seen == [frozenset({"instrument", "ear"})]
    for stereo in (False, True):
        session.update(stereo=stereo)
    assert pickup_of(session) == ((0.6, 0.8), "displacement"), "the right point is remembered"
    session.update(preset="one")
    assert session.choices.ear == Ear((0.6, 0.8)), "the string is heard where the instrument was"
    session.update(listen=0.7, pickup_kind="velocity", stereo=True)
    assert pickup_of(session) == ((0.6, 0.8), "displacement")
    session.update(instrument=played_instrument(0.4))
    assert session.choices.listen == 0.7
    session.play_instrument()  # it is heard as it is
    assert session.choices.ear == Ear((0.4,))


def test_an_instrument_whose_macro_moves_the_right_point_stays_in_stereo():
    macro = {"name": "Width", "targets": ({"field": "pickup.points.1", "low": 0.5, "high": 0.9},)}
    session = Session()
    session.update(played=Instrument.model_validate({**dict(played_instrument(0.2, 0.8)), "macros": (macro,)}))
    before = session.choices
    with pytest.raises(ValueError, match=r"p stays in stereo: its macro Width"):
        session.update(stereo=False)
    assert session.choices is before


LIBRARY = Library(list_presets(SHIPPED)[0])
LRU, FGRU = "nylon_nonlinear_gaussian_16k_lru_400", "nylon_nonlinear_gaussian_16k_fgru_400"
LINEAR, NOISE, STUDIO = "nylon_linear_gaussian_16k_lru", "nylon_nonlinear_noise_4k_koopman", "studio_nylon_b3"


def test_every_middle_lies_within_its_training_and_the_others_say_why_there_is_none():
    for entry in LIBRARY.entries:
        info = entry.info
        if info.initial == "noise" or info.family is not None:
            assert info.middle_pluck is None and why_no_middle(info).startswith("It was trained on"), entry.name
        else:
            assert info.middle_pluck is not None and why_no_middle(info) == "", entry.name
            assert outside_training(info, info.middle_pluck) == [], entry.name
    middles = [entry.info.middle_pluck for entry in LIBRARY.entries if entry.name in (LRU, STUDIO)]
    assert middles == [Pluck(0.5, 2.236, "gaussian", 0.0949), Pluck(0.5, 5.5, "gaussian", 0.06)]


@pytest.mark.parametrize(
    ("before", "shape", "chosen", "brings"),
    [
        ("studio_any_string", "rounded", LRU, True),
        ("studio_any_string", "gaussian", LRU, False),  # within its training already
        (LRU, "rounded", FGRU, False),  # of one training: both play what the user has chosen
        (LRU, "rounded", LINEAR, True),  # another string
        (NOISE, "rounded", LRU, True),  # other plucks
        (LRU, "rounded", NOISE, False),  # none is known
        (LRU, "rounded", "gone", False),
    ],
)
def test_a_preset_brings_its_pluck_where_the_present_one_is_outside(before, shape, chosen, brings):
    found = brought_pluck(Choices(single=before, pluck=Pluck(shape=shape)), LIBRARY, chosen)
    entry = LIBRARY.find(chosen)
    assert found == ({"pluck": entry.info.middle_pluck} if brings and entry and entry.info.middle_pluck else {})

"""The session: validated choices and notice of what really changed."""

import pytest

from app.instruments.instrument import Fretted, Instrument, Pickup
from app.session.choices import Choices
from app.stage.session import Session
from engine.values.string import StringParameters

STRING = {
    "length_m": 0.65,
    "area_m2": 5e-7,
    "second_moment_m4": 2e-14,
    "density_kg_m3": 7850.0,
    "youngs_modulus_pa": 2e11,
    "damping_d1_kg_m_s": 4e-4,
    "damping_d3_kg_m_s": 4e-7,
    "tension_n": 75.0,
}


def recorded(session: Session) -> list[frozenset[str]]:
    seen: list[frozenset[str]] = []
    session.changed.connect(seen.append)
    return seen


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("position", 1.0),
        ("listen", -0.1),
        ("seconds", 99),
        ("volume_db", 40),
        ("shape", "saw"),
        ("heard", "both"),
        ("colour", "red"),
    ],
)
def test_a_bad_value_changes_nothing_and_is_named(field: str, value: object) -> None:
    session = Session()
    seen, before = recorded(session), session.choices
    with pytest.raises(ValueError, match=field):
        session.update(listen=0.5, **{field: value}) if field != "listen" else session.update(listen=value)
    assert session.choices is before
    assert seen == []


def test_gestures_are_clamped_to_what_is_allowed() -> None:
    session = Session()
    session.move_pluck(-3, 400)
    assert (session.choices.position, session.choices.amplitude_mm) == (0.02, 20.0)
    session.move_listening_point(7)
    assert session.choices.listen == 1


def test_slots_hold_any_two_sources_and_are_switched_there_and_back() -> None:
    session = Session(Choices(a="preset:other one", b="difference"))
    for heard, source in (("a", "preset:other one"), ("b", "difference"), ("a", "preset:other one")):
        assert (session.choices.heard, session.choices.source_heard) == (heard, source)
        session.switch_source()
    for wrong in ("noise", "preset:", "model "):
        with pytest.raises(ValueError, match="a: "):
            session.update(a=wrong)


def test_keys_play_what_was_chosen_last() -> None:
    instrument = Instrument(
        name="p", category="harp", preset="many", strings=Fretted(string=StringParameters(**STRING))
    )
    string = instrument.strings.string  # type: ignore[union-attr]
    session = Session(Choices(instrument=instrument, string=string))
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
    session.play(string=string)
    session.play_string()
    choices = session.choices
    assert (choices.single, choices.instrument, choices.string) == ("many", instrument, string)
    session.update(instrument=instrument.model_copy(update={"name": "turned"}))
    assert (session.choices.plays_instrument, session.choices.instrument and session.choices.instrument.name) == (
        False,
        "turned",
    )


@pytest.mark.parametrize("plays", ["pitch", "place", None])
@pytest.mark.parametrize("preset", ["many", "one"])
def test_choices_from_before_the_instrument_are_understood(plays: str | None, preset: str) -> None:
    instrument = played_instrument(0.2)
    old = {"preset": preset, "patch": instrument.model_dump(), "string": STRING, "position": 0.4}
    choices = Choices.model_validate(old if plays is None else {**old, "keys_play": plays})
    assert (choices.instrument, choices.position) == (instrument, 0.4)
    assert choices.single == (preset if plays == "place" else None)
    assert (choices.string is None) == (preset == "one" and plays != "place"), "it is no string of that preset"
    assert Choices.model_validate({"preset": preset}).single == preset
    assert Choices.model_validate_json(choices.model_dump_json()) == choices


def test_choices_of_two_kinds_of_instruments_are_understood() -> None:
    instrument = played_instrument(0.2).model_dump()
    played = Choices.model_validate({"instrument": instrument, "kept": None, "position": 0.4})
    assert (played.played, played.single, played.preset) == (played_instrument(0.2), None, "many")
    beside = Choices.model_validate({"instrument": {"preset": "one"}, "kept": instrument, "string": STRING})
    assert (beside.played, beside.single, beside.instrument) == (None, "one", played_instrument(0.2))
    assert beside.string is not None
    assert Choices.model_validate({"instrument": {"preset": "one"}, "kept": None}).instrument is None


def played_instrument(*points: float, kind: str = "displacement") -> Instrument:
    strings = Fretted(string=StringParameters(**STRING))
    pickup = Pickup.model_validate({"points": points, "kind": kind})
    return Instrument(name="p", category="harp", preset="many", strings=strings, pickup=pickup)


def pickup_of(session: Session) -> tuple[tuple[float, ...], str]:
    instrument = session.choices.instrument
    assert instrument is not None
    return instrument.pickup.points, instrument.pickup.kind


def test_what_is_heard_is_the_pick_up_of_the_instrument_that_keys_play() -> None:
    session = Session()
    session.update(played=played_instrument(0.2))
    session.update(pickup="velocity")
    session.move_listening_point(0.3)
    assert pickup_of(session) == ((0.3,), "velocity")
    session.update(stereo=True, listen_right=0.9)
    assert pickup_of(session) == ((0.3, 0.9), "velocity")
    session.update(stereo=False)
    assert pickup_of(session) == ((0.3,), "velocity")
    seen = recorded(session)
    session.update(instrument=played_instrument(0.6, 0.8))  # the other way
    choices = session.choices
    assert (choices.listen, choices.listen_right, choices.stereo, choices.pickup) == (0.6, 0.8, True, "displacement")
    assert seen == [frozenset({"instrument", "listen", "listen_right", "stereo", "pickup"})]


def test_a_instrument_that_keys_do_not_play_keeps_its_pick_up() -> None:
    session = Session()
    session.update(played=played_instrument(0.2))
    session.update(preset="one")
    session.update(listen=0.7, pickup="velocity", stereo=True)
    assert pickup_of(session) == ((0.2,), "displacement")
    session.update(instrument=played_instrument(0.4))
    assert session.choices.listen == 0.7
    session.play_instrument()  # it is heard as it is
    choices = session.choices
    assert (choices.listen, choices.stereo, choices.pickup) == (0.4, False, "displacement")


def test_a_instrument_whose_macro_moves_the_right_point_stays_in_stereo() -> None:
    target = {"field": "pickup.points.1", "low": 0.5, "high": 0.9}
    macro = {"name": "Width", "targets": (target,)}
    instrument = Instrument.model_validate({**dict(played_instrument(0.2, 0.8)), "macros": (macro,)})
    session = Session()
    session.update(played=instrument)
    before = session.choices
    with pytest.raises(ValueError, match=r"p stays in stereo: its macro Width"):
        session.update(stereo=False)
    assert session.choices is before

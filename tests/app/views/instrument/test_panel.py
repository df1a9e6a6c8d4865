"""The strip: its bar, the string's knobs on demand, and the browser of instruments."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractButton, QInputDialog, QMenu, QWidget
from pytestqt.qtbot import QtBot

from app.instruments.instrument import Instrument, Pickup
from app.instruments.library import SHIPPED, InstrumentEntry, read_instrument
from app.player.events import Meter
from app.views.controls.browser import REALLY, Browser
from app.views.instrument.instrument_bar import InstrumentBar
from app.views.instrument.instrument_card import instrument_browser, instrument_row
from app.views.instrument.panel import InstrumentPanel
from app.views.instrument.string_knobs import StringKnobs
from tests.app.gestures import LEFT, RIGHT, SHIFT, named, press_keys, reported

Key = Qt.Key


@pytest.fixture(scope="session")
def guitar() -> Instrument:
    """Six strings, stereo, five macros, a body."""
    return read_instrument(SHIPPED / "classical_guitar.json")


@pytest.fixture
def panel(show: Callable[..., InstrumentPanel]) -> InstrumentPanel:
    made = show(InstrumentPanel(), 1500, 300)
    made.set_range(40, 86)
    return made


@pytest.fixture
def bar(show: Callable[..., InstrumentBar], guitar: Instrument) -> InstrumentBar:
    made = show(InstrumentBar(), 1250, 64)
    made.set_bodies([("guitar", "Guitar")])
    made.show_instrument(guitar, own=True, changed=True)
    made.show_octave(3, 2, 6)
    return made


def click(qtbot: QtBot, panel: InstrumentPanel, name: str) -> None:
    qtbot.mouseClick(named(panel, name, QAbstractButton), LEFT)


def test_either_surface_is_played_and_sees_what_sounds(qtbot, panel):
    for name, words, surface in (("neck", "Surface: Strings", panel.neck), ("keys", "Surface: Keys", panel.keys)):
        click(qtbot, panel, words)
        assert panel.surface == name and surface.isVisible()
        with qtbot.waitSignals([panel.pressed, panel.released], order="strict"):
            qtbot.mouseClick(surface, LEFT, pos=surface.key_rect(60).center().toPoint())
    panel.show_sounding({62: 0.5})
    assert panel.keys.level(62) == panel.neck.level(62) > 0
    qtbot.mouseClick(panel.keys, RIGHT, pos=panel.keys.key_rect(60).center().toPoint())
    with qtbot.waitSignal(panel.released):  # of the surface that is hidden
        panel.show_surface("neck")


def test_in_a_low_window_the_strings_knobs_take_the_place_of_the_keys(qtbot, panel):
    panel.set_low(True)
    panel.set_unfolded(True)
    assert panel.knobs.isVisible() and not panel.keys.isVisible()
    click(qtbot, panel, "Surface: Keys")
    assert panel.keys.isVisible() and not panel.unfolded and not panel.knobs.isVisible()


def test_the_touch_is_chosen_and_fingers_are_lifted_by_a_button(qtbot, panel):
    chosen, switched = reported(panel.touch_chosen), reported(panel.technique_switched)
    for part, names in ((panel.touch, "legato slide pluck"), (panel.techniques, "strum tremolo strum harmonics")):
        for name in names.split():
            qtbot.mouseClick(part.findChild(QAbstractButton, name), LEFT)
    assert chosen == ["legato", "slide", "pluck"]
    assert switched == [("strum", True), ("tremolo", True), ("strum", False), ("harmonics", True)]
    panel.neck.set_strings((("A2", 45), ("D3", 50)))
    panel.show_surface("neck")
    button = named(panel, "Lift fingers", QAbstractButton)
    qtbot.mouseClick(panel.neck, RIGHT, pos=panel.neck.cell(0, 3).center().toPoint())
    assert panel.neck.fingers == {0: 3} and button.isVisible()
    qtbot.mouseClick(button, LEFT)
    assert panel.neck.fingers == {} and button.isHidden()
    panel.set_drums(True)
    assert not panel.touch.isEnabled() and not panel.techniques.isEnabled()


def test_macros_are_those_of_the_instrument(bar, guitar):
    values = [(knob.accessibleName(), knob.value) for knob in bar.macros if knob.isVisible()]
    assert values == [(each.name, each.value) for each in guitar.macros]
    turned = reported(bar.macro_turned)
    press_keys(bar.macros[1], Qt.Key.Key_Home)
    assert turned == [(1, 0.0)]
    for macros in (8 * guitar.macros[:1], ()):
        bar.show_instrument(guitar.model_copy(update={"macros": macros}), own=True)
        assert sum(knob.isVisible() for knob in bar.macros) == len(macros)


def test_the_record_button_and_the_menu_beside_it(bar, monkeypatch):
    for seconds, text in ((73.4, "■  1:13"), (3.0, "■  0:03"), (-0.2, "■  −1"), (-1.5, "■  −2"), (None, "●  Record")):
        bar.show_recording(seconds)
        assert (bar.record.text(), bar.record.isChecked()) == (text, seconds is not None)
    menu = bar.takes
    actions = {each.text(): each for part in (menu, *menu.findChildren(QMenu)) for each in part.actions()}
    typed = iter(["1e9", "90 or so", "90"])  # the first two are asked again
    monkeypatch.setattr(QInputDialog, "getText", lambda *_, text: (next(typed), bool(text)))
    for name in ("Metronome", "2 bars", "Tempo: 120 beats a minute …", "3"):
        actions[name].trigger()
    assert menu.meter == Meter(count_in_bars=2, metronome=True, tempo_bpm=90, beats=3) and not list(typed)


@pytest.fixture
def knobs(show: Callable[..., StringKnobs], guitar: Instrument) -> StringKnobs:
    made = show(StringKnobs(), 1200, 110)
    made.show_instrument(guitar)
    return made


def test_every_field_is_shown_and_can_be_turned_to_both_ends(knobs, guitar):
    stereo = guitar.model_copy(update={"pickup": Pickup(points=(0.1, 0.6))})
    knobs.show_instrument(stereo)
    for field, knob in knobs.knobs.items():
        if field.startswith("tuning."):
            continue
        assert knob.value == stereo.value(field)
        for value in knob.parameter.limits:
            if field not in ("pluck.softest_mm", "pluck.hardest_mm"):  # which bound each other
                assert stereo.with_value(field, value).value(field) == pytest.approx(value)
    assert knobs.knobs["tuning.a4_hz"].value == guitar.tuning.a4_hz


def test_gestures_are_reported_with_their_field(qtbot, knobs, guitar):
    asked = reported(knobs.changed)
    press_keys(knobs.knobs["knobs.gauge"], Key.Key_Up)
    knobs.knobs["tuning.transpose"].value_asked.emit(2.6)  # by whole keys
    press_keys(knobs.knobs["tuning.transpose"], Key.Key_Down, held=SHIFT)
    knobs.shape.activated.emit(knobs.shape.findText("Triangle"))
    qtbot.mouseClick(knobs.knobs["knobs.decay"], LEFT)
    knobs.show_instrument(guitar.with_value("pluck.position", 0.4), guitar)
    qtbot.mouseDClick(knobs.knobs["pluck.position"], LEFT)  # back to what was saved
    assert asked == [
        ("knobs.gauge", pytest.approx(1.03 * guitar.knobs.gauge)),
        ("tuning.transpose", 3.0),
        ("tuning.transpose", 0.0),
        ("pluck.shape", "triangular"),
        ("pluck.position", guitar.pluck.position),
    ]


def test_what_an_instrument_does_not_have_cannot_be_turned_and_the_tip_says_why(knobs, guitar):
    keymap = "12\n0\n127\n60\n69\n440\n12\n" + "".join(f"{n}\n" for n in range(12))
    changes = {"pluck.shape": "triangular", "damping.let_ring": True, "tuning.keymap": keymap}
    dead = guitar.model_dump()
    for (part, _, name), value in ((field.partition("."), value) for field, value in changes.items()):
        dead[part][name] = value
    widths = dict.fromkeys(("pluck.width", "pluck.width_hard"), "no width")
    why = {**widths, "damping.release_t60_s": "ring", "tuning.a4_hz": "reference pitch of its own"}
    for instrument, barred in ((Instrument.model_validate(dead), set(why)), (guitar, set())):
        knobs.show_instrument(instrument)
        assert {field for field, knob in knobs.knobs.items() if not knob.isEnabled()} == barred
        for field, words in why.items():
            assert (words in knobs.knobs[field].toolTip()) == (field in barred)
    knobs.show_instrument(read_instrument(SHIPPED / "timpani.json"))
    assert not knobs.shape.isEnabled(), "drums have no pluck to shape"


@pytest.fixture
def browser(show: Callable[..., QWidget], guitar: Instrument) -> Iterator[Browser]:
    """Of steel, which is loaded, and one's own."""
    made = instrument_browser(show(QWidget(), 1280, 800))
    steel, mine = (guitar.model_copy(update={"name": name}) for name in ("steel", "mine"))
    entries = (InstrumentEntry(SHIPPED / "steel.json", steel), InstrumentEntry(Path("/own/mine.json"), mine))
    made.show_rows([instrument_row(each) for each in entries], {"steel"}, "steel", "/own")
    made.show_over()
    yield made
    made.dismiss()


def test_only_ones_own_can_be_renamed_or_deleted_and_that_is_asked_twice(qtbot, browser):
    renamed, deleted = reported(browser.rename_asked), reported(browser.delete_asked)
    assert not browser.rename.isVisible() and not browser.delete.isVisible()
    browser.set_chosen("mine")
    qtbot.mouseClick(browser.rename, LEFT)
    assert renamed == ["mine"]
    qtbot.mouseClick(browser.delete, LEFT)
    assert (browser.delete.text(), deleted) == (REALLY, [])
    browser.set_chosen("steel")
    browser.set_chosen("mine")
    for asked in ([], ["mine"]):  # first: another was looked at meanwhile
        qtbot.mouseClick(browser.delete, LEFT)
        assert deleted == asked

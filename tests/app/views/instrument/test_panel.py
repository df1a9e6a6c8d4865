"""The strip: its bar, the string's knobs on demand, and the browser of instruments."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QRect, Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QAbstractButton, QApplication, QInputDialog, QLabel, QMenu, QStackedWidget, QWidget
from pytestqt.qtbot import QtBot

from app.instruments.instrument import Instrument, Macro, MacroTarget, Pickup
from app.instruments.library import SHIPPED, InstrumentEntry, read_instrument
from app.instruments.scales import SCALES
from app.instruments.tuning import TuningChoice
from app.player.events import Meter
from app.views import theme
from app.views.controls.browser import REALLY, Browser
from app.views.controls.sideways import Sideways
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
    hint, facts = panel.findChild(QLabel, "hint"), panel.knobs.facts
    panel.set_low(True)
    height = panel.sizeHint().height()
    assert hint.isVisible() and not panel.knobs.isVisible(), "they are folded at first"
    click(qtbot, panel, "String knobs")
    assert panel.knobs.isVisible() and not panel.keys.isVisible() and not hint.isVisible()
    assert panel.sizeHint().height() <= height, "the strip takes no more room"
    panel.set_low(False)
    assert panel.keys.isVisible() and panel.sizeHint().height() > height
    qtbot.waitUntil(lambda: facts.visibleRegion().boundingRect().height() == facts.height())  # and is not cut
    panel.set_low(True)
    for name, words in (("keys", "Surface: Keys"), ("neck", "Surface: Strings")):  # also the one checked already
        panel.set_unfolded(True)
        click(qtbot, panel, words)
        assert (panel.unfolded, panel.knobs.isVisible(), panel.surface) == (False, False, name)
        assert panel.findChild(QStackedWidget).isVisible()


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
    assert button.isHidden()
    qtbot.mouseClick(panel.neck, RIGHT, pos=panel.neck.cell(0, 3).center().toPoint())
    assert panel.neck.fingers == {0: 3}
    for surface, hidden in (("neck", False), ("keys", True), ("neck", False)):
        panel.show_surface(surface)
        assert button.isHidden() == hidden
    qtbot.mouseClick(button, LEFT)
    assert panel.neck.fingers == {} and button.isHidden()
    panel.set_drums(True)
    assert not panel.touch.isEnabled() and not panel.techniques.isEnabled()


def test_macros_are_those_of_the_instrument_and_say_what_they_change(bar, guitar):
    def shown(*macros: Macro) -> int:
        bar.show_instrument(guitar.model_copy(update={"macros": macros}), own=True)
        return sum(knob.isVisible() for knob in bar.macros)

    values = [(knob.accessibleName(), knob.value) for knob in bar.macros if knob.isVisible()]
    assert values == [(each.name, each.value) for each in guitar.macros]
    turned = reported(bar.macro_turned)
    press_keys(bar.macros[1], Qt.Key.Key_Home)
    assert turned == [(1, 0.0)]
    for fields, words in (
        (("pluck.position", "knobs.brightness_decay"), "Tone: changes pluck position, HF loss"),
        (("pickup.points.0",), "Tone: changes listening point"),  # of the same name, with other targets
    ):
        macro = Macro(name="Tone", targets=tuple(MacroTarget(field=field, low=0.2, high=0.4) for field in fields))
        assert shown(macro) == 1 and bar.macros[0].toolTip().splitlines()[0] == words
    assert (shown(*[macro] * 8), shown()) == (8, 0)


def test_the_record_button_and_the_menu_beside_it(qtbot, bar, monkeypatch):
    for seconds, text in ((73.4, "■  1:13"), (3.0, "■  0:03"), (-0.2, "■  −1"), (-1.5, "■  −2"), (None, "●  Record")):
        bar.show_recording(seconds)
        assert (bar.record.text(), bar.record.isChecked()) == (text, seconds is not None)
    menu, played = bar.takes, list[str]()
    for _ in range(2):
        assert menu.actions()[0].text() == "No takes yet" and not menu.actions()[0].isEnabled()
        menu.show_takes([("a & b:  12:01, 3 s", {"Play": lambda: played.append("a & b")}), ("c", {"Play": list})])
        assert [each.text() for each in menu.actions()[:2]] == ["a && b:  12:01, 3 s", "c"]
        menu.actions()[0].menu().actions()[0].trigger()  # type: ignore[union-attr]
        menu.show_takes(())
    assert played == ["a & b", "a & b"]
    actions = {each.text(): each for part in (menu, *menu.findChildren(QMenu)) for each in part.actions()}
    typed = iter(["1e9", "90 or so", "90"])  # the first two are asked again
    monkeypatch.setattr(QInputDialog, "getText", lambda *_, text: (next(typed), bool(text)))
    for name in ("Metronome", "2 bars", "Tempo: 120 beats a minute …", "3"):
        actions[name].trigger()
    assert menu.meter == Meter(count_in_bars=2, metronome=True, tempo_bpm=90, beats=3) and not list(typed)
    assert {name for name, each in actions.items() if each.isChecked()} == {"Metronome", "2 bars", "3"}
    with qtbot.waitSignal(bar.record_asked):
        qtbot.mouseClick(bar.record, LEFT)


def test_a_scale_is_chosen_shown_by_name_and_left_again(bar, guitar):
    keymap = "2\n0\n127\n60\n69\n440\n2\n0\n1\n"
    actions = {each.text(): each for each in bar.scale.menu().actions()}
    asked = reported(bar.scale_asked)
    for tuning, text, chosen in (
        ({"scale": SCALES["Vallotti"]}, "Vallotti", "Vallotti"),
        ({"keymap": keymap}, "Twelve equal steps", "Twelve equal steps"),
        ({}, "Scale", "Twelve equal steps"),
    ):
        bar.show_instrument(guitar.model_copy(update={"tuning": TuningChoice(**tuning)}), own=True)
        assert (bar.scale.text(), "keyboard mapping" in bar.scale.toolTip()) == (f"{text}  ▾", "keymap" in tuning)
        assert [name for name, each in actions.items() if each.isChecked()] == [chosen]
        actions[chosen].trigger()
    assert asked == ["Vallotti", "", ""]
    bar.show_instrument(
        guitar.model_copy(update={"tuning": TuningChoice(scale="Two <b>halves</b>\n 1\n 2/1\n")}), own=True
    )
    assert bar.scale.text() == "Two <b>halves</b>  ▾" and "<b>" not in bar.scale.toolTip()


@pytest.fixture
def knobs(show: Callable[..., StringKnobs], guitar: Instrument) -> StringKnobs:
    made = show(StringKnobs(), 1200, 110)
    made.show_instrument(guitar)
    return made


def test_every_field_is_shown_can_be_turned_to_both_ends_and_its_name_fits(knobs, guitar):
    stereo = guitar.model_copy(update={"pickup": Pickup(points=(0.1, 0.6))})
    knobs.show_instrument(stereo)
    metrics = QFontMetrics(theme.small_font(9, grows=False))
    for field, knob in knobs.knobs.items():
        assert metrics.horizontalAdvance(knob.accessibleName().upper()) <= knob.sizeHint().width(), field
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
    assert knobs.shape.currentText() == "Rounded"
    shapes = [knobs.shape.itemText(row) for row in range(knobs.shape.count())]
    assert shapes == ["Gaussian", "Triangle", "Raised cosine", "Rounded"]


def test_what_a_instrument_does_not_have_cannot_be_turned_and_the_tip_says_why(knobs, guitar):
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


def test_knobs_hidden_while_text_grew_have_their_room(show, own_look):
    knobs = StringKnobs()
    row = show(Sideways(knobs), 700, 200)
    row.hide()
    theme.apply_theme(own_look, "dark", 150)
    row.show()
    QApplication.processEvents()
    assert all(knob.width() >= knob.sizeHint().width() for knob in knobs.knobs.values())
    assert knobs.shape.geometry().right() < knobs.knobs["pluck.position"].geometry().left()
    theme.apply_theme(own_look, "dark")


def entry(guitar: Instrument, name: str, own: bool = False, **changes: object) -> InstrumentEntry:
    folder = Path("/own") if own else SHIPPED
    return InstrumentEntry(folder / f"{name}.json", guitar.model_copy(update={"name": name, **changes}))


def fill(browser: Browser, entries: list[InstrumentEntry], chosen: str) -> None:
    browser.show_rows([instrument_row(each) for each in entries], {"steel"}, chosen, "/own")


def place(browser: Browser, row: int) -> QRect:
    return browser.list.visualRect(browser.list.model().index(row, 1))


def state(browser: Browser) -> tuple[str, str]:
    """What is selected, and what the list has as its current row."""
    return browser.selected, str(browser.list.currentIndex().data())


@pytest.fixture
def browser(qtbot: QtBot, guitar: Instrument) -> Iterator[Browser]:
    """Of nylon, steel, which is a favourite and loaded, one's own and a harp."""
    window = QWidget()
    qtbot.addWidget(window)
    window.resize(1280, 800)
    made = instrument_browser(window)
    entries = [
        entry(guitar, "nylon"),
        entry(guitar, "steel", description="Bright and long"),
        entry(guitar, "mine", own=True),
        entry(guitar, "harp of brass", category="harp"),
    ]
    fill(made, entries, "steel")
    window.show()
    made.show_over()
    yield made
    made.dismiss()


@pytest.fixture
def chosen(browser: Browser) -> list[str]:
    return reported(browser.chosen)


def test_words_in_any_order_category_owner_and_favourites_filter(browser):
    for words, name, key, listed in (
        ("BRASS harp", "", "", ["harp of brass"]),
        ("long", "", "", ["steel"]),
        ("guitar mi", "", "", ["mine"]),
        ("", "Category", "harp", ["harp of brass"]),
        ("", "Bank", "user", ["mine"]),
        ("", "starred", "", ["steel"]),
    ):
        browser.search.setText(words)
        browser.starred.setChecked(name == "starred")
        if key:
            browser.filters[name].setCurrentIndex(browser.filters[name].findData(key))
        assert browser.listed == listed
        browser.clear_filter()
        assert len(browser.listed) == 4
    browser.search.setText("tuba")
    assert browser.listed == []
    browser.dismiss()
    assert browser.listed, "closed without any, next and previous would lead nowhere"


def test_arrows_load_and_play_and_a_hit_is_only_shown(qtbot, browser, chosen):
    with qtbot.waitSignal(browser.played) as heard:
        for _ in range(3):
            press_keys(browser.search if not chosen else browser.list, Key.Key_Down)
    assert chosen == ["nylon", "mine", "harp of brass"] and heard.args == ["harp of brass"]
    press_keys(browser.list, Key.Key_PageUp)
    assert chosen.pop() == "steel"
    asked = reported(browser.favourite_asked, browser.played)
    browser.search.setText("harp")
    assert state(browser) == ("harp of brass", "harp of brass") and "<b>harp of brass</b>" in browser.card.text()
    qtbot.mouseClick(browser.star, LEFT)
    assert (asked, len(chosen)) == (["harp of brass"], 3), "it is shown, not loaded"
    qtbot.mouseClick(browser.play_button, LEFT)
    assert asked[1:] == chosen[3:] == ["harp of brass"]


def test_a_hit_by_name_is_better_than_one_by_description(qtbot, browser, guitar):
    entries = [entry(guitar, "bass", description="Starts sharp"), entry(guitar, "nylon"), entry(guitar, "brass harp")]
    fill(browser, entries, "nylon")
    for words, selected in (("harp", "brass harp"), ("starts", "bass")):
        browser.search.setText(words)
        assert browser.selected == selected
    browser.set_chosen("bass")
    browser.search.setText("harp")
    assert (browser.listed, browser.selected) == (["bass", "brass harp"], "brass harp"), "although bass is loaded"
    qtbot.mouseClick(browser.list.viewport(), LEFT, pos=place(browser, 1).center())
    assert browser.selected == "bass" and "<b>bass</b>" in browser.card.text()


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

"""What a file says is shown as it is: no label and no tip takes it for markup, which would load what it names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QAction
from PySide6.QtGui import Qt as GuiQt
from PySide6.QtWidgets import QLabel, QListWidget, QTextEdit, QTreeWidget, QWidget
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.export.sampled.choices import SampledChoices
from app.instruments.library import SHIPPED, InstrumentEntry, read_instrument
from app.presets.library import Library, PresetEntry
from app.session.choices import Choices
from app.views.controls.choosers import PresetBar
from app.views.controls.elided_label import Readout
from app.views.controls.notice_bar import NoticeBar
from app.views.controls.plain import Label, plain_tip
from app.views.controls.slot_buttons import SlotButtons
from app.views.dialogs.export_dialog import ExportDialog
from app.views.dialogs.export_pages import HeardInstrument
from app.views.dialogs.preset_card import preset_browser, preset_row
from app.views.instrument.instrument_card import instrument_browser, instrument_row
from app.views.instrument.panel import InstrumentPanel
from app.window.exports import heard_note
from engine.presets import read_info
from tests.app.places import places_in

EVIL = "<img src=evil>"


@pytest.fixture
def entry(small_preset: Path) -> PresetEntry:
    words = {name: f"{name} {EVIL}" for name in ("title", "description", "knows", "licence", "initialisation")}
    return PresetEntry(f"name {EVIL}", Path("/x") / f"{EVIL}.safetensors", replace(read_info(small_preset), **words))


def formatted(root: QWidget) -> Iterator[str]:
    """Every text beneath a widget that Qt would take for HTML: labels, editors, tips."""
    for label in [*root.findChildren(QLabel), *([root] if isinstance(root, QLabel) else [])]:
        rich = label.textFormat() == Qt.TextFormat.RichText
        if rich or (label.textFormat() == Qt.TextFormat.AutoText and GuiQt.mightBeRichText(label.text())):
            yield label.text()
    for editor in root.findChildren(QTextEdit):
        yield editor.toHtml()
    tips = [each.toolTip() for each in [root, *root.findChildren(QWidget), *root.findChildren(QAction)]]
    for tree in root.findChildren(QTreeWidget):
        items = [tree.topLevelItem(row) for row in range(tree.topLevelItemCount())]
        tips += [item.toolTip(column) for item in items if item for column in range(tree.columnCount())]
    for view in root.findChildren(QListWidget):
        tips += [view.item(row).toolTip() for row in range(view.count())]
    yield from filter(GuiQt.mightBeRichText, tips)


def texts(root: QObject) -> str:
    labels = [*root.findChildren(QLabel), *([root] if isinstance(root, QLabel) else [])]
    return "\n".join([*(label.text() for label in labels), *(each.toolTip() for each in root.findChildren(QWidget))])


def test_no_view_that_holds_a_files_text_takes_it_for_markup(
    qtbot: QtBot, entry: PresetEntry, tmp_path: Path
) -> None:
    notices, bar, slots, browser, readout = NoticeBar(), PresetBar(), SlotButtons(), preset_browser(), Readout()
    dialog = ExportDialog((ExportChoices(), SampledChoices()), places_in(tmp_path / EVIL))
    instrument = read_instrument(SHIPPED / "classical_guitar.json")
    note = heard_note(Choices(single=entry.name), Library([entry]), None)
    dialog.show_subjects({"note": note, "sampler": HeardInstrument(instrument, entry)})
    views: list[QWidget] = [notices, bar, bar.card, slots, browser, readout, dialog]
    for view in views:
        qtbot.addWidget(view)
    notices.report(f"{EVIL}: tensor {EVIL} is unknown", EVIL)
    notices.show_all()
    bar.set_chosen(entry)
    slots.set_entries([entry])
    slots.show_choices(Choices(a=f"preset:{entry.name}", b="difference"))
    browser.show_rows([preset_row(entry)], (), entry.name, str(tmp_path / EVIL))
    readout.report(EVIL)
    for view in views:
        assert [text for text in formatted(view) if EVIL in text] == [], type(view).__name__
    assert "evil" in texts(notices)  # and it is shown


def test_a_instrument_is_shown_as_it_is(qtbot: QtBot) -> None:
    """Its name can hold no markup, for it is a file's; its other texts can."""
    instrument = read_instrument(SHIPPED / "classical_guitar.json")
    macros = tuple(macro.model_copy(update={"name": EVIL}) for macro in instrument.macros)
    body = instrument.body.model_copy(update={"name": EVIL})
    instrument = instrument.model_copy(update={"description": EVIL, "author": EVIL, "macros": macros, "body": body})
    entry = InstrumentEntry(Path("/x") / f"{EVIL}.json", instrument)
    panel, browser = InstrumentPanel(), instrument_browser()
    views: list[QWidget] = [panel, browser]
    for view in views:
        qtbot.addWidget(view)
    panel.bar.show_instrument(instrument, own=True, changed=True)
    panel.bar.show_note(EVIL)
    panel.knobs.facts.show_facts({EVIL: EVIL})
    panel.neck.set_strings([(EVIL, 40), (EVIL, 45)])
    browser.show_rows([instrument_row(entry)], (), entry.name, EVIL)
    for view in views:
        assert [text for text in formatted(view) if EVIL in text] == [], type(view).__name__
        assert "evil" in texts(view)


def test_labels_are_made_in_one_place() -> None:
    """A QLabel of its own would look at its text and guess; the preset's card alone is HTML, and escapes."""
    app = Path(__file__).parents[3] / "app"
    made = [
        path.relative_to(app).as_posix()
        for path in sorted(app.rglob("*.py"))
        if "QLabel(" in path.read_text("utf-8").replace("(QLabel)", "")
    ]
    assert made == []


def test_a_tip_or_a_label_shows_what_it_is_given(qtbot: QtBot) -> None:
    label = Label(EVIL)
    qtbot.addWidget(label)
    assert label.textFormat() == Qt.TextFormat.PlainText
    assert plain_tip("2 < 3\nand on") == "2 < 3\nand on"
    assert "&lt;img" in plain_tip(EVIL) and "<img" not in plain_tip(EVIL)

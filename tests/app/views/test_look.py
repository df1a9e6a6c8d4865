"""Both themes can be read, and what a file says is shown as it is: no label and no tip takes it for markup."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QAction, QColor
from PySide6.QtGui import Qt as GuiQt
from PySide6.QtWidgets import QLabel, QListWidget, QTextEdit, QTreeWidget, QWidget

from app.export.choices import ExportChoices
from app.export.sampled.choices import SampledChoices
from app.instruments.library import SHIPPED, InstrumentEntry, read_instrument
from app.presets.library import Library, PresetEntry
from app.session.choices import Choices
from app.views import theme
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


@pytest.mark.parametrize("chosen", [theme.DARK, theme.LIGHT], ids=["dark", "light"])
def test_text_can_be_read_on_every_ground_and_no_two_roles_share_a_colour(chosen):
    for ground in (chosen.background, chosen.panel, chosen.raised, chosen.ground_top, chosen.ground_bottom):
        for text in (chosen.text, chosen.faint, chosen.model, chosen.truth, chosen.warning, chosen.good):
            assert theme.contrast(text, ground) >= 4.5, (text, ground)
    for filled in (chosen.model, chosen.truth, chosen.good):  # the text of a checked button
        assert theme.contrast(chosen.background, filled) >= 4.5
    colours = chosen.colours.values()
    assert len({QColor(colour).rgb() for colour in colours}) == len(colours)


EVIL = "<img src=evil>"


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


def test_no_view_takes_a_files_text_for_markup(qtbot, small_preset, tmp_path):
    """An instrument's name can hold no markup, for it is a file's; its other texts can."""
    words = {name: f"{name} {EVIL}" for name in ("title", "description", "knows", "licence", "initialisation")}
    path = Path("/x") / f"{EVIL}.safetensors"
    entry = PresetEntry(f"name {EVIL}", path, replace(read_info(small_preset), **words))
    guitar = read_instrument(SHIPPED / "classical_guitar.json")
    macros = tuple(macro.model_copy(update={"name": EVIL}) for macro in guitar.macros)
    body = guitar.body.model_copy(update={"name": EVIL})
    instrument = guitar.model_copy(update={"description": EVIL, "author": EVIL, "macros": macros, "body": body})
    notices, bar, slots, readout = NoticeBar(), PresetBar(), SlotButtons(), Readout()
    presets, instruments, panel = preset_browser(), instrument_browser(), InstrumentPanel()
    dialog = ExportDialog((ExportChoices(), SampledChoices()), places_in(tmp_path / EVIL))
    views: list[QWidget] = [notices, bar, bar.card, slots, presets, instruments, panel, readout, dialog]
    for view in views:
        qtbot.addWidget(view)
    note = heard_note(Choices(single=entry.name), Library([entry]), None)
    dialog.show_subjects({"note": note, "sampler": HeardInstrument(guitar, entry)})
    notices.report(f"{EVIL}: tensor {EVIL} is unknown", EVIL)
    notices.show_all()
    bar.set_chosen(entry)
    slots.set_entries([entry])
    slots.show_choices(Choices(a=f"preset:{entry.name}", b="difference"))
    presets.show_rows([preset_row(entry)], (), entry.name, str(tmp_path / EVIL))
    readout.report(EVIL)
    panel.bar.show_instrument(instrument, own=True, changed=True)
    panel.bar.show_note(EVIL)
    panel.knobs.facts.show_facts({EVIL: EVIL})
    panel.neck.set_strings([(EVIL, 40), (EVIL, 45)])
    own = InstrumentEntry(Path("/x") / f"{EVIL}.json", instrument)
    instruments.show_rows([instrument_row(own)], (), own.name, EVIL)
    for view in views:
        assert [text for text in formatted(view) if EVIL in text] == [], type(view).__name__
    assert all("evil" in texts(view) for view in (notices, panel, instruments)), "and it is shown"


def test_labels_are_made_in_one_place_and_show_the_text_as_it_is(qtbot):
    """A QLabel of its own would look at its text and guess; the preset's card alone is HTML, and escapes."""
    sources = sorted((Path(__file__).parents[3] / "app").rglob("*.py"))
    assert [each for each in sources if "QLabel(" in each.read_text("utf-8").replace("(QLabel)", "")] == []
    label = Label(EVIL)
    qtbot.addWidget(label)
    assert label.textFormat() == Qt.TextFormat.PlainText
    assert plain_tip("2 < 3\nand on") == "2 < 3\nand on"
    assert "&lt;img" in plain_tip(EVIL) and "<img" not in plain_tip(EVIL)

"""Instruments in their browser: a row each, and a card with its description and its model."""

from __future__ import annotations

from html import escape

from PySide6.QtWidgets import QApplication, QWidget

from app.instruments.library import InstrumentEntry
from app.shared.key_names import note_name
from app.views.controls.browser import Browser
from app.views.controls.browser_rows import BrowserColumn, BrowserRow

MODES = {"guitar": "one MIDI channel per string", "mpe": "MPE"}


def instrument_browser(parent: QWidget | None = None) -> Browser:
    """The browser of instruments, without rows yet; an instrument that arrows load is played too."""
    return Browser(
        "instruments",
        "name, category, description, author",
        (BrowserColumn("Instrument"),),
        (("Category", "All categories"), ("Bank", "Factory + User")),
        ("By category",),
        "Play a note",
        at_rest=True,
        size=(1000, 520, 240),
        folder_tip="Show the folder of your instruments, to which Save writes. Files dropped here are loaded",
        parent=parent,
    )


def instrument_row(entry: InstrumentEntry) -> BrowserRow:
    """The row of an instrument in the browser, under its category."""
    instrument = entry.instrument
    bank = ("user", "User") if entry.own else ("factory", "Factory")
    return BrowserRow(
        entry.name,
        f"{instrument.name}{'   (own)' if entry.own else ''}",
        instrument.category.upper(),
        f"{instrument.name} {instrument.category} {instrument.description} {instrument.author}".casefold(),
        ((instrument.category, instrument.category.capitalize()), bank),
        lambda: instrument_card(entry),
        tip=f"{instrument.name}\n{instrument.description}".strip(),
        own=entry.own,
    )


def instrument_card(entry: InstrumentEntry) -> str:
    """The card of an instrument as rich text: name, description, and facts such as strings and range of keys."""
    instrument, faint = entry.instrument, QApplication.palette().placeholderText().color().name()
    low, high = instrument.range
    strings = "one string, shortened for every key"
    if instrument.strings.kind == "drums":
        keys = "a key each" if instrument.strings.keys == "pads" else "tuned to every key"
        strings = (
            f"{len(instrument.strings.drums)} drums, {keys}"
            if len(instrument.strings.drums) > 1
            else f"one drum, {keys}"
        )
    elif instrument.strings.kind == "set":
        strings = f"{len(instrument.strings.strings)} strings"
    lines = [strings, f"{note_name(low)} to {note_name(high)}"]
    if instrument.mode != "poly":
        lines.append(MODES[instrument.mode])
    if instrument.body.name:
        lines.append(f"body: {instrument.body.name}")
    if instrument.macros:
        lines.append(f"knobs: {', '.join(macro.name for macro in instrument.macros)}")
    lines += [f"model: {instrument.preset}", entry.path.name]
    by = f"   ·   {instrument.author}" if instrument.author else ""
    kind = f"{instrument.category.capitalize()}   ·   {'your own' if entry.own else 'factory'}{by}"
    facts = "<br>".join(map(escape, lines))
    return (
        f"<p style='font-size: 15px'><b>{escape(instrument.name)}</b></p><p style='color: {faint}'>{escape(kind)}</p>"
        f"<p>{escape(instrument.description)}</p><p style='color: {faint}'>{facts}</p>"
    )

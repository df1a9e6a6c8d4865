"""Patches in their browser: a row each, and a card with its description and its model."""

from __future__ import annotations

from html import escape

from PySide6.QtWidgets import QApplication, QWidget

from app.patches.library import PatchEntry
from app.shared.key_names import note_name
from app.views.controls.browser import Browser
from app.views.controls.browser_rows import BrowserColumn, BrowserRow

MODES = {"guitar": "one MIDI channel per string", "mpe": "MPE"}


def patch_browser(parent: QWidget | None = None) -> Browser:
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


def patch_row(entry: PatchEntry) -> BrowserRow:
    """The row of a patch in the browser, under its category."""
    patch = entry.patch
    bank = ("user", "User") if entry.own else ("factory", "Factory")
    return BrowserRow(
        entry.name,
        f"{patch.name}{'   (own)' if entry.own else ''}",
        patch.category.upper(),
        f"{patch.name} {patch.category} {patch.description} {patch.author}".casefold(),
        ((patch.category, patch.category.capitalize()), bank),
        lambda: patch_card(entry),
        tip=f"{patch.name}\n{patch.description}".strip(),
        own=entry.own,
    )


def patch_card(entry: PatchEntry) -> str:
    """Name, description and facts."""
    patch, faint = entry.patch, QApplication.palette().placeholderText().color().name()
    low, high = patch.range
    strings = "one string, shortened for every key"
    if patch.strings.kind == "drums":
        keys = "a key each" if patch.strings.keys == "pads" else "tuned to every key"
        strings = f"{len(patch.strings.drums)} drums, {keys}" if len(patch.strings.drums) > 1 else f"one drum, {keys}"
    elif patch.strings.kind == "set":
        strings = f"{len(patch.strings.strings)} strings"
    lines = [strings, f"{note_name(low)} to {note_name(high)}"]
    if patch.mode != "poly":
        lines.append(MODES[patch.mode])
    if patch.body.name:
        lines.append(f"body: {patch.body.name}")
    if patch.macros:
        lines.append(f"knobs: {', '.join(macro.name for macro in patch.macros)}")
    lines += [f"model: {patch.preset}", entry.path.name]
    by = f"   ·   {patch.author}" if patch.author else ""
    kind = f"{patch.category.capitalize()}   ·   {'your own' if entry.own else 'factory'}{by}"
    facts = "<br>".join(map(escape, lines))
    return (
        f"<p style='font-size: 15px'><b>{escape(patch.name)}</b></p><p style='color: {faint}'>{escape(kind)}</p>"
        f"<p>{escape(patch.description)}</p><p style='color: {faint}'>{facts}</p>"
    )

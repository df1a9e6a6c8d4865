"""Presets in their browser: a row each, and a card on their nature, quality and origin."""

from __future__ import annotations

from html import escape

from PySide6.QtWidgets import QApplication, QWidget

from app.presets.library import PresetEntry
from app.presets.words import (
    error_word,
    initial_word,
    model_meaning,
    model_word,
    percent,
    rate_word,
    size_word,
    string_word,
)
from app.views.controls.browser import Browser
from app.views.controls.browser_rows import BrowserColumn, BrowserRow
from engine.plain_text import duration
from engine.schema import SchemaError
from training.cell import load
from training.heard_words import HEARD_TIP, heard_sentence, heard_word

HEADINGS = {True: "STUDIO PRESETS", False: "RESEARCH PRESETS"}
STRINGS = {"linear": "Linear", "nonlinear": "With pitch glide"}
COLUMNS = (
    BrowserColumn("Preset"),
    BrowserColumn("Rate", "Sample rate of the model", right=True),
    BrowserColumn("Error", "Relative mean absolute error of the model on validation data", right=True),
    BrowserColumn("Heard", HEARD_TIP),
)


def preset_browser(parent: QWidget | None = None) -> Browser:
    """The browser of presets, without rows yet; arrows load a preset and do not pluck it."""
    return Browser(
        "presets",
        "title, model, string, rate, audible errors",
        COLUMNS,
        (("String", "All strings"), ("Model", "All models"), ("Rate", "All rates")),
        ("Most accurate first", "By name", "Smallest error"),
        "Pluck",
        at_rest=False,
        size=(1240, 560, 140),
        folder_tip="Show the folder of your presets; a preset file dropped on the window is copied there",
        parent=parent,
    )


def preset_row(entry: PresetEntry) -> BrowserRow:
    """The row of a preset in the browser: studio presets before research ones; unknown errors come last."""
    info, test_result = entry.info, heard_word(entry.heard)
    model, rate = model_word(info.model), rate_word(info.rate_hz)
    kind = string_word(info.tension_modulated)
    searched = (
        *(info.title, entry.name, info.description, info.model, model, kind),
        *(initial_word(info.initial), rate, f"{info.rate_hz}", test_result),
    )
    distance_db = None if entry.heard is None else entry.heard.distance_db
    return BrowserRow(
        entry.name,
        entry.title,
        HEADINGS[entry.studio],
        " ".join(searched).casefold(),
        ((info.string_kind, STRINGS[info.string_kind]), (info.model, model), (info.rate_hz, rate)),
        lambda: preset_card(entry),
        ((rate, ""), (error_word(info), ""), (test_result, heard_sentence(entry.heard, entry.name))),
        f"{entry.title}\n{model}, {kind}\n{entry.path.name}",
        tuple((known is None, known or 0.0) for known in (distance_db, 0.0, info.rel_mae)),
    )


def preset_card(entry: PresetEntry) -> str:
    """Title, description and a table of facts; what the preset does not say is left out."""
    info = entry.info
    faint = QApplication.palette().placeholderText().color().name()
    rows = "".join(
        f"<tr><td style='color: {faint}; padding: 3px 14px 3px 0; white-space: nowrap'>{name}</td>"
        f"<td style='padding: 3px 0'>{escape(text)}</td></tr>"
        for name, text in _facts(entry)
    )
    title = f"<p style='font-size: 15px'><b>{escape(info.title)}</b></p>"
    what = f"<p style='margin-bottom: 12px'>{escape(info.description)}</p>"
    return f"{title}{what}<table>{rows}</table>"


def preset_summary(entry: PresetEntry) -> list[str]:
    """A preset's facts in one line, in wordings for less and less room; the error is in all of them."""
    info = entry.info
    model, rate = model_word(info.model), rate_word(info.rate_hz)
    string = "tension-modulated string" if info.tension_modulated else "linear string"
    trained, parameters = f"trained on {duration(info.horizon_s)}", f"{entry.parameters:,} parameters"
    error = [f"validation error {error_word(info)}"] if info.rel_mae is not None else []
    if error and info.test_rel_mae is not None:
        error = [f"{error[0]}, test {percent(info.test_rel_mae)}"]
    wordings = (
        (model, parameters, string, f"{rate}, {info.modes} modes", trained),
        (model, string, f"{rate}, {info.modes} modes", trained),
        (model, f"{rate}, {info.modes} modes", trained),
        (model, rate),
        (model,),
    )
    return ["  ·  ".join([*parts, *error]) for parts in wordings]


def _facts(entry: PresetEntry) -> list[tuple[str, str]]:
    """The rows of a card, (name, words) each; facts that the preset does not state are left out."""
    info = entry.info
    meaning = model_meaning(info.model)
    facts = [
        ("String", f"{string_word(info.tension_modulated)}, {info.string.length_m:g} m, {info.modes} partials"),
        ("Model", model_word(info.model) + (f": {meaning}" if meaning else "")),
        ("Size", f"{entry.parameters:,} parameters, {size_word(entry.size_bytes)}"),
        ("Rate", f"{rate_word(info.rate_hz)}: no sound above {rate_word(info.rate_hz // 2)}"),
        (
            "Trained on",
            f"the first {duration(info.horizon_s)} ({initial_word(info.initial)}); past that it extrapolates",
        ),
    ]
    audible = info.string.modes_below(info.rate_hz / 2)
    if audible < info.modes:
        facts.append(
            ("Aliased", f"partials {audible + 1} … {info.modes} lie above half the rate, in model and truth")
        )
    if info.rel_mae is not None:
        test = "" if info.test_rel_mae is None else f", on the test set {percent(info.test_rel_mae)}"
        facts.append(("Error", f"{percent(info.rel_mae)} of the motion in validation{test}"))
    facts.append(("Given", f"before training: {info.knows or 'nothing but the displacement'}"))
    facts.append(("Heard", heard_sentence(entry.heard, entry.name)))
    if info.training_seconds is not None:
        facts.append(("Trained in", duration(info.training_seconds)))
    if _can_be_remade(entry.name):
        facts.append(("To train it", f"learned-strings train {entry.name}"))
    place = "your own" if entry.own else "shipped with the program"
    facts += [("Licence", info.licence), ("File", f"{entry.name}, {place}")]
    return facts


def _can_be_remade(name: str) -> bool:
    """Return True if the command line knows a training of this name."""
    try:
        load(name)
    except (SchemaError, ValueError, OSError):
        return False
    return True

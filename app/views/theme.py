"""Colours, fonts and the style sheet (`sheet.qss`). A theme, dark or light, has a colour for each role.

Read the colours as `theme.TEXT` when painting; never import one by name, for they change with the theme. Plots keep
the pens that they were made with: `app.views.plots.plots.recolour` exchanges these.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QColor, QFont, QPalette
from PySide6.QtWidgets import QApplication, QWidget

ThemeChoice = Literal["system", "dark", "light"]


ROLES = {  # role -> its colour in the dark and in the light theme
    "background": ("#0d0f13", "#eceef2"),
    "panel": ("#14171d", "#fafbfc"),
    "raised": ("#1d2129", "#ffffff"),
    "line": ("#2b313c", "#c6ccd6"),
    "text": ("#d8dde6", "#1b2029"),
    "faint": ("#8a93a3", "#596272"),
    "disabled": ("#555d6b", "#9aa2b0"),
    "model": ("#ffb03a", "#a05a00"),  # amber in every view
    "truth": ("#4cc3e8", "#00698f"),  # blue in every view
    "difference": ("#e58fd0", "#a3327f"),  # model − truth
    "other": ("#b5a3ff", "#5b45b8"),  # another preset's model
    "warning": ("#ff6b5e", "#b3261e"),
    "good": ("#58c98b", "#1a7044"),
    "ground_top": ("#171b22", "#fdfdfe"),  # of the gradient behind the string
    "ground_bottom": ("#101317", "#f3f5f8"),
    "shade": ("#46000000", "#1a4a5568"),  # over plucks outside the training range, with its alpha
}


@dataclass(frozen=True)
class Theme:
    """The dark or the light theme; `scale`: of text, and of what holds it. Each role is an attribute."""

    dark: bool
    scale: float = 1.0

    @property
    def colours(self) -> dict[str, str]:
        return {role: dark if self.dark else light for role, (dark, light) in ROLES.items()}

    def __getattr__(self, role: str) -> str:
        if role not in ROLES:
            raise AttributeError(role)
        return ROLES[role][0 if self.dark else 1]


DARK, LIGHT = Theme(dark=True), Theme(dark=False)

FONT_PX = 12  # at a text size of 100 %
SHEET = Path(__file__).with_name("sheet.qss")
SIGNS = Path(__file__).parent / "signs"  # pictures for the style sheet, in the themes' colours

_SCHEMES: dict[ThemeChoice, Qt.ColorScheme] = {
    "system": Qt.ColorScheme.Unknown,
    "dark": Qt.ColorScheme.Dark,
    "light": Qt.ColorScheme.Light,
}

present = DARK  # the theme in use, which `use` exchanges
SOURCE_COLOURS = {kind: getattr(DARK, kind) for kind in ("model", "truth", "difference", "other")}


def __getattr__(name: str) -> str:
    """The present theme's colour of a role, as `theme.TEXT`."""
    return str(getattr(present, name.lower()))


def is_dark() -> bool:
    return present.dark


def source_kind(source: str) -> str:
    """The key of `SOURCE_COLOURS` for a source: "other" for "preset:NAME"."""
    return source if source in SOURCE_COLOURS else "other"


class _Changes(QObject):
    theme_changed = Signal(Theme, Theme)  # from, to


changes = _Changes()


def use(new: Theme) -> None:
    """Make `new` the present theme and emit `changes.theme_changed`; the style sheet is set by `apply_theme`."""
    global present
    old, present = present, new
    SOURCE_COLOURS.update({kind: getattr(new, kind) for kind in SOURCE_COLOURS})
    if new != old:
        changes.theme_changed.emit(old, new)


def contrast(one: str, other: str) -> float:
    """WCAG's ratio of two colours, 1 … 21; text needs 4.5, large text and symbols 3."""
    low, high = sorted(_luminance(QColor(colour)) for colour in (one, other))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: QColor) -> float:
    """The relative luminance of WCAG, 0 … 1."""
    linear = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
        for c in (colour.redF(), colour.greenF(), colour.blueF())
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _style_sheet() -> str:
    """The text of `sheet.qss` in the present theme: colours for @role, a line per source for @source, sizes grown."""
    tick = SIGNS / f"tick_{'dark' if is_dark() else 'light'}.svg"
    values = {**present.colours, "tick": tick.as_posix()}
    lines = [
        line.replace("@source", source)
        for line in SHEET.read_text("utf-8").splitlines()
        for source in (SOURCE_COLOURS if "@source" in line else [""])
    ]
    sheet = re.sub(r"font-size: (\d+)px", lambda match: f"font-size: {px(int(match[1]))}px", "\n".join(lines))
    return re.sub(r"@(\w+)", lambda match: values[match[1]], sheet)


def _palette() -> QPalette:
    """The palette of Qt in the colours of the present theme."""
    palette = QPalette()
    roles = QPalette.ColorRole
    for role, colour in {
        roles.Window: present.background,
        roles.Base: present.raised,
        roles.AlternateBase: present.panel,
        roles.Button: present.raised,
        roles.Text: present.text,
        roles.WindowText: present.text,
        roles.ButtonText: present.text,
        roles.PlaceholderText: present.faint,
        roles.ToolTipBase: present.raised,
        roles.ToolTipText: present.text,
        roles.Highlight: present.truth,
        roles.HighlightedText: present.background,
        roles.Link: present.truth,
    }.items():
        palette.setColor(role, QColor(colour))
    return palette


def apply_theme(app: QApplication, choice: ThemeChoice = "dark", size_percent: int = 100) -> None:
    """Set Fusion with the theme's palette and style sheet for the application; "system" follows the desktop.

    `size_percent`: of text.
    """
    app.setStyleSheet("")  # replaced directly, a sheet is applied to a widget once more for each of its ancestors
    if app.style().name() != "fusion":  # while a sheet is set, the style has no name
        app.setStyle("Fusion")
    hints = app.styleHints()
    hints.setColorScheme(_SCHEMES[choice])  # the window's frame and the file dialogs follow
    light = choice == "light" or (choice == "system" and hints.colorScheme() == Qt.ColorScheme.Light)
    use(replace(LIGHT if light else DARK, scale=size_percent / 100))
    app.setPalette(_palette())
    font = app.font()  # of what no style sheet reaches: axes of plots
    font.setPixelSize(px(FONT_PX))
    app.setFont(font)
    app.setStyleSheet(_style_sheet())


def px(pixels: float) -> int:
    """Pixels that grow with the text."""
    return round(pixels * present.scale)


class _Fixed(QObject):
    """The size of a widget, which grows with the text; lives as long as the widget."""

    def __init__(self, widget: QWidget, width: int | None, height: int | None) -> None:
        super().__init__(widget)
        self._widget = widget
        self._width = width
        self._height = height
        changes.theme_changed.connect(self.fit)
        self.fit()

    def fit(self) -> None:
        if self._width is not None:
            self._widget.setFixedWidth(px(self._width))
        if self._height is not None:
            self._widget.setFixedHeight(px(self._height))


def fix_size(widget: QWidget, width: int | None = None, height: int | None = None) -> None:
    _Fixed(widget, width, height)


def small_font(size_px: int = 11, bold: bool = False, grows: bool = True) -> QFont:
    """The application's font in a size in pixels, for painted text; `grows`: with the text."""
    font = QFont(QApplication.font())
    font.setPixelSize(px(size_px) if grows else size_px)
    font.setBold(bold)
    return font


@lru_cache(maxsize=64)
def blended(colour: str, ground: str, share: float) -> QColor:
    """The opaque mix of a share (0 … 1) of `colour` and of `ground`, which fills several times faster than alpha."""
    over, under = QColor(colour), QColor(ground)
    mixed = (
        share * a + (1 - share) * b
        for a, b in zip(over.getRgbF()[:3], under.getRgbF()[:3], strict=True)  # type: ignore[index]
    )
    return QColor.fromRgbF(*mixed)


def translucent(colour: str, alpha: int) -> QColor:
    """The colour with alpha 0 … 255."""
    mixed = QColor(colour)
    mixed.setAlpha(alpha)
    return mixed

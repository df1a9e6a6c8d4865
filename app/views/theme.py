"""Colours, fonts and the style sheet. A theme, dark or light, has a colour for each role.

Read the colours as `theme.TEXT` when painting; never import one by name, for they change with the theme. Plots keep
the pens that they were made with: `app.views.plots.plots.recolour` exchanges these.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QColor, QFont, QPalette
from PySide6.QtWidgets import QApplication

ThemeChoice = Literal["system", "dark", "light"]


@dataclass(frozen=True)
class Theme:
    """The colours of a theme, one for each role."""

    background: str
    panel: str
    raised: str
    line: str
    text: str
    faint: str
    disabled: str
    model: str  # amber in every view
    truth: str  # blue in every view
    difference: str  # model − truth
    other: str  # another preset's model
    warning: str
    good: str
    ground_top: str  # of the gradient behind the string
    ground_bottom: str
    shade: str  # over plucks outside the training range
    shade_alpha: int  # 0 … 255


DARK = Theme(
    background="#0d0f13",
    panel="#14171d",
    raised="#1d2129",
    line="#2b313c",
    text="#d8dde6",
    faint="#8a93a3",
    disabled="#555d6b",
    model="#ffb03a",
    truth="#4cc3e8",
    difference="#e58fd0",
    other="#b5a3ff",
    warning="#ff6b5e",
    good="#58c98b",
    ground_top="#171b22",
    ground_bottom="#101317",
    shade="#000000",
    shade_alpha=70,
)
LIGHT = Theme(
    background="#eceef2",
    panel="#fafbfc",
    raised="#ffffff",
    line="#c6ccd6",
    text="#1b2029",
    faint="#596272",
    disabled="#9aa2b0",
    model="#a05a00",
    truth="#00698f",
    difference="#a3327f",
    other="#5b45b8",
    warning="#b3261e",
    good="#1a7044",
    ground_top="#fdfdfe",
    ground_bottom="#f3f5f8",
    shade="#4a5568",
    shade_alpha=26,
)

SIGNS = Path(__file__).parent / "signs"  # pictures for the style sheet, in the themes' colours

_SCHEMES: dict[ThemeChoice, Qt.ColorScheme] = {
    "system": Qt.ColorScheme.Unknown,
    "dark": Qt.ColorScheme.Dark,
    "light": Qt.ColorScheme.Light,
}

present = DARK
BACKGROUND, PANEL, RAISED, LINE, TEXT, FAINT = (
    DARK.background,
    DARK.panel,
    DARK.raised,
    DARK.line,
    DARK.text,
    DARK.faint,
)
MODEL, TRUTH, WARNING, GOOD = DARK.model, DARK.truth, DARK.warning, DARK.good
DISABLED = DARK.disabled
DIFFERENCE, OTHER = DARK.difference, DARK.other
SOURCE_COLOURS = {"model": MODEL, "truth": TRUTH, "difference": DIFFERENCE, "other": OTHER}


def source_kind(source: str) -> str:
    """The key of `SOURCE_COLOURS` for a source: "other" for "preset:NAME"."""
    return source if source in SOURCE_COLOURS else "other"


class _Changes(QObject):
    theme_changed = Signal(Theme, Theme)  # from, to


changes = _Changes()


def use(new: Theme) -> None:
    """Makes `new` the present theme and emits `changes.theme_changed`; the style sheet is set by `apply_theme`."""
    global present, BACKGROUND, PANEL, RAISED, LINE, TEXT, FAINT, DISABLED
    global MODEL, TRUTH, DIFFERENCE, OTHER, WARNING, GOOD
    old, present = present, new
    BACKGROUND, PANEL, RAISED, LINE = new.background, new.panel, new.raised, new.line
    TEXT, FAINT, WARNING, GOOD, DISABLED = new.text, new.faint, new.warning, new.good, new.disabled
    MODEL, TRUTH, DIFFERENCE, OTHER = new.model, new.truth, new.difference, new.other
    SOURCE_COLOURS.update(model=MODEL, truth=TRUTH, difference=DIFFERENCE, other=OTHER)
    if new != old:
        changes.theme_changed.emit(old, new)


def contrast(one: str, other: str) -> float:
    """WCAG's ratio of two colours, 1 … 21; text needs 4.5, large text and symbols 3."""
    low, high = sorted(_luminance(QColor(colour)) for colour in (one, other))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: QColor) -> float:
    linear = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
        for c in (colour.redF(), colour.greenF(), colour.blueF())
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _style_sheet() -> str:
    tick = (SIGNS / f"tick_{'dark' if present == DARK else 'light'}.svg").as_posix()
    slots = "\n".join(
        f"QPushButton#{kind}:checked {{ background: {colour}; color: {BACKGROUND}; border-color: {colour};"
        f" font-weight: 600; }} QPushButton#{kind} {{ border-left: 3px solid {colour}; padding: 6px; }}"
        f" QPushButton#{kind}:disabled {{ background: {RAISED}; color: {DISABLED}; border-color: {LINE}; }}"
        for kind, colour in SOURCE_COLOURS.items()
    )
    return f"""
QWidget {{ color: {TEXT}; font-size: 12px; }}
QMainWindow, QDialog {{ background: {BACKGROUND}; }}
QFrame#rule {{ background: {LINE}; }}
QFrame#panel {{ background: {PANEL}; border: 1px solid {LINE}; border-radius: 6px; }}
QFrame#panel QScrollArea, QFrame#panel QScrollArea > QWidget > QWidget {{ background: transparent; }}
QFrame#notice {{ background: {RAISED}; border: 1px solid {FAINT}; border-radius: 6px; }}
QFrame#browser {{ background: {PANEL}; border: 1px solid {FAINT}; border-radius: 8px; }}
QFrame#browser QScrollArea, QFrame#browser QScrollArea > QWidget > QWidget {{ background: transparent; }}
QTreeWidget {{ background: {BACKGROUND}; border: 1px solid {LINE}; border-radius: 6px; outline: none; }}
QTreeWidget::item {{ padding: 6px 5px; }}
QTreeWidget::item:selected {{ background: {LINE}; color: {TEXT}; }}
QTreeWidget:focus {{ border: 1px solid {FAINT}; }}
QHeaderView::section {{ background: {BACKGROUND}; color: {FAINT}; border: none; padding: 5px; }}
QPushButton#preset {{ text-align: left; font-weight: 600; padding: 6px 12px; }}
QLabel {{ background: transparent; }}
QLabel#faint {{ color: {FAINT}; }}
QLabel#knob {{ color: {FAINT}; font-size: 10px; padding-top: 4px; }}
QLabel#group {{ color: {FAINT}; font-size: 9px; font-weight: 600; letter-spacing: 1px; }}
QLabel#hint {{
    color: {TEXT}; background: {PANEL}; border: 1px solid {FAINT}; border-radius: 10px; padding: 3px 12px; }}
QLabel#brand {{ font-size: 14px; font-weight: 600; letter-spacing: 3px; color: {TEXT}; }}
QLabel#badge {{
    color: {FAINT}; background: {RAISED}; border: 1px solid {LINE}; border-radius: 4px; padding: 3px 8px; }}
QLabel#badge[fault="true"] {{ color: {WARNING}; border-color: {WARNING}; }}
QLabel#warning {{ color: {WARNING}; }}
QLabel#good {{ color: {GOOD}; }}
QLabel#title {{ font-size: 15px; font-weight: 600; }}
QPushButton, QToolButton {{ background: {RAISED}; border: 1px solid {LINE}; border-radius: 5px; padding: 6px 12px; }}
QPushButton {{ outline: none; }}
QPushButton:hover, QToolButton:hover {{ border-color: {FAINT}; }}
QPushButton:pressed, QToolButton:pressed {{ background: {LINE}; }}
QPushButton:checked, QToolButton:checked {{ background: {LINE}; border-color: {TEXT}; }}
QPushButton:focus, QToolButton:focus, QComboBox:focus, QLineEdit:focus, QDoubleSpinBox:focus, QSpinBox:focus,
QCheckBox:focus, QPlainTextEdit:focus, QTextBrowser:focus, QListWidget:focus, QTableView:focus, QMenuBar:focus
    {{ border: 1px solid {TEXT}; }}
QPushButton:disabled, QToolButton:disabled, QComboBox:disabled, QLineEdit:disabled, QDoubleSpinBox:disabled,
QSpinBox:disabled, QListWidget:disabled {{ color: {DISABLED}; }}
{slots}
QToolButton#filter, QToolButton#solo {{ color: {TRUTH}; border-color: {TRUTH}; padding: 6px 9px; }}
QToolButton#solo {{ padding: 1px 9px; }}
QPushButton#play {{ font-weight: 600; min-width: 84px; padding: 9px 14px; }}
QPushButton#play:checked {{ background: {GOOD}; color: {BACKGROUND}; border-color: {GOOD}; }}
*[compact="true"] {{ padding: 6px 4px; }}
QPushButton#play[compact="true"] {{ min-width: 56px; padding: 9px 4px; }}
QToolButton#small {{ padding: 4px 8px; }}
QToolButton#record {{ padding: 2px 8px; }}
QToolButton#record:checked {{ background: {WARNING}; color: {BACKGROUND}; border-color: {WARNING}; }}
QToolButton#narrow {{ padding: 6px 5px; }}
QToolButton::menu-indicator {{ image: none; }}
QToolButton#chip {{ color: {FAINT}; background: transparent; padding: 2px 8px; border-radius: 4px; font-size: 11px; }}
QToolButton#chip:checked {{ color: {TEXT}; background: {LINE}; border-color: {LINE}; }}
QToolButton#chip:hover, QToolButton#chip:focus {{ border-color: {FAINT}; }}
QToolButton#chip:disabled {{ color: {DISABLED}; }}
QComboBox, QLineEdit, QDoubleSpinBox, QSpinBox, QPlainTextEdit, QTextBrowser, QListWidget {{
    background: {RAISED}; border: 1px solid {LINE}; border-radius: 5px; padding: 5px 8px;
    selection-background-color: {TRUTH}; selection-color: {BACKGROUND}; }}
QDoubleSpinBox QLineEdit, QSpinBox QLineEdit {{ border: none; padding: 0; background: transparent; }}
QDoubleSpinBox::up-button, QDoubleSpinBox::down-button, QSpinBox::up-button, QSpinBox::down-button
    {{ width: 0; border: none; }}
QComboBox::drop-down {{ border: none; width: 22px; }}
QComboBox::down-arrow {{ image: none; width: 0; height: 0; border-left: 4px solid {RAISED};
    border-right: 4px solid {RAISED}; border-top: 5px solid {FAINT}; }}
QCheckBox {{ spacing: 8px; border: 1px solid transparent; border-radius: 4px; padding: 1px 4px; }}
QCheckBox:disabled {{ color: {DISABLED}; }}
QCheckBox::indicator, QListWidget::indicator {{
    width: 13px; height: 13px; background: {RAISED}; border: 1px solid {FAINT}; border-radius: 3px; }}
QCheckBox::indicator:checked, QListWidget::indicator:checked {{
    background: {TEXT}; border-color: {TEXT}; image: url("{tick}"); }}
QCheckBox::indicator:disabled {{ border-color: {DISABLED}; }}
QCheckBox::indicator:checked:disabled {{ background: {DISABLED}; }}
QListWidget {{ background: {BACKGROUND}; border: 1px solid {LINE}; border-radius: 6px; outline: none; }}
QListWidget:focus {{ border: 1px solid {FAINT}; }}
QListWidget::item {{ padding: 3px 5px; }}
QListWidget::item:selected {{ background: {LINE}; color: {TEXT}; }}
QPushButton#primary {{ background: {TEXT}; color: {BACKGROUND}; border-color: {TEXT}; font-weight: 600; }}
QPushButton#primary:disabled {{ background: {RAISED}; color: {FAINT}; border-color: {LINE}; }}
QComboBox QAbstractItemView, QMenu {{
    background: {RAISED}; border: 1px solid {LINE}; selection-background-color: {LINE}; }}
QMenu::item:selected {{ background: {LINE}; }}
QSlider::groove:horizontal {{ height: 4px; background: {LINE}; border-radius: 2px; }}
QSlider::handle:horizontal {{ width: 12px; margin: -5px 0; border-radius: 6px; background: {TEXT}; }}
QSlider::handle:horizontal:focus {{ background: {TRUTH}; }}
QProgressBar {{ background: {RAISED}; border: 1px solid {LINE}; border-radius: 4px; text-align: center; }}
QProgressBar::chunk {{ background: {TRUTH}; }}
QTabWidget::pane {{ border: none; }}
QTabBar {{ background: transparent; qproperty-drawBase: 0; }}
QTabBar QToolButton {{ padding: 0; border-radius: 3px; }}
QTabBar::tab {{ color: {FAINT}; padding: 4px 9px; border: none; border-bottom: 2px solid transparent; }}
QTabBar::tab:hover {{ color: {TEXT}; }}
QTabBar::tab:selected {{ color: {TEXT}; border-bottom-color: {FAINT}; }}
QTabBar::tab:focus {{ border-bottom-color: {TEXT}; }}
QScrollBar {{ background: transparent; border: none; }}
QScrollBar:horizontal {{ height: 9px; }}
QScrollBar:vertical {{ width: 9px; }}
QScrollBar::handle {{
    background: {DISABLED}; border-radius: 3px; margin: 1px; min-width: 24px; min-height: 24px; }}
QScrollBar::handle:hover {{ background: {FAINT}; }}
QScrollBar::add-line, QScrollBar::sub-line {{ width: 0; height: 0; }}
QScrollBar::add-page, QScrollBar::sub-page {{ background: transparent; }}
QTableView {{ background: {PANEL}; border: none; selection-background-color: {LINE}; }}
QHeaderView {{ background: {PANEL}; border: none; }}
QHeaderView::section {{
    background: {PANEL}; color: {FAINT}; border: none; border-bottom: 1px solid {LINE}; padding: 6px 6px 4px 6px; }}
QHeaderView::up-arrow, QHeaderView::down-arrow {{
    subcontrol-origin: border; subcontrol-position: top center; width: 8px; height: 6px; }}
QToolTip {{ background: {RAISED}; color: {TEXT}; border: 1px solid {LINE}; }}
"""


def _palette() -> QPalette:
    palette = QPalette()
    roles = QPalette.ColorRole
    for role, colour in {
        roles.Window: BACKGROUND,
        roles.Base: RAISED,
        roles.AlternateBase: PANEL,
        roles.Button: RAISED,
        roles.Text: TEXT,
        roles.WindowText: TEXT,
        roles.ButtonText: TEXT,
        roles.PlaceholderText: FAINT,
        roles.ToolTipBase: RAISED,
        roles.ToolTipText: TEXT,
        roles.Highlight: TRUTH,
        roles.HighlightedText: BACKGROUND,
        roles.Link: TRUTH,
    }.items():
        palette.setColor(role, QColor(colour))
    return palette


def apply_theme(app: QApplication, choice: ThemeChoice = "dark") -> None:
    """Sets Fusion with the theme's palette and style sheet for the application; "system" follows the desktop."""
    app.setStyleSheet("")  # replaced directly, a sheet is applied to a widget once more for each of its ancestors
    if app.style().name() != "fusion":  # while a sheet is set, the style has no name
        app.setStyle("Fusion")
    hints = app.styleHints()
    hints.setColorScheme(_SCHEMES[choice])  # the window's frame and the file dialogs follow
    light = choice == "light" or (choice == "system" and hints.colorScheme() == Qt.ColorScheme.Light)
    use(LIGHT if light else DARK)
    app.setPalette(_palette())
    app.setStyleSheet(_style_sheet())


def small_font(size_px: int = 11, bold: bool = False) -> QFont:
    """The application's font in a size in pixels, for painted text."""
    font = QFont(QApplication.font())
    font.setPixelSize(size_px)
    font.setBold(bold)
    return font


@lru_cache(maxsize=64)
def blended(colour: str, ground: str, share: float) -> QColor:
    """`share` (0 … 1) of `colour` over `ground`, as an opaque colour: that fills several times faster."""
    over, under = QColor(colour), QColor(ground)
    mixed = (
        share * a + (1 - share) * b
        for a, b in zip(over.getRgbF()[:3], under.getRgbF()[:3], strict=True)  # type: ignore[index]
    )
    return QColor.fromRgbF(*mixed)


def translucent(colour: str, alpha: int) -> QColor:
    """`colour` with alpha 0 … 255."""
    made = QColor(colour)
    made.setAlpha(alpha)
    return made

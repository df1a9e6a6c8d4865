"""Colours, fonts and the style sheet: one dark face for every view."""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtGui import QColor, QFont, QPalette
from PySide6.QtWidgets import QApplication

BACKGROUND = "#0d0f13"
PANEL = "#14171d"
RAISED = "#1d2129"
LINE = "#2b313c"
TEXT = "#d8dde6"
FAINT = "#8a93a3"
MODEL = "#ffb03a"  # what the model says is amber, everywhere
TRUTH = "#4cc3e8"  # and the physics blue
DIFFERENCE = "#e58fd0"  # what lies between them
OTHER = "#b5a3ff"  # another preset's model
WARNING = "#ff6b5e"
GOOD = "#58c98b"

SOURCE_COLOURS = {"model": MODEL, "truth": TRUTH, "difference": DIFFERENCE, "other": OTHER}


def source_kind(source: str) -> str:
    """The key of `SOURCE_COLOURS` for a source: "other" for "preset:NAME"."""
    return source if source in SOURCE_COLOURS else "other"


_SLOTS = "\n".join(
    f"QPushButton#{kind}:checked {{ background: {colour}; color: {BACKGROUND}; border-color: {colour};"
    f" font-weight: 600; }} QPushButton#{kind} {{ border-left: 3px solid {colour}; padding: 6px; }}"
    for kind, colour in SOURCE_COLOURS.items()
)

_STYLE = f"""
QWidget {{ color: {TEXT}; font-size: 12px; }}
QMainWindow, QDialog {{ background: {BACKGROUND}; }}
QFrame#rule {{ background: {LINE}; }}
QFrame#panel {{ background: {PANEL}; border: 1px solid {LINE}; border-radius: 6px; }}
QLabel {{ background: transparent; }}
QLabel#faint {{ color: {FAINT}; }}
QLabel#brand {{ font-size: 14px; font-weight: 600; letter-spacing: 3px; color: {TEXT}; }}
QLabel#badge {{
    color: {FAINT}; background: {RAISED}; border: 1px solid {LINE}; border-radius: 4px; padding: 3px 8px; }}
QLabel#warning {{ color: {WARNING}; }}
QPushButton, QToolButton {{ background: {RAISED}; border: 1px solid {LINE}; border-radius: 5px; padding: 6px 12px; }}
QPushButton:hover, QToolButton:hover {{ border-color: {FAINT}; }}
QPushButton:pressed, QToolButton:pressed {{ background: {LINE}; }}
QPushButton:checked, QToolButton:checked {{ background: {LINE}; border-color: {TEXT}; }}
QPushButton:focus, QToolButton:focus, QComboBox:focus, QLineEdit:focus, QDoubleSpinBox:focus
    {{ border: 1px solid {TEXT}; }}
QPushButton:disabled, QToolButton:disabled {{ color: {LINE}; }}
{_SLOTS}
QPushButton#play {{ font-weight: 600; min-width: 84px; padding: 9px 14px; }}
QPushButton#play:checked {{ background: {GOOD}; color: {BACKGROUND}; border-color: {GOOD}; }}
QToolButton#narrow {{ padding: 6px 5px; }}
QToolButton::menu-indicator {{ image: none; }}
QComboBox, QLineEdit, QDoubleSpinBox {{
    background: {RAISED}; border: 1px solid {LINE}; border-radius: 5px; padding: 5px 8px;
    selection-background-color: {TRUTH}; selection-color: {BACKGROUND}; }}
QComboBox::drop-down {{ border: none; width: 22px; }}
QComboBox QAbstractItemView, QMenu {{
    background: {RAISED}; border: 1px solid {LINE}; selection-background-color: {LINE}; }}
QMenu::item:selected {{ background: {LINE}; }}
QSlider::groove:horizontal {{ height: 4px; background: {LINE}; border-radius: 2px; }}
QSlider::handle:horizontal {{ width: 12px; margin: -5px 0; border-radius: 6px; background: {TEXT}; }}
QSlider::handle:horizontal:focus {{ background: {TRUTH}; }}
QProgressBar {{ background: {RAISED}; border: 1px solid {LINE}; border-radius: 4px; text-align: center; }}
QProgressBar::chunk {{ background: {TRUTH}; }}
QTabWidget::pane {{ border: none; }}
QTabBar {{ background: transparent; }}
QTabBar::tab {{ color: {FAINT}; padding: 4px 10px; border: none; border-bottom: 2px solid transparent; }}
QTabBar::tab:hover {{ color: {TEXT}; }}
QTabBar::tab:selected {{ color: {TEXT}; border-bottom-color: {FAINT}; }}
QTabBar::tab:focus {{ border-bottom-color: {TEXT}; }}
QToolTip {{ background: {RAISED}; color: {TEXT}; border: 1px solid {LINE}; }}
"""


def apply_theme(app: QApplication) -> None:
    """Fusion with our dark palette, for the whole application."""
    app.setStyle("Fusion")
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
    }.items():
        palette.setColor(role, QColor(colour))
    app.setPalette(palette)
    app.setStyleSheet(_STYLE)
    pg.setConfigOptions(antialias=True, background=PANEL, foreground=FAINT, useOpenGL=False)


def small_font(size: int = 11, bold: bool = False) -> QFont:
    """The application's font in pixels, for painted text."""
    font = QFont(QApplication.font())
    font.setPixelSize(size)
    font.setBold(bold)
    return font


def translucent(colour: str, alpha: int) -> QColor:
    """`colour` with alpha 0 … 255."""
    made = QColor(colour)
    made.setAlpha(alpha)
    return made

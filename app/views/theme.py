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
WARNING = "#ff6b5e"
GOOD = "#58c98b"

SOURCE_COLOURS = {"model": MODEL, "truth": TRUTH}

_STYLE = f"""
QWidget {{ color: {TEXT}; font-size: 12px; }}
QMainWindow, QDialog {{ background: {BACKGROUND}; }}
QFrame#rule {{ background: {LINE}; }}
QFrame#panel {{ background: {PANEL}; border: 1px solid {LINE}; border-radius: 6px; }}
QFrame#browser {{ background: {PANEL}; border: 1px solid {FAINT}; border-radius: 8px; }}
QFrame#browser QScrollArea, QFrame#browser QScrollArea > QWidget > QWidget {{ background: transparent; }}
QTreeWidget {{ background: {BACKGROUND}; border: 1px solid {LINE}; border-radius: 6px; outline: none; }}
QTreeWidget::item {{ padding: 6px 5px; }}
QTreeWidget::item:hover {{ background: {RAISED}; }}
QTreeWidget::item:selected {{ background: {LINE}; color: {TEXT}; }}
QTreeWidget:focus {{ border: 1px solid {FAINT}; }}
QHeaderView::section {{ background: {BACKGROUND}; color: {FAINT}; border: none; padding: 5px; }}
QPushButton#preset {{ text-align: left; font-weight: 600; padding: 6px 12px; }}
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
QPushButton#model:checked {{ background: {MODEL}; color: {BACKGROUND}; border-color: {MODEL}; font-weight: 600; }}
QPushButton#truth:checked {{ background: {TRUTH}; color: {BACKGROUND}; border-color: {TRUTH}; font-weight: 600; }}
QPushButton#play {{ font-weight: 600; min-width: 84px; padding: 9px 14px; }}
QPushButton#play:checked {{ background: {GOOD}; color: {BACKGROUND}; border-color: {GOOD}; }}
QToolButton::menu-indicator {{ image: none; }}
QComboBox, QLineEdit, QDoubleSpinBox {{
    background: {RAISED}; border: 1px solid {LINE}; border-radius: 5px; padding: 5px 8px;
    selection-background-color: {TRUTH}; selection-color: {BACKGROUND}; }}
QDoubleSpinBox QLineEdit {{ border: none; padding: 0; background: transparent; }}
QDoubleSpinBox::up-button, QDoubleSpinBox::down-button {{ width: 0; border: none; }}
QComboBox::drop-down {{ border: none; width: 22px; }}
QComboBox::down-arrow {{ image: none; width: 0; height: 0; border-left: 4px solid {RAISED};
    border-right: 4px solid {RAISED}; border-top: 5px solid {FAINT}; }}
QCheckBox {{ spacing: 8px; }}
QCheckBox::indicator, QListWidget::indicator {{
    width: 13px; height: 13px; background: {RAISED}; border: 1px solid {FAINT}; border-radius: 3px; }}
QCheckBox::indicator:checked, QListWidget::indicator:checked {{ background: {TEXT}; border-color: {TEXT}; }}
QCheckBox:focus {{ color: white; }}
QCheckBox::indicator:focus {{ border-color: {TEXT}; }}
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

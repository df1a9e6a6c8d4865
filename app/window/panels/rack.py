"""The list of all views; makes each panel and puts it in its place in the window."""

from __future__ import annotations

from app.presets.library import Library
from app.session.choices import Session
from app.window.main_window import MainWindow
from app.window.panels.base import Panel
from app.window.panels.compare import ComparePanel
from app.window.panels.drum import DrumPanel
from app.window.panels.eigenvalues import EigenvaluesPanel
from app.window.panels.error_plane import ErrorPlanePanel
from app.window.panels.error_time import ErrorTimePanel
from app.window.panels.partials import PartialsPanel
from app.window.panels.space_time import SpaceTimePanel
from app.window.panels.spectrogram import SpectrogramPanel
from app.window.panels.spectrum import SpectrumPanel
from app.window.panels.string import StringPanel
from app.window.panels.waveform import WaveformPanel

LEFT: tuple[type[Panel], ...] = (SpectrumPanel, SpectrogramPanel, EigenvaluesPanel, PartialsPanel, ErrorPlanePanel)
RIGHT: tuple[type[Panel], ...] = (WaveformPanel, SpaceTimePanel, ErrorTimePanel, ComparePanel)


def fill(window: MainWindow, session: Session, library: Library) -> list[Panel]:
    """The panels: of string and drum, then of the left and the right deck. Connects decks and session."""
    string, drum = StringPanel(session, library), DrumPanel(session, library)
    window.show_stage(string, drum)
    string.view.setFocus()
    panels: list[Panel] = [string, drum]
    for choice, deck, kinds in (("left_view", window.left, LEFT), ("right_view", window.right, RIGHT)):
        for panel in (kind(session, library) for kind in kinds):
            deck.add(panel.key, panel.title, panel)
            panel.on_the_left = deck is window.left
            panels.append(panel)
        deck.chosen.connect(lambda key, choice=choice: session.update(**{choice: key}))
    return panels

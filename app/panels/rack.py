"""Every panel, made and put in its place in the window."""

from __future__ import annotations

from app.library import Library
from app.main_window import MainWindow
from app.panels.base import Panel
from app.panels.compare import ComparePanel
from app.panels.eigenvalues import EigenvaluesPanel
from app.panels.error_plane import ErrorPlanePanel
from app.panels.error_time import ErrorTimePanel
from app.panels.partials import PartialsPanel
from app.panels.space_time import SpaceTimePanel
from app.panels.spectrogram import SpectrogramPanel
from app.panels.spectrum import SpectrumPanel
from app.panels.string import StringPanel
from app.panels.waveform import WaveformPanel
from app.session import Session

LEFT: tuple[type[Panel], ...] = (SpectrumPanel, SpectrogramPanel, EigenvaluesPanel, PartialsPanel, ErrorPlanePanel)
RIGHT: tuple[type[Panel], ...] = (WaveformPanel, SpaceTimePanel, ErrorTimePanel, ComparePanel)


def fill(window: MainWindow, session: Session, library: Library) -> list[Panel]:
    """The string's panel first, then those of both decks, each deck told and telling which one is chosen."""
    string = StringPanel(session, library)
    window.show_string(string.view)
    panels: list[Panel] = [string]
    for choice, deck, kinds in (("left_view", window.left, LEFT), ("right_view", window.right, RIGHT)):
        for panel in (kind(session, library) for kind in kinds):
            deck.add(panel.key, panel.title, panel.view)
            panel.on_the_left = deck is window.left
            panels.append(panel)
        deck.chosen.connect(lambda key, choice=choice: session.update(**{choice: key}))
    return panels

"""The list of the views of the decks; makes their panels and puts them in their places in the window."""

from __future__ import annotations

from app.presets.library import Library
from app.stage.session import Session
from app.views.controls.deck import Deck
from app.views.plots.plots import dress_plots
from app.window.main_window import MainWindow
from app.window.panels.base import Location, Panel
from app.window.panels.compare import ComparePanel
from app.window.panels.eigenvalues import EigenvaluesPanel
from app.window.panels.error_plane import ErrorPlanePanel
from app.window.panels.error_time import ErrorTimePanel
from app.window.panels.partials import PartialsPanel
from app.window.panels.space_time import SpaceTimePanel
from app.window.panels.spectrogram import SpectrogramPanel
from app.window.panels.spectrum import SpectrumPanel
from app.window.panels.waveform import WaveformPanel

LEFT: tuple[type[Panel], ...] = (SpectrumPanel, SpectrogramPanel, EigenvaluesPanel, PartialsPanel, ErrorPlanePanel)
RIGHT: tuple[type[Panel], ...] = (WaveformPanel, SpaceTimePanel, ErrorTimePanel, ComparePanel)


def decks(window: MainWindow, session: Session, library: Library) -> list[Panel]:
    """The panels of the left and the right deck. Connects decks and session."""
    dress_plots()
    panels: list[Panel] = []
    locations: tuple[tuple[Location, Deck, tuple[type[Panel], ...]], ...] = (
        ("left", window.left, LEFT),
        ("right", window.right, RIGHT),
    )
    for location, deck, kinds in locations:
        for panel in (kind(session, library) for kind in kinds):
            deck.add(panel.key, panel.title, panel)
            panel.location = location
            panels.append(panel)
        deck.chosen.connect(lambda key, choice=f"{location}_view": session.update(**{choice: key}))
    return panels

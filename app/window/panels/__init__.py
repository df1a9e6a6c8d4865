"""The panels, one for each view: they compute what it shows of the present motion.

`base.py` has the contract; the controller holds the list of panels and calls all of them alike.
"""

from app.window.panels.base import Moment, Panel
from app.window.panels.compare import ComparePanel
from app.window.panels.eigenvalues import EigenvaluesPanel
from app.window.panels.error_plane import ErrorPlanePanel
from app.window.panels.error_time import ErrorTimePanel
from app.window.panels.partials import PartialsPanel
from app.window.panels.space_time import SpaceTimePanel
from app.window.panels.spectrogram import SpectrogramPanel
from app.window.panels.spectrum import SpectrumPanel
from app.window.panels.string import StringPanel
from app.window.panels.waveform import WaveformPanel

__all__ = [
    "ComparePanel",
    "EigenvaluesPanel",
    "ErrorPlanePanel",
    "ErrorTimePanel",
    "Moment",
    "Panel",
    "PartialsPanel",
    "SpaceTimePanel",
    "SpectrogramPanel",
    "SpectrumPanel",
    "StringPanel",
    "WaveformPanel",
]

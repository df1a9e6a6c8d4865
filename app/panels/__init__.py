"""What the window shows of the motion on stage, one panel an aspect: a view, and what is told to it.

`base.py` has the contract; the controller holds the list of panels and tells them all the same things.
"""

from app.panels.base import Moment, Panel
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

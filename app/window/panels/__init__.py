"""The views, a module each: panel, plot and what it computes. `rack.py` lists them; `base.py` has the contract."""

from app.window.panels.base import Location, Moment, Panel
from app.window.panels.string import StringPanel

__all__ = ["Location", "Moment", "Panel", "StringPanel"]

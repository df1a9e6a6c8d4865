"""The resonators: the record that truth and models take (`base`), and what fills it: strings, drums, recordings."""

from engine.resonators.base import Resonator

__all__ = ["Resonator"]

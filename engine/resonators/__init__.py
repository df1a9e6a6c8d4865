"""The resonators: the record that truth and models take (`base`), and the string that fills it (`string`)."""

from engine.resonators.base import Resonator
from engine.resonators.string import StringParameters

__all__ = ["Resonator", "StringParameters"]

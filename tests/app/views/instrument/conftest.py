"""The shipped classical guitar, and a surface that is played, with all that it reports."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import SignalInstance
from PySide6.QtWidgets import QWidget

from app.instruments.instrument import Instrument
from app.instruments.library import SHIPPED, read_instrument

Notes = list[tuple[str, int]]


@pytest.fixture(scope="session")
def guitar() -> Instrument:
    """Six strings, stereo, five macros, a body."""
    return read_instrument(SHIPPED / "classical_guitar.json")


@pytest.fixture
def notes_of() -> Callable[[QWidget], Notes]:
    """What a surface asks for from now on, in order: ("on", key) and ("off", key)."""

    def begin(surface: QWidget) -> Notes:
        notes: Notes = []
        for what, signal in (("on", surface.pressed), ("off", surface.released)):  # type: ignore[attr-defined]
            assert isinstance(signal, SignalInstance)
            signal.connect(lambda key, *_, what=what: notes.append((what, key)))
        return notes

    return begin

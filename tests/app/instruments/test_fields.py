"""Fields of instruments that follow from the table of parameters."""

from __future__ import annotations

from app.instruments.instrument import Fretted, Instrument
from app.shared.parameters import OF_INSTRUMENTS
from engine.kernels.constants import PLAYED
from tests.app.player.conftest import STEEL


def test_what_the_player_reads_are_values_of_instruments() -> None:
    instrument = Instrument(name="test", category="guitar", strings=Fretted(string=STEEL))
    for id in PLAYED[:-2]:  # listening points follow
        assert instrument.value(id) == OF_INSTRUMENTS[id].default
    assert all(id in OF_INSTRUMENTS for id in PLAYED) and len(set(PLAYED)) == len(PLAYED)

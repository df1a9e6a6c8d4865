"""Fields of patches that follow from the table of parameters."""

from __future__ import annotations

from app.patches.patch import Fretted, Patch
from app.shared.parameters import OF_PATCHES
from engine.kernels.constants import PLAYED
from tests.app.instrument.conftest import STEEL


def test_what_the_player_reads_are_values_of_patches() -> None:
    patch = Patch(name="test", category="guitar", strings=Fretted(string=STEEL))
    for id in PLAYED[:-2]:  # listening points follow
        assert patch.value(id) == OF_PATCHES[id].default
    assert all(id in OF_PATCHES for id in PLAYED) and len(set(PLAYED)) == len(PLAYED)

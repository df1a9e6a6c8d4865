"""Fields of patches that follow from the table of parameters."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from app.patches import fields
from app.patches.fields import Rows
from app.patches.patch import Fretted, Patch
from app.shared.parameters import OF_PATCHES, PLUCK, Parameter, Taper
from engine.kernels.constants import PLAYED
from tests.app.instrument.conftest import STEEL


def test_a_row_is_a_field_of_its_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the range and the default of the row, in the order of the table, beside what the class states."""
    rows = [Parameter(id, "x", (0, 2), 1.5, Taper(0.1), PLUCK) for id in ("toy.b", "other.c", "toy.a", "toy")]
    monkeypatch.setattr(fields, "OF_PATCHES", {each.id: each for each in rows})

    class Toy(Rows, part="toy"):
        stated: bool = False

    assert list(Toy.model_fields) == ["stated", "b", "a"]
    assert Toy().a == Toy().b == 1.5
    assert Toy.model_validate({"a": 2}).a == 2
    with pytest.raises(ValidationError, match="less than or equal to 2"):
        Toy.model_validate({"b": 2.5})
    with pytest.raises(ValidationError, match="not permitted"):
        Toy.model_validate({"c": 1})


def test_what_the_player_reads_are_values_of_patches() -> None:
    patch = Patch(name="test", category="guitar", strings=Fretted(string=STEEL))
    for id in PLAYED[:-2]:  # listening points follow
        assert patch.value(id) == OF_PATCHES[id].default
    assert all(id in OF_PATCHES for id in PLAYED) and len(set(PLAYED)) == len(PLAYED)

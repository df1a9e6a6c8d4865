from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from app.instruments.instrument import Instrument

STRING = {
    "length_m": 0.65,
    "area_m2": 4.5614e-07,
    "second_moment_m4": 2.963e-14,
    "density_kg_m3": 1140.0,
    "youngs_modulus_pa": 5.4e9,
    "damping_d1_kg_m_s": 0.0010383,
    "damping_d3_kg_m_s": 6.8103e-06,
    "tension_n": 53.4,
}


@pytest.fixture(scope="session")
def string() -> dict[str, float]:
    """Nylon B3."""
    return STRING


@pytest.fixture(scope="session")
def make_instrument() -> Callable[..., Instrument]:
    """An instrument of one fretted string, with changes."""

    def make(**changes: Any) -> Instrument:
        facts = {
            "name": "An instrument",
            "category": "guitar",
            "strings": {"kind": "fretted", "string": STRING},
            **changes,
        }
        return Instrument.model_validate(facts)

    return make

from typing import Any

from app.instruments.instrument import Instrument

STRING = {  # nylon B3
    "length_m": 0.65,
    "area_m2": 4.5614e-07,
    "second_moment_m4": 2.963e-14,
    "density_kg_m3": 1140.0,
    "youngs_modulus_pa": 5.4e9,
    "damping_d1_kg_m_s": 0.0010383,
    "damping_d3_kg_m_s": 6.8103e-06,
    "tension_n": 53.4,
}


def make_instrument(**changes: Any) -> Instrument:
    """An instrument of one fretted string, with changes."""
    facts = {
        "name": "An instrument",
        "category": "guitar",
        "strings": {"kind": "fretted", "string": STRING},
        **changes,
    }
    return Instrument.model_validate(facts)

import pytest

from app.instruments.instrument import Damping, Fretted, Instrument, OpenString, PluckChoices, StringSet
from engine.values.string import StringParameters

STEEL = StringParameters(0.65, 5e-7, 2e-14, 7850.0, 2e11, 4e-4, 4e-7, 75.0)


@pytest.fixture
def instrument() -> Instrument:
    return Instrument(
        name="test",
        category="guitar",
        strings=Fretted(string=STEEL),
        pluck=PluckChoices(softest_mm=0.05, hardest_mm=2.0),
        damping=Damping(release_t60_s=0.15),
    )


@pytest.fixture
def guitar(instrument: Instrument) -> Instrument:
    strings = tuple(OpenString(note=note, string=STEEL) for note in (40, 45, 50, 55, 59, 64))
    return Instrument.model_validate({**dict(instrument), "strings": StringSet(strings=strings), "mode": "guitar"})

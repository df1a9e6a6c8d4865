"""The closed form of the pitch glide against rendered notes."""

from __future__ import annotations

import numpy as np
import pytest

from app.instruments.instrument import BodyChoice, Instrument
from app.instruments.library import find_instrument
from app.instruments.tuning import TuningChoice
from app.player.events import NoteOn
from app.player.glide import START_S, glides_cents
from app.player.strings import Strings
from engine.presets import Preset
from engine.values.effects import Amp, Room
from tests.app.player.stage import cents, pitch_hz, play


@pytest.mark.parametrize("source", ["model", "truth"])
@pytest.mark.parametrize(
    ("name", "key", "velocity", "decay"),
    [
        ("Slack bass", 44, 127, 1.0),
        ("Slack bass", 50, 127, 20.0),
        ("Electric bass", 45, 127, 1.0),
        ("Harpsichord", 84, 127, 1.0),
    ],
)
def test_a_rendered_note_starts_as_sharp(
    name: str, key: int, velocity: int, decay: float, source: str, preset: Preset
) -> None:
    """Of the string alone. Keys high enough for many periods in START_S: partials of a lower one overlap."""
    instrument = find_instrument(name).instrument.with_values({"noise.onset_db": -60.0, "knobs.decay": decay})
    instrument = instrument.model_copy(update={"amp": Amp(), "body": BodyChoice(), "room": Room()})
    string = Strings(instrument).of_key(key)
    assert string is not None
    wanted = glides_cents(instrument)[key, velocity]
    sound = play(instrument, preset, START_S, (0.0, NoteOn(key, velocity)), source=source)
    found = cents(pitch_hz(sound, string.pitch_hz * 2 ** (wanted / 1200), 0.0, START_S, 0.06), string.pitch_hz)
    assert found == pytest.approx(wanted, rel=0.15)


def test_it_grows_with_amplitude_squared(instrument: Instrument) -> None:
    """So that its error over a layer of velocities has one least value."""
    glides = glides_cents(instrument)
    assert (np.diff(glides[60, 1:]) > 0).all()
    halved = glides_cents(instrument.with_value("pluck.hardest_mm", instrument.pluck.hardest_mm / 2))
    assert glides[60, 127] / halved[60, 127] == pytest.approx(4, rel=0.01)


def test_keys_without_a_string_have_none(instrument: Instrument) -> None:
    low, high = instrument.range
    whole = np.isfinite(glides_cents(instrument)).all(axis=1)
    assert list(np.flatnonzero(whole)) == list(range(low, high + 1))
    beyond = instrument.model_copy(update={"range": (60, 127), "tuning": TuningChoice(transpose=48)})
    glides = glides_cents(beyond)
    assert np.isfinite(glides[60]).all() and np.isnan(glides[127]).all()

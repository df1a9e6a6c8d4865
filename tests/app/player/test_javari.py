"""Strings that meet the edge of their bridge: against the equation, their energy, model against truth, and sound."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.integrate
from numpy.typing import NDArray

from app.instruments.instrument import Instrument, Javari, Pickup
from app.instruments.library import SHIPPED, read_instrument
from app.player.events import NoteOn
from engine.kernels.constants import QUANTUM
from engine.kernels.voice_records import COUPLING, JAVARI, OMEGA_SQUARED, SIGMA, STRETCH
from engine.presets import Preset
from tests.app.player.stage import KEY, RATE_HZ, changed, play, relative
from tests.app.player.test_unisons import SOURCES, Watched, linear

EDGE = Javari(distance_mm=10, gap_um=3, stiffness_n_m=2e4, loss_s_m=0.5)


def buzzing(instrument: Instrument, **edge: float) -> Instrument:
    return changed(instrument, javari=EDGE.model_copy(update=edge))


class Equation:
    """That of a voice, from its memory."""

    def __init__(self, voice: np.void, rows: NDArray[np.float64]) -> None:
        self.q, self.squares, self.sigma = rows[0].copy(), rows[OMEGA_SQUARED].copy(), rows[SIGMA].copy()
        self.coupling, self.stretch = rows[COUPLING].copy(), rows[STRETCH].copy()
        self.shapes, self.mass = rows[JAVARI].copy(), voice["javari"]["mass_kg"]
        self.gap, self.stiffness, self.loss = (voice["javari"][name] for name in ("gap_m", "stiffness", "loss"))

    def energy(self, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """In J, of states (quanta, 2, 1, modes): of motion, strings, the rise of their tension, and the edge."""
        q, v = states[:, 0, 0], states[:, 1, 0]
        deep = np.maximum(-(q @ self.shapes) - self.gap, 0)
        risen = 0.25 * (q**2 @ self.stretch) * (q**2 @ self.coupling)
        return self.mass * (0.5 * (v**2 + self.squares * q**2).sum(-1) + risen) + 0.5 * self.stiffness * deep**2

    def rates(self, _time_s: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        q, v = np.split(state, 2)
        deep = -(self.shapes @ q) - self.gap
        push = self.stiffness * deep * (1 - self.loss * (self.shapes @ v)) if deep > 0 else 0.0
        raised = (self.stretch @ q**2) * self.coupling * q
        return np.concatenate([v, self.shapes * (push / self.mass) - 2 * self.sigma * v - self.squares * q - raised])


def watched(
    instrument: Instrument, preset: Preset, source: str, velocity: int = 90, key: int = KEY
) -> tuple[Watched, Equation]:
    """A note before its first quantum is rendered, whose equation has the modes of its first."""
    note = Watched(instrument, preset, source, velocity, key)
    note.player.compiled.catch_up(note.mixer.address)
    return note, Equation(*note.voices()[0])


@pytest.mark.parametrize(
    ("velocity", "loss", "rises", "left"),
    [(90, 0.0, 1e-9, (1 - 1e-7, 1 + 1e-7)), (90, 0.5, 1e-9, (0, 0.999)), (127, 0.5, 1e-5, (0, 0.9))],
)
@SOURCES
def test_energy_of_string_and_edge_never_rises(
    instrument: Instrument,
    preset: Preset,
    velocity: int,
    loss: float,
    rises: float,
    left: tuple[float, float],
    source: str,
) -> None:
    """Of a soft string without losses, and of a loud one with them."""
    lossless = linear(instrument, damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0)
    note, equation = watched(
        buzzing(instrument if velocity == 127 else lossless, loss_s_m=loss), preset, source, velocity
    )
    found = equation.energy(note.states(750))
    assert np.diff(found).max() < rises * found[0]
    assert left[0] <= found[-1] / found[0] <= left[1]


def test_truth_is_the_solution_of_its_equation(instrument: Instrument, preset: Preset) -> None:
    """DOP853, on a short string, for 10 ms in which it meets the edge a dozen times."""
    note, equation = watched(buzzing(instrument, stiffness_n_m=1e4), preset, "truth", key=88)
    assert equation.stiffness == 1e4
    quanta = 8
    times_s = np.arange(1, quanta + 1) * QUANTUM / RATE_HZ
    first = np.concatenate([equation.q, np.zeros_like(equation.q)])
    solved = scipy.integrate.solve_ivp(
        equation.rates, (0, times_s[-1] + 1e-9), first, "DOP853", times_s, rtol=1e-9, atol=1e-14, max_step=4e-6
    )
    wanted = solved.y.T.reshape(quanta, 2, -1)[:, 0]
    found = note.states(quanta)[:, 0, 0]
    assert (wanted @ equation.shapes).min() < -2e-6 - equation.gap  # they meet
    assert relative(found, wanted) < 2e-4


@SOURCES
def test_high_partials_come_later(preset: Preset, source: str) -> None:
    """On a tanpura the share of what lies above 2 kHz rises in the first second; without the edge it falls."""
    shipped, rises_db = read_instrument(SHIPPED / "tanpura_drone.json"), []
    for instrument in (shipped, changed(shipped, javari=Javari())):
        sound, shares_db = play(instrument, preset, 1.4, (0.0, NoteOn(36, 100)), source=source), []
        for at_s in (0.01, 1.2):
            power = np.abs(np.fft.rfft(sound[round(at_s * RATE_HZ) :][:9_600] * np.hanning(9_600))) ** 2
            shares_db.append(10 * np.log10(power[400:].sum() / power.sum()))
        rises_db.append(shares_db[1] - shares_db[0])
    assert rises_db[0] > 3 and rises_db[1] < -3


@SOURCES
def test_the_push_of_the_edge_is_heard_in_the_force_on_the_bridge(
    instrument: Instrument, preset: Preset, source: str
) -> None:
    """On average the end pulls as much as the edge pushes, apart from the overshoot of a finite series (Gibbs)."""
    note, _ = watched(changed(buzzing(instrument, gap_um=0), pickup=Pickup(kind="bridge")), preset, source)
    heard, pushes = [], []
    for _ in range(600):
        heard.append(note.mixer.render(QUANTUM)[:, 0].mean())
        pushes.append(note.voices()[0][0]["javari"]["force"])
    pushed = note.notes[0].gain * note.voices()[0][0]["javari"]["heard"] * np.mean(pushes)
    assert pushed > 0
    assert abs(np.mean(heard)) < 0.2 * pushed
    point, _ = watched(buzzing(instrument), preset, source)
    assert point.voices()[0][0]["javari"]["heard"] == 0

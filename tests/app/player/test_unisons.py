"""Strings of a course on one bridge, and those that meet its edge: against their equations, and their energy."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from numpy.typing import NDArray

from app.instruments.instrument import Course, Fretted, Instrument, Javari, Pickup
from app.player.compiled import InstrumentPlayer
from app.player.events import NoteOn
from engine.kernels import constants as of
from engine.kernels.constants import QUANTUM
from engine.kernels.tension import physical as physical_of
from engine.kernels.voice_records import COUPLING, JAVARI, OMEGA_SQUARED, SIGMA, STRETCH, TRUTH
from engine.resonators.string import decay_rates, undamped_frequencies, wavenumbers
from engine.values.string import Polarisations
from engine.voices import Mixer
from tests.app.player.conftest import STEEL
from tests.app.player.seen import Seen, seen
from tests.app.player.stage import KEY, PRESET, RATE_HZ, changed, relative

SOURCES = pytest.mark.parametrize("source", ["model", "truth"])
STRINGS = pytest.mark.parametrize("strings", [2, 3])
MOVING = Polarisations(angle_deg=30, second_cents=2, conductance_s_kg=0.02, second_conductance_s_kg=0.004)
QUANTUM_S = QUANTUM / RATE_HZ


def coupled(instrument: Instrument, strings: int = 2, bridge: float = 1.0, **course: float) -> Instrument:
    return changed(instrument, polarisations=MOVING, course=Course(strings=strings, bridge=bridge, **course))


def linear(instrument: Instrument, **string: float) -> Instrument:
    return changed(instrument, strings=Fretted(string=replace(STEEL, youngs_modulus_pa=0.0, **string)))


class Watched:
    """A player of one note, whose modes are read after each quantum."""

    def __init__(self, instrument: Instrument, source: str, velocity: int = 60, key: int = KEY) -> None:
        self.mixer = Mixer(RATE_HZ, limited=False)
        self.player = InstrumentPlayer(instrument, PRESET, RATE_HZ, {source: 1.0}, varied=False)
        self.mixer.set_player(self.player.compiled)
        self.player.handle(NoteOn(key, velocity), 0)

    @property
    def notes(self) -> list[Seen]:
        return seen(self.player)

    def voices(self) -> list[tuple[np.void, NDArray[np.float64]]]:
        """The voices of the strings of the course, the first first, with their rows."""
        player, found = self.player.compiled, []
        for number, note in enumerate(player.record["notes"]):
            if note["state"] == of.RINGS:
                found.append((int(note["age"]), player.voice(number, 0), player.rows_of(number, 0)))
        return [voice for _, *voice in sorted(found, key=lambda each: each[0])]

    def states(self, quanta: int) -> NDArray[np.float64]:
        """Amplitudes and speeds, (quanta, 2, strings, modes)."""
        found = []
        for _ in range(quanta):
            self.mixer.render(QUANTUM)
            found.append(np.array([state(*voice) for voice in self.voices()]).transpose(1, 0, 2))
        return np.array(found)


def state(voice: np.void, rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Amplitudes and speeds of a voice, (2, modes)."""
    if voice["kind"] == TRUTH:
        return rows[:2].copy()
    found = np.zeros((2, rows.shape[1]))
    physical_of(voice, found[0], found[1])
    return found


def energy(states: NDArray[np.float64], notes: list[Seen]) -> NDArray[np.float64]:
    """Of the course over its modal mass, (quanta,): of motion and strings, and of the rise of their tensions."""
    total = np.zeros(len(states))
    for string, note in enumerate(notes):
        q, v = states[:, 0, string], states[:, 1, string]
        partial, second = layout(q.shape[1])
        squares = undamped_frequencies(note.now, int(partial[-1]) + 1)[partial] ** 2
        squares = np.where(second == 1, squares * 2 ** (2 * MOVING.second_cents / 1200), squares)
        eta = wavenumbers(note.now, int(partial[-1]) + 1)[partial]
        stiffness = note.now.youngs_modulus_pa * note.now.area_m2 / (4 * note.now.mass_per_length_kg_m)
        total += 0.5 * (v**2 + squares * q**2).sum(axis=1) + stiffness / 4 * (eta**2 * q**2).sum(axis=1) ** 2
    return total


def layout(modes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    mode = np.arange(modes)
    paired = mode < 2 * of.MOST_PAIRS
    return np.where(paired, mode // 2, mode - of.MOST_PAIRS), np.where(paired, mode % 2, 0)


@SOURCES
@STRINGS
def test_modes_of_a_course_are_those_of_the_coupled_equations(instrument, strings, source):
    """Of each partial and direction 2n eigenvalues, of q̈ + 2 (Σ + s sᵀ) q̇ + Ω² q = 0, fitted to the motion."""
    watched = Watched(coupled(linear(instrument), strings, cents=3), source)
    states = watched.states(700)[20:]
    notes = watched.notes
    assert len(notes) == strings
    worst = worst_decay = 0.0
    for mode in (0, 1, 2, 3, 6, 15, 30, 46):
        partial, second = mode // 2, mode % 2
        omega = np.array([undamped_frequencies(note.now, partial + 1)[partial] for note in notes])
        omega *= 2 ** (MOVING.second_cents / 1200) if second else 1.0
        own = np.array([decay_rates(note.now, partial + 1)[partial] for note in notes])
        conductance = MOVING.second_conductance_s_kg if second else MOVING.conductance_s_kg
        lost = np.sqrt([conductance * note.now.tension_n / note.now.length_m for note in notes])
        zero, one = np.zeros((strings, strings)), np.eye(strings)
        wanted = np.linalg.eigvals(
            np.block([[zero, one], [-np.diag(omega**2), -2 * (np.diag(own) + np.outer(lost, lost))]])
        )
        motion = np.concatenate([states[:, 0, :, mode] * omega, states[:, 1, :, mode]], axis=1)
        turned = scipy.linalg.lstsq(motion[:-1], motion[1:])[0].T
        found = np.log(np.linalg.eigvals(turned).astype(complex)) / QUANTUM_S
        for each in wanted:
            near = found + 2j * np.pi / QUANTUM_S * np.round((each - found).imag * QUANTUM_S / math.tau)
            nearest = near[np.abs(near - each).argmin()]
            worst = max(worst, abs(nearest - each) / abs(each))
            worst_decay = max(worst_decay, abs(nearest.real - each.real))
    assert worst < 1e-6
    assert worst_decay < 1e-3  # 1/s


@STRINGS
@pytest.mark.parametrize(("source", "loud"), [("model", False), ("truth", False), ("truth", True)])
def test_energy_of_a_course_never_rises(instrument, strings, source, loud):
    """With no other loss than that to the bridge it falls to a part that the bridge does not see."""
    lossless = linear(instrument, damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0)
    course = coupled(instrument, strings, cents=3) if loud else coupled(lossless, strings, cents=3, apart_ms=4)
    watched = Watched(course, source, velocity=127 if loud else 60)
    found = energy(watched.states(750 if loud else 1_500)[0 if loud else strings * 4 :], watched.notes)
    assert np.diff(found).max() < (1e-6 if loud else 1e-9) * found[0]
    assert loud or found[-1] < 0.5 * found[0]


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


def watched(instrument: Instrument, source: str, velocity: int = 90, key: int = KEY) -> tuple[Watched, Equation]:
    """A note before its first quantum is rendered, whose equation has the modes of its first."""
    note = Watched(instrument, source, velocity, key)
    note.player.compiled.catch_up(note.mixer.address)
    return note, Equation(*note.voices()[0])


@pytest.mark.parametrize(
    ("velocity", "loss", "rises", "left"),
    [(90, 0.0, 1e-9, (1 - 1e-7, 1 + 1e-7)), (90, 0.5, 1e-9, (0, 0.999)), (127, 0.5, 1e-5, (0, 0.9))],
)
@SOURCES
def test_energy_of_string_and_edge_never_rises(instrument, velocity, loss, rises, left, source):
    lossless = linear(instrument, damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0)
    note, equation = watched(buzzing(instrument if velocity == 127 else lossless, loss_s_m=loss), source, velocity)
    found = equation.energy(note.states(750))
    assert np.diff(found).max() < rises * found[0]
    assert left[0] <= found[-1] / found[0] <= left[1]


def test_truth_is_the_solution_of_its_equation(instrument):
    """DOP853, on a short string, for 10 ms in which it meets the edge a dozen times."""
    note, equation = watched(buzzing(instrument, stiffness_n_m=1e4), "truth", key=88)
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
def test_the_push_of_the_edge_is_heard_in_the_force_on_the_bridge(instrument, source):
    """On average the end pulls as much as the edge pushes, apart from the overshoot of a finite series (Gibbs)."""
    note, _ = watched(changed(buzzing(instrument, gap_um=0), pickup=Pickup(kind="bridge")), source)
    heard, pushes = [], []
    for _ in range(600):
        heard.append(note.mixer.render(QUANTUM)[:, 0].mean())
        pushes.append(note.voices()[0][0]["javari"]["force"])
    pushed = note.notes[0].gain * note.voices()[0][0]["javari"]["heard"] * np.mean(pushes)
    assert pushed > 0
    assert abs(np.mean(heard)) < 0.2 * pushed
    point, _ = watched(buzzing(instrument), source)
    assert point.voices()[0][0]["javari"]["heard"] == 0

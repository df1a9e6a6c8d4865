"""Strings of a course on one bridge: modes in the memory of a player against the coupled equations, and sound."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from numpy.typing import NDArray

from app.instruments.instrument import Course, Fretted, Instrument
from app.player.compiled import InstrumentPlayer
from app.player.events import NoteOn
from engine.kernels import constants as of
from engine.kernels.constants import QUANTUM
from engine.kernels.tension import physical as physical_of
from engine.kernels.voice_records import TRUTH
from engine.presets import Preset
from engine.resonators.string import decay_rates, undamped_frequencies, wavenumbers
from engine.values.string import Polarisations
from engine.voices import Mixer
from tests.app.player.conftest import STEEL
from tests.app.player.seen import Seen, seen
from tests.app.player.stage import KEY, RATE_HZ, changed, play

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

    def __init__(
        self, instrument: Instrument, preset: Preset, source: str, velocity: int = 60, key: int = KEY
    ) -> None:
        self.mixer = Mixer(RATE_HZ, limited=False)
        self.player = InstrumentPlayer(instrument, preset, RATE_HZ, {source: 1.0}, varied=False)
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
def test_modes_of_a_course_are_those_of_the_coupled_equations(
    instrument: Instrument, preset: Preset, strings: int, source: str
) -> None:
    """Of each partial and direction 2n eigenvalues, of q̈ + 2 (Σ + s sᵀ) q̇ + Ω² q = 0, fitted to the motion."""
    watched = Watched(coupled(linear(instrument), strings, cents=3), preset, source)
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
def test_energy_of_a_course_never_rises(
    instrument: Instrument, preset: Preset, strings: int, source: str, loud: bool
) -> None:
    """With no other loss than that to the bridge it falls to a part that the bridge does not see."""
    lossless = linear(instrument, damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0)
    course = coupled(instrument, strings, cents=3) if loud else coupled(lossless, strings, cents=3, apart_ms=4)
    watched = Watched(course, preset, source, velocity=127 if loud else 60)
    found = energy(watched.states(750 if loud else 1_500)[0 if loud else strings * 4 :], watched.notes)
    assert np.diff(found).max() < (1e-6 if loud else 1e-9) * found[0]
    assert loud or found[-1] < 0.5 * found[0]


@SOURCES
def test_a_string_whose_others_have_not_begun_rings_as_alone(
    instrument: Instrument, preset: Preset, source: str
) -> None:
    one, both = (
        play(coupled(instrument, 2, bridge, apart_ms=50), preset, 0.045, (0.0, NoteOn(KEY, 90)), source=source)
        for bridge in (0.0, 1.0)
    )
    one *= (one @ both) / (one @ one)  # they are not equally loud, for they do not decay alike later
    assert np.abs(both - one).max() < 1e-4 * np.abs(one).max()


def t60_s(sound: NDArray[np.float64], begin_s: float, end_s: float) -> float:
    """From the slope of the level in windows of 50 ms."""
    times = np.arange(begin_s, end_s, 0.05)
    windows = [sound[round(each * RATE_HZ) :][: RATE_HZ // 20] for each in times]
    return -60 / float(np.polyfit(times, [10 * math.log10((each**2).mean() + 1e-30) for each in windows], 1)[0])


@SOURCES
def test_unisons_decay_in_two_stages(instrument: Instrument, preset: Preset, source: str) -> None:
    found = []
    for bridge in (1.0, 0.0):
        one_direction = Polarisations(angle_deg=0, conductance_s_kg=0.03)
        course = changed(instrument, polarisations=one_direction, course=Course(strings=2, cents=1.0, bridge=bridge))
        sound = play(course, preset, 4.0, (0.0, NoteOn(KEY, 40)), source=source)
        found.append((t60_s(sound, 0.1, 0.5), t60_s(sound, 2, 4)))
    (early, late), (apart, _) = found
    assert late > 2 * early and early < 0.7 * apart

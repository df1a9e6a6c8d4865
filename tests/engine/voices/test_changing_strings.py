"""A string that changes while it rings: bent, damped, plucked again; as a model and as the solved string."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp

from engine.kernels.constants import QUANTUM
from engine.kernels.fields import record_of, slot, slots
from engine.kernels.memory import publish
from engine.kernels.voice_records import VOICE, WISH
from engine.levels import FULL_SCALE_M
from engine.models._tension_law import CURVES
from engine.models.base import Physics
from engine.models.configurations import KoopmanTensionConfiguration
from engine.models.koopman_tension import KoopmanTension
from engine.pluck import Pluck
from engine.resonators.base import Resonator
from engine.resonators.string import resonator_of
from engine.values.ear import Ear
from engine.values.string import StringParameters
from engine.voices import Program, Voice
from engine.voices.programs import solver_program, tension_program
from engine.voices.voice import resonator_rows
from tests.engine.sounds import EAR, RATE_HZ, Signal, mixer_of, relative

STRING = StringParameters(tension_n=80.0, second_moment_m4=1.4e-14)
PLUCK = Pluck(0.3, 4.0, "raised_cosine", 0.2)
Changes = list[tuple[int, Resonator | Pluck, float]]  # the quantum, what changes, seconds of the way


class ChangingVoice(Voice):
    """A pluck whose string Python changes as it rings, as the compiled player changes those of its notes."""

    def __init__(self, of: Program, pluck: Pluck = PLUCK, ear: Ear = EAR) -> None:
        super().__init__(of, pluck.displacement(of.grid_points), ear)
        self.never_ends()
        self.blocks: list[Signal] = []

    def retune(self, resonator: Resonator, seconds: float) -> None:
        """Other modes while it rings: it gets there evenly, after those wished for before."""
        block = np.concatenate([np.zeros(slots(WISH)), resonator_rows(resonator).ravel()])
        record_of(block, WISH)["quanta"] = max(1, round(seconds * self.program.rate_hz / QUANTUM))
        place = slot(WISH, "next") if self.blocks else slot(VOICE, "pending_modes")
        publish([self.memory, *self.blocks][-1].view(np.int64), place, block.ctypes.data)
        self.blocks.append(block)


def bent(semitones: float) -> Resonator:
    return resonator_of(replace(STRING, tension_n=STRING.tension_n * 2 ** (semitones / 6)), 40)


def damped(t60_s: float) -> Resonator:
    added = 2 * STRING.mass_per_length_kg_m * math.log(1000) / t60_s
    return resonator_of(replace(STRING, damping_d1_kg_m_s=STRING.damping_d1_kg_m_s + added), 40)


def program(kind: str, resonator: Resonator | None = None, coarser: int = 15, rate_hz: int = RATE_HZ) -> Program:
    """Of the solver, or of a model as it starts."""
    own = resonator or resonator_of(STRING, 40)
    if kind == "truth":
        return solver_program(own, rate_hz, coarser)
    model = KoopmanTension(KoopmanTensionConfiguration(modes=own.modes))
    model.initialise("series", Physics(own, rate_hz), torch.Generator())
    curves = {name: getattr(model, name).detach().numpy() for name in CURVES}
    return tension_program(curves, model.configuration, own, rate_hz)


def sound(of: Program, changes: Changes, quanta: int = 300, ear: Ear = EAR) -> Signal:
    """The sound, (frames,), of a string that is plucked and then changed."""
    voices, blocks, done = [ChangingVoice(of, ear=ear)], [], 0
    mixer = mixer_of(*voices)
    for quantum, change, seconds in changes:
        blocks.append(mixer.render((quantum - done) * QUANTUM)[:, 0])
        done = quantum
        if isinstance(change, Resonator):
            voices[-1].retune(change, seconds)
        else:  # it is plucked again while it rings on
            voices.append(ChangingVoice(of, change, ear))
            voices[-1].record["previous_voice"] = voices[-2].address
            mixer.add(voices[-1])
    blocks.append(mixer.render((quanta - done) * QUANTUM)[:, 0])
    return np.concatenate(blocks).astype(np.float64)


BEND: Changes = [(40 + 2 * step, bent(step / 20), 0.002) for step in range(1, 41)]


@pytest.mark.parametrize(
    ("changes", "allowed"),
    [
        (BEND, 1e-9),
        ([(0, bent(2), 0.0)], 1e-9),
        ([(60, damped(0.1), 0.01), (160, bent(0), 0.01)], 1e-9),
        ([(50, bent(1), 0.0), (70, Pluck(0.6, 4.0, "raised_cosine", 0.15), 0.0), (90, bent(-1), 0.02)], 1e-6),
    ],
    ids=["a slow bend", "bent before it is struck", "damped and free again", "all"],
)
def test_the_model_follows_the_truth_through_every_change(changes: Changes, allowed: float) -> None:
    """Relative MSE of 0.4 s with a tension rise of 2 %."""
    assert relative(sound(program("model"), changes), sound(program("truth", coarser=1), changes)) ** 2 < allowed


def test_the_truth_is_the_equation_whose_modes_change() -> None:
    """Against DOP853, quantum by quantum, with the modes that the voice had then."""
    first, last, quanta = resonator_of(STRING, 4), resonator_of(replace(STRING, tension_n=95.0, length_m=0.6), 4), 12
    of = program("truth", first, coarser=1)
    voice = ChangingVoice(of)
    voice.begin_at_once()
    mixer = mixer_of(voice)
    heard = [mixer.render(4 * QUANTUM)[:, 0]]
    voice.retune(last, 5 * QUANTUM / RATE_HZ)
    heard.append(mixer.render((quanta - 4) * QUANTUM)[:, 0])

    q = first.to_modes(PLUCK.displacement(101))
    state, expected, weights = np.concatenate([q, 0 * q]), [], of.weights(EAR)[0][0, :4]
    for quantum in range(quanta):
        share = min(max((quantum - 3) / 5, 0.0), 1.0)
        own = [(1 - share) * a + share * b for a, b in zip(resonator_rows(first), resonator_rows(last), strict=True)]

        def slope(_s: float, y: Signal, own: list[Signal]) -> Signal:
            a, v = y[:4], y[4:]
            return np.concatenate([v, -2 * own[1] * v - own[0] * a - own[2] * a * (own[3] * a * a).sum()])

        times, most = np.arange(QUANTUM + 1) / RATE_HZ, {"rtol": 1e-11, "atol": 1e-15}
        solved = solve_ivp(slope, (0, times[-1]), state, "DOP853", times, args=(own,), **most).y
        expected.append(weights @ solved[:4, :-1])
        state = solved[:, -1]
    assert np.abs(np.concatenate(heard) - np.concatenate(expected)).max() < 2e-7  # the sound is float32


@pytest.mark.parametrize("kind", ["model", "truth"])
@pytest.mark.parametrize("pickup", ["displacement", "velocity"])
def test_a_soft_second_pluck_leaves_the_loud_tail_without_a_click(kind: str, pickup: str) -> None:
    """Of next to nothing, sample by sample: the motion continues in its own time, however far ahead it was made."""
    of, ear = program(kind), Ear((0.37, 0.6), pickup)
    soft, faint = (Pluck(0.3, amplitude_mm, "raised_cosine", 0.2) for amplitude_mm in (0.02, 1e-4))
    alone, touched = sound(of, [], ear=ear), sound(of, [(100, soft, 0.0)], ear=ear)
    after, joint = slice(101 * QUANTUM, 200 * QUANTUM), slice(99 * QUANTUM, 104 * QUANTUM)
    assert np.std(touched[after]) == pytest.approx(np.std(alone[after]), rel=0.05)
    bend, usual = np.abs(np.diff(touched, 2))[joint].max(), np.abs(np.diff(alone, 2))[joint].max()
    assert bend < 1.2 * usual
    touched = sound(of, [(100, faint, 0.0), (140, faint, 0.0)], ear=ear)
    np.testing.assert_allclose(touched, alone, atol=2e-4 * np.abs(alone).max())


def test_modes_above_half_the_rate_are_silent_from_the_start() -> None:
    own, low_hz = resonator_of(STRING, 80), 16_000
    below = int((own.omega < 3.0 * low_hz).sum())
    assert below < 80
    found, expected = (
        mixer_of(ChangingVoice(program("model", each, rate_hz=low_hz)), rate_hz=low_hz).render(3_200)
        for each in (own, resonator_of(STRING, below))
    )
    np.testing.assert_allclose(found, expected, atol=1e-4)


@pytest.mark.parametrize("kind", ["model", "truth"])
def test_modes_that_are_bent_beyond_half_the_rate_are_laid_to_rest(kind: str) -> None:
    high = resonator_of(STRING, 80)
    assert float(high.omega[-1]) / (2 * math.pi) > 0.45 * RATE_HZ / 2
    up = resonator_of(replace(STRING, tension_n=STRING.tension_n * 16), 80)  # two octaves
    heard = sound(program(kind, high), [(20, up, 0.01)])
    assert np.isfinite(heard).all()
    assert 0.001 < np.abs(heard[-6400:]).max() < 4 * PLUCK.amplitude_mm / 1000 / FULL_SCALE_M

"""The law of `koopman_tension`, which its module states, on arrays and on tensors alike, and the arrays of a file.

`KoopmanTension` is this law with weights that torch can train. `TensionArrays` is the same law of a file's arrays:
presets of many strings are read, played and drawn without torch.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.array_library import Values, as_array, in_double, library_of
from engine.kernels.scheme import ENERGY_BOUND, HARDEST_KICK, MOST_NODES
from engine.models.configurations import KoopmanTensionConfiguration
from engine.resonators.base import Array, Resonator

CURVES = ("A", "r", "p")  # what is learned; the rest follows from the resonator
SAME_RESONATOR = 1e-9  # relative: processors round logarithms and sines differently
SLOWEST_LOG = -24.0  # ν_log of a mode without losses: after a minute at 48 kHz it is 0.001 dB down
SILENCE = 1e-9  # of a mode, of all: what is left out is 180 dB down
FRAMES_AT_ONCE = 4096
LEAST_GROWTH = 1e-9  # of A in a quotient: gradients stay finite


@dataclass(frozen=True)
class KoopmanTensionState:
    """The state of the latents.

    *Nodes* divide each frame evenly; at each of them the tension kicks the latents, see `koopman_tension`.

    Attributes:
        x, y: z before the kick at the present node, float64 (batch, modes); before the first frame, the mode itself:
            q and -(v + σq)/ω.
        largest_energy: bound of Σ ω² |z|² at the present, (batch,).
        largest_stretch: bound of S, (batch,).
        nodes: how many there are in a frame, (batch,); None before the first frame.
        begun: whether a frame was asked for: before it x and y are the mode itself.
    """

    x: Values
    y: Values
    largest_energy: Values
    largest_stretch: Values
    nodes: NDArray[np.int64] | None = None
    begun: bool = False

    def rows(self, index: NDArray[np.int64]) -> KoopmanTensionState:
        """The state of the strings with these numbers, int64 (strings,)."""
        x, y, energy, stretch = (getattr(self, name)[index] for name in OF_STRINGS)
        nodes = None if self.nodes is None else self.nodes[index]
        return KoopmanTensionState(x, y, energy, stretch, nodes, self.begun)


OF_STRINGS = ("x", "y", "largest_energy", "largest_stretch")  # fields with a row for each string


class Step(NamedTuple):
    """The factors of a step from node to node, `nodes` of them to a frame; float64 (modes,) each.

    The length of a step is h = 1/nodes frames; A, r and p are the learned curves at the phase hω, and κ = h² k.
    """

    nodes: int
    decay: float  # of the largest energy, a frame
    cosine: Values  # Re λ
    sine: Values  # Im λ
    kick: Values  # h k A/ω
    stretch: Values  # η² A
    ratio: Values  # κ r/A; 0 where A is 0
    seen: Values  # κ p
    squares: Values  # ω²

    @property
    def rows(self) -> Values:
        """The rows for `engine.kernels.tension`, (7, modes)."""
        return library_of(self.cosine).stack(self[2:])


Run = Callable[[KoopmanTensionState, Step], tuple[Values, KoopmanTensionState]]  # of strings with so many nodes


class TensionLaw:
    """The law. All values that it takes are of the library that made its weights.

    Attributes:
        A, r, p: what is learned; A is that of (A - 1)/(hω)².
        nu_log: of σ, 1/samples.
        theta_log: of ω, rad/sample.
        coupling: k in 1/samples².
        stretch: η² in 1/(normalised displacement)².
        shapes, analysis: amplitudes to displacement, (modes, grid_points), and back, (grid_points, modes).
    """

    configuration: KoopmanTensionConfiguration
    A: Values
    r: Values
    p: Values
    nu_log: Values
    theta_log: Values
    coupling: Values
    stretch: Values
    shapes: Values
    analysis: Values

    def encode(self, displacement: Values, velocity: Values = None) -> KoopmanTensionState:
        """See the contract; here of strings that may ring.

        Args:
            velocity: in normalised displacement a sample, (batch, grid_points); None: at rest.
        """
        v = None if velocity is None else in_double(velocity) @ self.analysis
        return self.encode_modes(in_double(displacement) @ self.analysis, v)

    def encode_modes(self, q: Values, v: Values = None) -> KoopmanTensionState:
        """Encode amplitudes and speeds of the modes, (batch, modes): as `encode`, for a blow or few points."""
        sigma, omega = self._rates()
        x, y = q, -sigma * q / omega
        if v is not None:
            y = y - v / omega
        stretch = (self._stretch * q**2).sum(-1)
        # 2 × the energy: of the linear string, and what the tension holds
        energy = (omega**2 * (x**2 + y**2)).sum(-1)
        energy = ENERGY_BOUND * (energy + 0.5 * stretch * (self._coupling * q**2).sum(-1))
        largest_stretch = energy * (self._stretch / omega**2).max()
        return KoopmanTensionState(x, y, energy, largest_stretch)

    def advance(
        self, state: KoopmanTensionState, steps: int, readout: Values = None
    ) -> tuple[Values, KoopmanTensionState]:
        """See the contract."""
        return self._by_nodes(state, lambda part, step: self._frames(part, step, None, steps, readout))

    def sample(self, state: KoopmanTensionState, frames: Values, steps: int) -> tuple[Values, KoopmanTensionState]:
        """See the contract. It steps through all frames, which costs little beside their shapes."""
        return self._by_nodes(state, lambda part, step: self._frames(part, step, frames, steps, None))

    def amplitudes(self, state: KoopmanTensionState, steps: int) -> Values:
        """Modal amplitudes of the next frames, float64 (batch, steps, modes), without gradients, on the CPU."""
        return self.advance_modes(state, steps)[0]

    def advance_modes(self, state: KoopmanTensionState, steps: int) -> tuple[Values, KoopmanTensionState]:
        """The frames of `amplitudes`, and the state after them."""
        return self._by_nodes(state, lambda part, step: self._compiled(part, step, steps))

    def _by_nodes(self, state: KoopmanTensionState, run: Run) -> tuple[Values, KoopmanTensionState]:
        """The motion of all strings, (batch, …), and the state after it: `run` takes those with equal nodes together.

        Before the first frame, nodes are chosen and the strings set out.
        """
        nodes = self._nodes(state) if state.nodes is None else state.nodes
        state, ran = replace(state, nodes=nodes), []  # ran: motion and state of each group
        counts = np.unique(nodes).tolist() or [1]  # of no string, any
        groups = [np.flatnonzero(nodes == count) for count in counts]
        for count, rows in zip(counts, groups, strict=True):
            part, step = state.rows(rows), self.step(count)
            ran.append(run(part if state.begun else self._set_out(part, step), step))
        if len(ran) == 1:
            return ran[0]
        # place: where each string of the batch is in the groups, one behind the other
        place, join = np.concatenate(groups).argsort(), library_of(state.x).concatenate
        x, y, energy, stretch = (join([getattr(part, name) for _, part in ran])[place] for name in OF_STRINGS)
        state = KoopmanTensionState(x, y, energy, stretch, nodes, begun=True)
        return join([out for out, _ in ran])[place], state

    def _frames(
        self,
        state: KoopmanTensionState,
        step: Step,
        wanted: Values,
        steps: int,
        readout: Values,
    ) -> tuple[Values, KoopmanTensionState]:
        """The motion of the next `steps` frames, and the state after them; in blocks, to bound the memory.

        Args:
            wanted: numbers of the frames to keep, ascending, of 1 … steps; None: all.
            readout: see `advance`; None: the grid.
        """
        to_points = self.shapes if readout is None else self.shapes @ in_double(readout)
        blocks, done = [], 0
        while done < steps:
            count = min(FRAMES_AT_ONCE, steps - done)
            amplitudes, state = (self._compiled if _compiles(state.x) else self._plain)(state, step, count)
            if wanted is not None:
                amplitudes = amplitudes[:, wanted[(wanted > done) & (wanted <= done + count)] - done - 1]
            blocks.append(amplitudes @ to_points)
            done += count
        return library_of(state.x).concatenate(blocks, 1), state

    def _nodes(self, state: KoopmanTensionState) -> NDArray[np.int64]:
        """The number of nodes in a frame, for strings as they set out, (batch,)."""
        c, (_, omega) = self.configuration, self._rates()
        fastest = max(float(omega[0]) / c.node_phase, float(omega[-1]) / c.highest_phase)
        swings = state.x**2 + self._swing(state) ** 2
        kick = as_array(swings @ (self._stretch * self._coupling)) ** 0.5
        closest = np.ceil(np.clip(kick / HARDEST_KICK, fastest, MOST_NODES * fastest))
        return np.where(closest > 1, closest, 1).astype(np.int64)  # 1 where it is not a number

    def step(self, nodes: int) -> Step:
        """The factors of a step where a frame has so many nodes."""
        library, (sigma, omega) = library_of(self.A), self._rates()
        h = 1 / nodes
        phase = h * omega
        growth, r, p = self._curves(phase)
        kappa = h * h * self._coupling
        shrunk, angle = library.exp(-h * sigma), h * self._coupling / omega
        return Step(
            nodes,
            math.exp(-2 * float(sigma.min())),
            shrunk * library.cos(phase),
            shrunk * library.sin(phase),
            angle * growth,
            self._stretch * growth,
            library.where(growth > 0, kappa * r / library.clip(growth, LEAST_GROWTH, None), 0.0),
            kappa * p,
            omega**2,
        )

    def _curves(self, phase: Values) -> tuple[Values, Values, Values]:
        """A, r and p, (modes,) each and within their bounds, at phases hω (modes,) in rad."""
        library = library_of(phase)
        argument = library.clip(2 * (phase / self.configuration.highest_phase) ** 2 - 1, -1, 1)
        orders = library.arange(len(self.A), dtype=library.float64)
        basis = library.cos(orders * library.arccos(argument)[:, None])
        with np.errstate(over="ignore", invalid="ignore"):  # weights are any numbers
            growth = 1 + phase**2 * (basis @ self.A)
            return (
                library.clip(growth, 0, 2),
                library.clip(basis @ self.r, -1, 1),
                library.clip(basis @ self.p, -1, 1),
            )

    def _swing(self, state: KoopmanTensionState) -> Values:
        """v/ω of strings before their first frame, (batch, modes); exactly 0 at rest."""
        sigma, omega = self._rates()
        return -state.y - sigma * state.x / omega

    def _set_out(self, state: KoopmanTensionState, step: Step) -> KoopmanTensionState:
        """The state in the coordinates in which kicks act, half a kick before the first node.

        Args:
            state: before the first frame, as `encode_modes` gives it.
        """
        q = state.x
        swing = self._swing(state)
        (_, omega) = self._rates()
        share = step.seen * (self._stretch * q**2).sum(-1)[..., None]
        x = q * (1 + share)
        # of w/ω, whose sum Σ η² q w follows from that of v
        moved = (self._stretch * q * omega * swing / (1 + share)).sum(-1)[..., None]
        moved = moved / (1 + 2 * (step.seen * self._stretch * q**2 / (1 + share)).sum(-1)[..., None])
        lifted = (swing - 2 * step.seen * q * moved / omega) / (1 + share)
        first = library_of(x).minimum((step.stretch * x**2).sum(-1), state.largest_stretch)[..., None]
        second = (step.stretch * step.ratio * x**2).sum(-1)[..., None]
        kick = step.kick * (first * (1 - 2 * second) - step.ratio * first**2)
        return replace(state, x=x, y=state.y + (swing - lifted) - 0.5 * kick * x, begun=True)

    def _compiled(self, state: KoopmanTensionState, step: Step, steps: int) -> tuple[Values, KoopmanTensionState]:
        """The amplitudes of the next frames, (batch, steps, modes), and the state after them, without gradients."""
        from engine.kernels.tension import advance  # Numba only when it is needed

        x, y, largest = (as_array(part).copy() for part in (state.x, state.y, state.largest_energy))
        largest_stretch = np.ascontiguousarray(as_array(state.largest_stretch))
        out = np.empty((len(x), steps, x.shape[1]))
        advance(x, y, largest, largest_stretch, step.decay, step.nodes, SILENCE, as_array(step.rows), out)
        restore = library_of(state.x).asarray
        return restore(out), replace(state, x=restore(x), y=restore(y), largest_energy=restore(largest))

    def _plain(self, state: KoopmanTensionState, step: Step, steps: int) -> tuple[Values, KoopmanTensionState]:
        """The results of `_compiled`, in operations that gradients pass through: the definition."""
        library = library_of(state.x)
        x = state.x
        y = state.y
        largest = state.largest_energy
        frames = []
        for _ in range(steps):
            for _ in range(step.nodes):
                first = library.minimum(x**2 @ step.stretch, state.largest_stretch)[:, None]
                second = (x**2 @ (step.stretch * step.ratio))[:, None]
                y = y + step.kick * (first * (1 - 2 * second) - step.ratio * first**2) * x
                x, y = step.cosine * x - step.sine * y, step.sine * x + step.cosine * y
            largest = largest * step.decay
            energy = (x**2 + y**2) @ step.squares
            share = largest / library.clip(energy, 1e-300, None)
            held = library.where(energy > largest, library.sqrt(share), 1.0)[:, None]
            x, y = x * held, y * held
            frames.append(x * (1 - step.seen * (x**2 @ step.stretch)[:, None]))
        return library.stack(frames, 1), replace(state, x=x, y=y, largest_energy=largest)

    def _rates(self) -> tuple[Values, Values]:
        """σ in 1/samples and ω in rad a sample, (modes,) each, held where exponentials are finite."""
        library = library_of(self.nu_log)
        return library.exp(library.clip(self.nu_log, -30, 5)), library.exp(library.clip(self.theta_log, -16, 6))

    def log_eigenvalues(self) -> list[Values]:
        """The log eigenvalues of a quiet string."""
        sigma, omega = self._rates()
        return [-sigma + 1j * omega]

    @property
    def _coupling(self) -> Values:
        return library_of(self.coupling).clip(self.coupling, 0, None)

    @property
    def _stretch(self) -> Values:
        return library_of(self.stretch).clip(self.stretch, 0, None)


class TensionArrays(TensionLaw):
    """The model of a file's arrays, in NumPy; it cannot be trained."""

    def __init__(self, configuration: KoopmanTensionConfiguration, arrays: Mapping[str, NDArray[np.float64]]) -> None:
        self.configuration = configuration
        for name in shapes_of_arrays(configuration):
            setattr(self, name, arrays[name])


def shapes_of_arrays(c: KoopmanTensionConfiguration) -> dict[str, tuple[int, ...]]:
    """The shape of each float64 array, by name."""
    modes = (c.modes,)
    return {
        **dict.fromkeys(CURVES, (c.degree + 1,)),
        **dict.fromkeys(("nu_log", "theta_log", "coupling", "stretch"), modes),
        "shapes": (c.modes, c.grid_points),
        "analysis": (c.grid_points, c.modes),
    }


def resonator_arrays(
    c: KoopmanTensionConfiguration, resonator: Resonator, rate_hz: float, scale_m: float
) -> dict[str, Array]:
    """The arrays of a resonator, its modes first; latents to spare rest: no shape, and no share in the tension.

    Args:
        scale_m: the model's unit of displacement.

    Raises:
        ValueError: it has more modes than the model, or another grid.
    """
    n = resonator.modes
    if n > c.modes or resonator.points != c.grid_points:
        raise ValueError(
            f"model_configuration.modes is {c.modes} on {c.grid_points} points, the resonator has {n} modes on "
            f"{resonator.points}"
        )
    spare = ((0, c.modes - n),)
    analysis = np.zeros((resonator.points, n)) if resonator.analysis is None else resonator.analysis
    eigenvalues = np.pad(resonator.eigenvalues() / rate_hz, spare, "edge")
    with np.errstate(divide="ignore"):  # without losses
        nu_log = np.maximum(np.log(-eigenvalues.real), SLOWEST_LOG)
    return {
        "nu_log": nu_log,
        "theta_log": np.log(eigenvalues.imag),
        "coupling": np.pad(resonator.coupling / rate_hz**2, spare),
        "stretch": np.pad(resonator.stretch * scale_m**2, spare),
        "shapes": np.pad(resonator.shapes, (*spare, (0, 0))),
        "analysis": np.pad(analysis, ((0, 0), *spare)),
    }


def check_resonator(arrays: Mapping[str, Array], expected: Mapping[str, Array]) -> None:
    """Raise ValueError, naming the array, where one is of another resonator than expected."""
    for name, array in expected.items():
        atol = 1e-3 * SAME_RESONATOR * float(np.abs(array).max())
        if not np.allclose(arrays[name], array, rtol=SAME_RESONATOR, atol=atol):
            raise ValueError(f"tensor {name!r} is of another string, or of other modes, rate_hz or scale_m")


def _compiles(values: Values) -> bool:
    """Return True if compiled code may take them: no gradients are wanted of them."""
    if isinstance(values, np.ndarray):
        return True
    return values.device.type == "cpu" and not library_of(values).is_grad_enabled()

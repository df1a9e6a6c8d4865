"""Koopman latents that share one tension: one model for every string.

A latent z_n = x_n + iy_n is a mode: with λ_n = e^{h(-σ_n + iω_n)} of the resonator it turns and decays as the linear
string does, an eigenfunction of its Koopman operator. At nodes, h apart, the tension that the stretch of all modes
adds turns them together (κ_n = h² k_n, which is a share of (hω_n)²):

    S = Σ_m η_m² A_m x_m²,    R = Σ_m η_m² κ_m r_m x_m²,
    y_n ← y_n + (h k_n/ω_n) [A_n S (1 - 2R) - κ_n r_n S²] x_n,      z_n ← λ_n z_n,

the exact flow of the potential c/4 (S² - 2 S² R), between exact flows of the damped linear string. What sets out and
the output uses other coordinates than those in which the kicks act:

    x_n(0) = q_n (1 + p_n κ_n S₀),      q̂_n = x_n (1 - p_n κ_n S),      S₀ = Σ_m η_m² q_m².

Momenta go with the coordinates. A string that rings sets out with the speed w instead of its own, v:

    v_n = w_n (1 + p_n κ_n S₀) + 2 p_n κ_n q_n Σ_m η_m² q_m w_m,      y_n(0) = -(w_n + σ_n q_n)/ω_n,

the momentum that belongs to x where p is one number (the lift of a point transformation, as the processor of Blanes,
Casas and Ros needs it). Half a kick before the first node follows. From rest, w = v = 0.

A, r and p are what is learned: three curves over the phase hω that a mode turns between two nodes, even polynomials
(Chebyshev, of (hω)²), A(0) = 1. They are shared by all modes of all strings, so that the model takes any resonator
with any number of modes: pitch, length, density and tension change nothing but λ and κ, inharmonicity and damping
enter by them too. At rest all corrections vanish: a quiet string is the linear one, exactly.

What they have to learn is the error that kicks at nodes make, and it is large: without them, a hundred nodes in a
period of the first mode leave 1e-7 to 1e-3 of a second's energy wrong. For h → 0 backward error analysis gives
them: r = p = 1/12 (Takahashi and Imada 1984; Blanes, Casas and Ros 1999 for a processed integrator), the start
"series". A fit that sets out from 0 finds the twelfths by itself, and departs from them where hω is not small.

Stability. A is held in 0 … 2, r and p in -1 … 1, S below what the energy at the start allows, and after each frame
Σ ω² |z|² below 1.5 times that energy, falling as the slowest mode does: for every value of every weight the motion is
bounded and decays to silence. A string never comes near that bound, and neither does a model that is any good.

Any rate: nodes are a whole number to a frame, as many as keep ω₁h below `node_phase` and the highest mode's below
`highest_phase` (where two modes' phases add up to 2π, kicks would pump them). A pluck that is hard and has its
stretch in high modes takes more of them, as many as keep Σ η²κ (q² + v²/ω²) at its start below
`HARDEST_KICK`²: that sum is the square of the phase of the modes that stretch the string, times how far they raise
the tension.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import torch
from torch import Tensor, nn

from engine.kernels.scheme import ENERGY_BOUND, HARDEST_KICK, MOST_NODES
from engine.models._tension_arrays import resonator_arrays
from engine.models.base import LINEAR_STRING, AnyFrameModel, Physics, check_initialisation
from engine.models.configurations import KoopmanTensionConfiguration

SERIES = 1 / 12  # r and p of small hω
SILENCE = 1e-9  # of a mode, of all: what is left out is 180 dB down
FRAMES_AT_ONCE = 4096
LEAST_GROWTH = 1e-9  # of A in a quotient: gradients stay finite


@dataclass(frozen=True)
class KoopmanTensionState:
    """The state of the latents.

    Attributes:
        x, y: z before the kick at the present node, float64 (batch, modes); before the first frame, the mode itself:
            q and -(v + σq)/ω.
        largest_energy: of Σ ω² |z|², at the present, (batch,).
        largest_stretch: of S, (batch,).
        nodes: of a frame, int64 (batch,); None before the first.
        begun: whether a frame was asked for: before it x and y are the mode itself.
    """

    x: Tensor
    y: Tensor
    largest_energy: Tensor
    largest_stretch: Tensor
    nodes: Tensor | None = None
    begun: bool = False

    def rows(self, index: Tensor) -> KoopmanTensionState:
        """The state of some of the strings."""
        x, y, energy, stretch, nodes = (getattr(self, name)[index] for name in OF_STRINGS)
        return KoopmanTensionState(x, y, energy, stretch, nodes, self.begun)


OF_STRINGS = ("x", "y", "largest_energy", "largest_stretch", "nodes")


class Step(NamedTuple):
    """The factors of a step from node to node, `nodes` of them to a frame; float64 (modes,) each."""

    nodes: int
    decay: float  # of the largest energy, a frame
    cosine: Tensor  # Re λ
    sine: Tensor  # Im λ
    kick: Tensor  # h k A/ω
    stretch: Tensor  # η² A
    ratio: Tensor  # κ r/A; 0 where A is
    seen: Tensor  # κ p
    squares: Tensor  # ω²

    @property
    def rows(self) -> Tensor:
        """The rows for `engine.kernels.tension`, (7, modes)."""
        return torch.stack(self[2:])


Run = Callable[[KoopmanTensionState, Step], tuple[Tensor, KoopmanTensionState]]  # of strings with so many nodes


class KoopmanTension(AnyFrameModel[KoopmanTensionState]):
    """See the module. The resonator is a buffer: `for_resonator` gives the same model of another."""

    initialisations: ClassVar = {
        "kicks": f"{LINEAR_STRING}, and how tension couples them",
        "series": f"{LINEAR_STRING}, how tension couples them, and the error of kicks for small steps",
    }

    def __init__(self, configuration: KoopmanTensionConfiguration) -> None:
        super().__init__()
        self.configuration = c = configuration
        self.grid_points = c.grid_points
        curve = (c.degree + 1,)
        self.A = nn.Parameter(torch.zeros(curve, dtype=torch.float64))  # of (A - 1)/(hω)²
        self.r = nn.Parameter(torch.zeros(curve, dtype=torch.float64))
        self.p = nn.Parameter(torch.zeros(curve, dtype=torch.float64))
        self.nu_log: Tensor  # of σ, 1/samples
        self.theta_log: Tensor  # of ω, rad/sample
        self.coupling: Tensor  # k in 1/samples²
        self.stretch: Tensor  # η² in 1/(normalised displacement)²
        self.shapes: Tensor
        self.analysis: Tensor
        for name in ("nu_log", "theta_log", "coupling", "stretch"):
            self.register_buffer(name, torch.zeros(c.modes, dtype=torch.float64))
        self.register_buffer("shapes", torch.zeros(c.modes, c.grid_points, dtype=torch.float64))
        self.register_buffer("analysis", torch.zeros(c.grid_points, c.modes, dtype=torch.float64))

    def initialise(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """See the contract. kicks: no correction. series: those that backward error analysis knows."""
        check_initialisation(self, how)
        with torch.no_grad():
            for curve in (self.A, self.r, self.p):
                curve.zero_()
            if how == "series":
                self.r[0] = self.p[0] = SERIES
            self._take(physics)

    @torch.no_grad()
    def for_resonator(self, physics: Physics) -> KoopmanTension:
        """The learned model with another resonator, rate or scale."""
        resonator = physics.resonator
        sizes = replace(self.configuration, modes=resonator.modes, grid_points=resonator.points)
        other = KoopmanTension(sizes)
        for name in ("A", "r", "p"):
            getattr(other, name).copy_(getattr(self, name))
        other._take(physics)
        return other.train(self.training)

    def encode(self, displacement: Tensor, velocity: Tensor | None = None) -> KoopmanTensionState:
        """See the contract; here of strings that may ring.

        Args:
            velocity: in normalised displacement a sample, (batch, grid_points); None: at rest.
        """
        v = None if velocity is None else velocity.double() @ self.analysis
        return self.encode_modes(displacement.double() @ self.analysis, v)

    def encode_modes(self, q: Tensor, v: Tensor | None = None) -> KoopmanTensionState:
        """Encode amplitudes and speeds of the modes, (batch, modes): as `encode`, for a blow or few points."""
        sigma, omega = self._rates()
        x, y = q, -sigma * q / omega
        if v is not None:
            y = y - v / omega
        stretch = (self._stretch * q.square()).sum(-1)
        # 2 × the energy: of the linear string, and what the tension holds
        energy = (omega.square() * (x.square() + y.square())).sum(-1)
        energy = ENERGY_BOUND * (energy + 0.5 * stretch * (self._coupling * q.square()).sum(-1))
        largest_stretch = energy * (self._stretch / omega.square()).amax()
        return KoopmanTensionState(x, y, energy, largest_stretch)

    def advance(
        self, state: KoopmanTensionState, steps: int, readout: Tensor | None = None
    ) -> tuple[Tensor, KoopmanTensionState]:
        return self._by_nodes(state, lambda part, step: self._frames(part, step, None, steps, readout))

    def sample(self, state: KoopmanTensionState, frames: Tensor, steps: int) -> tuple[Tensor, KoopmanTensionState]:
        """See the contract. It steps through all frames, which costs little beside their shapes."""
        return self._by_nodes(state, lambda part, step: self._frames(part, step, frames, steps, None))

    def _by_nodes(self, state: KoopmanTensionState, run: Run) -> tuple[Tensor, KoopmanTensionState]:
        """Strings with the same number of nodes go together."""
        nodes = self._nodes(state) if state.nodes is None else state.nodes
        state, ran = replace(state, nodes=nodes), []
        groups = [(nodes == count).nonzero()[:, 0] for count in nodes.unique()]
        for rows in groups:
            part, step = state.rows(rows), self.step(int(nodes[rows[0]]))
            ran.append(run(part if state.begun else self._set_out(part, step), step))
        if len(ran) == 1:
            return ran[0]
        place = torch.cat(groups).argsort()
        joined = (torch.cat([getattr(part, name) for _, part in ran])[place] for name in OF_STRINGS)
        x, y, energy, stretch, nodes = joined
        state = KoopmanTensionState(x, y, energy, stretch, nodes, begun=True)
        return torch.cat([out for out, _ in ran])[place], state

    def _frames(
        self,
        state: KoopmanTensionState,
        step: Step,
        frames: Tensor | None,
        steps: int,
        readout: Tensor | None,
    ) -> tuple[Tensor, KoopmanTensionState]:
        to_points = self.shapes if readout is None else self.shapes @ readout.double()
        blocks, done = [], 0
        while done < steps:
            count = min(FRAMES_AT_ONCE, steps - done)
            compiled = state.x.device.type == "cpu" and not torch.is_grad_enabled()
            amplitudes, state = (self._compiled if compiled else self._plain)(state, step, count)
            if frames is not None:
                amplitudes = amplitudes[:, frames[(frames > done) & (frames <= done + count)] - done - 1]
            blocks.append(amplitudes @ to_points)
            done += count
        return torch.cat(blocks, dim=1), state

    @torch.no_grad()
    def amplitudes(self, state: KoopmanTensionState, steps: int) -> Tensor:
        """Modal amplitudes of the next frames, float64 (batch, steps, modes), without gradients, on the CPU."""
        return self.advance_modes(state, steps)[0]

    @torch.no_grad()
    def advance_modes(self, state: KoopmanTensionState, steps: int) -> tuple[Tensor, KoopmanTensionState]:
        """The frames of `amplitudes`, and the state after them."""
        return self._by_nodes(state, lambda part, step: self._compiled(part, step, steps))

    def _nodes(self, state: KoopmanTensionState) -> Tensor:
        """The number of nodes in a frame, for strings as they set out, (batch,)."""
        c, (_, omega) = self.configuration, self._rates()
        fastest = max(float(omega[0]) / c.node_phase, float(omega[-1]) / c.highest_phase)
        swings = (state.x.square() + self._swing(state).square()).detach()
        kick = (swings @ (self._stretch * self._coupling)).sqrt()
        closest = (kick / HARDEST_KICK).clamp(min=fastest, max=MOST_NODES * fastest)
        return closest.ceil().clamp(min=1).long()

    def step(self, nodes: int) -> Step:
        """The step from node to node."""
        sigma, omega = self._rates()
        h = 1 / nodes
        phase = h * omega
        growth, r, p = self._curves(phase)
        kappa = h * h * self._coupling
        shrunk, angle = torch.exp(-h * sigma), h * self._coupling / omega
        return Step(
            nodes,
            math.exp(-2 * float(sigma.min())),
            shrunk * phase.cos(),
            shrunk * phase.sin(),
            angle * growth,
            self._stretch * growth,
            torch.where(growth > 0, kappa * r / growth.clamp(min=LEAST_GROWTH), 0.0),
            kappa * p,
            omega.square(),
        )

    def _curves(self, phase: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """A, r and p of phases hω."""
        argument = (2 * (phase / self.configuration.highest_phase).square() - 1).clamp(-1, 1)
        basis = torch.cos(torch.arange(len(self.A), dtype=torch.float64) * torch.arccos(argument)[:, None])
        growth = 1 + phase.square() * (basis @ self.A)
        return growth.clamp(0, 2), (basis @ self.r).clamp(-1, 1), (basis @ self.p).clamp(-1, 1)

    def _swing(self, state: KoopmanTensionState) -> Tensor:
        """v/ω of strings before their first frame, (batch, modes); exactly 0 at rest."""
        sigma, omega = self._rates()
        return -state.y - sigma * state.x / omega

    def _set_out(self, state: KoopmanTensionState, step: Step) -> KoopmanTensionState:
        """The coordinates in which kicks act, half a kick before the first node."""
        q, swing, (_, omega) = state.x, self._swing(state), self._rates()
        share = step.seen * (self._stretch * q.square()).sum(-1, keepdim=True)
        x = q * (1 + share)
        # of w/ω, whose sum Σ η² q w follows from that of v
        moved = (self._stretch * q * omega * swing / (1 + share)).sum(-1, keepdim=True)
        moved = moved / (1 + 2 * (step.seen * self._stretch * q.square() / (1 + share)).sum(-1, keepdim=True))
        lifted = (swing - 2 * step.seen * q * moved / omega) / (1 + share)
        first = torch.minimum((step.stretch * x.square()).sum(-1, keepdim=True), state.largest_stretch[:, None])
        second = (step.stretch * step.ratio * x.square()).sum(-1, keepdim=True)
        kick = step.kick * (first * (1 - 2 * second) - step.ratio * first.square())
        return replace(state, x=x, y=state.y + (swing - lifted) - 0.5 * kick * x, begun=True)

    def _compiled(self, state: KoopmanTensionState, step: Step, steps: int) -> tuple[Tensor, KoopmanTensionState]:
        from engine.kernels.tension import advance  # Numba only when it is needed

        x, y, largest = state.x.clone().contiguous(), state.y.clone().contiguous(), state.largest_energy.clone()
        out = x.new_empty(len(x), steps, x.shape[1])
        of_rows = largest.numpy(), state.largest_stretch.numpy()
        advance(
            x.numpy(), y.numpy(), *of_rows, step.decay, step.nodes, SILENCE, step.rows.detach().numpy(), out.numpy()
        )
        return out, replace(state, x=x, y=y, largest_energy=largest)

    def _plain(self, state: KoopmanTensionState, step: Step, steps: int) -> tuple[Tensor, KoopmanTensionState]:
        """The definition, which gradients pass through."""
        x, y, largest = state.x, state.y, state.largest_energy
        frames = []
        for _ in range(steps):
            for _ in range(step.nodes):
                first = (x.square() @ step.stretch).minimum(state.largest_stretch)[:, None]
                second = (x.square() @ (step.stretch * step.ratio))[:, None]
                y = y + step.kick * (first * (1 - 2 * second) - step.ratio * first.square()) * x
                x, y = step.cosine * x - step.sine * y, step.sine * x + step.cosine * y
            largest = largest * step.decay
            energy = (x.square() + y.square()) @ step.squares
            held = torch.where(energy > largest, (largest / energy.clamp(min=1e-300)).sqrt(), 1.0)[:, None]
            x, y = x * held, y * held
            frames.append(x * (1 - step.seen * (x.square() @ step.stretch)[:, None]))
        return torch.stack(frames, dim=1), replace(state, x=x, y=y, largest_energy=largest)

    def _rates(self) -> tuple[Tensor, Tensor]:
        """σ and ω a sample."""
        return self.nu_log.clamp(-30, 5).exp(), self.theta_log.clamp(-16, 6).exp()

    @property
    def _coupling(self) -> Tensor:
        return self.coupling.clamp(min=0)

    @property
    def _stretch(self) -> Tensor:
        return self.stretch.clamp(min=0)

    def _take(self, physics: Physics) -> None:
        arrays = resonator_arrays(self.configuration, physics.resonator, physics.rate_hz, physics.scale_m)
        for name, array in arrays.items():
            getattr(self, name).copy_(torch.from_numpy(array))

    @torch.no_grad()
    def log_eigenvalues(self) -> list[Tensor]:
        """The log eigenvalues of a quiet string."""
        sigma, omega = self._rates()
        return [torch.complex(-sigma, omega)]

"""The integrated phase: Koopman with eigenvalues that follow the decaying energies, integrated over time.

A string's partials fall in pitch while it decays, because its tension falls: each frequency depends on the energies
of all modes, and a phase is the integral of a frequency. Koopman_var's multiplier sees the present energies only and
cannot hold that integral. Here, with z(0) = encoder(u₀) ∈ ℂⁿ, E_m(t) = |z_m(0)|² e^{-2σ_m t} and t in samples,

    z_n(t) = z_n(0) exp[(-σ_n + iω_n) t + b tanh(Re I_n(t) / b) + i Im I_n(t)],     û(t) = decoder(z(t)),
    I_n(t) = ∫₀ᵗ f_n(E(s)) ds,      f(E) = K E + g(E) - g(0),       K ∈ ℂⁿˣⁿ, g: ℝⁿ → ℂⁿ an MLP.

The linear term is integrated in closed form, ∫ = Σ_m K_nm E_m(0) (1 - e^{-2σ_m t}) / 2σ_m; the network by Simpson's
rule on nodes at fixed times, and between them by the cubic whose slope is the parabola through its samples. No
recursion: any time can be had in any order, whole samples or not, so a model renders at any sample rate.

Second order. g may count by Σ E_m, so that K E alone is f's first order, which averaging knows exactly: what is left
of f when the string has become quiet, long after the frames that a training sees.

Modulation. Averaging follows the mean tension; within a period it also swings, at twice the frequency of every mode,
and high modes swing with it. What that does to first order is a product, and its inverse leads into the averaged
coordinates (a near-identity transform):

    û = decoder(z ⊙ exp(M_out z²)),     z(0) = y ⊙ exp(M_in y²),  y = encoder(u₀),

with real matrices on [Re z², Im z²] that yield log gain (bounded as above) and phase.

Units. K, g and M receive the tension that each mode adds, as a share of that at rest, and yield shares of each mode's
frequency: numbers of the order of 1 for every mode, which an optimiser and a network need. A start from the physics
fills the units in.

Adiabatic change. The mean tension raises ω_n² by 2 ω_n κ_n, so that f has ω√(1 + 2κ/ω) - ω in place of κ. This
matters where the tension doubles. And what a falling tension leaves alone is a mode's action, ω q²: as the pitch
falls the amplitude gains. So |z| may be the action's root, which decays by σ alone; for then E(s) above is right long
after the start: κ = Im K q² is taken of the amplitudes that the actions E mean, q² = E / √(1 + 2κ/ω). With A_in
and A_out, real, the exponents have ± log(1 + 4|A q²|)/4 beside M z².

Stability. |z_n(t)| ≤ |z_n(0)| e^{b - σ_n t} with σ_n = exp(ν_n) > 0, because |tanh| ≤ 1: for every value of every
parameter a latent never exceeds e^b (`GAIN_LIMIT`) times its start and decays to zero. f may still change the
decay either way: the eigenvalue at time t is -σ_n + iω_n + Re f_n sech²(Re I_n / b) + i Im f_n. It is -σ + iω + f
while the change is small against b. And f(0) = 0: a quiet string is the linear one, so σ and ω are its own.

Sources: Lusch, Kutz, Brunton 2018 for eigenvalues given by an auxiliary network; Lindstedt's averaging for the
closed-form K of the tension-modulated string (`initialise`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, NamedTuple

import torch
from torch import Tensor, nn

from engine.models import eigenvalues
from engine.models._averaging import (
    adiabatic_change,
    averaged_amplitude,
    averaged_coupling,
    averaged_modulation,
    stiffening,
)
from engine.models._cubics import hermite, integrate_parabolas
from engine.models._diagonal import (
    dense_layers,
    draw_normal,
    draw_orthogonal,
    linear_string_eigenvalues,
    read_layer,
)
from engine.models.base import LINEAR_STRING, Physics, StringModel, StringModes
from engine.models.configurations import IntegratedPhaseConfiguration
from engine.models.eigenvalues import StoredEigenvalues

GAIN_LIMIT = 6.0 * math.log(10) / 20  # b in nepers: the largest change of level that Re f can add up to
RATE_UNIT = 1e-3  # of K E and of g in rad and nepers a sample: a weight of 1 turns a phase by 1 rad in a horizon
SEGMENT = 8  # samples at most between the times at which a render computes gain and phase again
# Node spacings h since the release, after which a voice's segments may be as long as such a spacing. Of the energies'
# decay at any rate σ at most h|f| (h/t)³ · 27e⁻³/384 is left, 1e-6 h|f|, and between two nodes the network's integral
# is a cubic itself.
SETTLED = 16
SILENCE = -40.0  # nepers in normalised units (4e-18) below which a render leaves a latent out
NUMBERS_AT_ONCE = 2**17  # frames times latents in a block of a long advance: what suits a processor's cache


@dataclass(frozen=True)
class IntegratedPhaseState:
    """The encoded start, the time reached, and what the network has added up.

    Attributes:
        origin: z(0), complex (batch, state_size).
        time: samples since then.
        integral: ∫ f(E) - K E from 0 to the node before the last one that `time` has reached, float64
            (batch, 2 state_size); the real parts come first.
    """

    origin: Tensor
    time: int
    integral: Tensor


class _Rates(NamedTuple):
    """The parameters of the motion in float64, once for all blocks."""

    sigma: Tensor  # σ, decay in 1/samples, (state_size,)
    omega: Tensor  # ω in rad a sample, (state_size,)
    coupling: Tensor  # K transposed: E @ coupling is in nepers, then in rad a sample, (state_size, 2 state_size)


class _Motion(NamedTuple):
    """The motion beside the decay e^{-σt}: float64 (batch, times, state_size) each."""

    gain: Tensor  # b tanh(Re I / b), in nepers
    phase: Tensor  # ωt + Im I
    gain_rate: Tensor  # slope of `gain`, nepers a sample
    phase_rate: Tensor  # slope of `phase`, rad a sample


class IntegratedPhase(StoredEigenvalues, StringModel[IntegratedPhaseState]):
    """The model of the module: an encoder, latents z that move by closed form and quadrature, and a decoder.

    Frames are samples at the trained rate, frame 0 is the release. Where z is real numbers, the real parts of all
    latents come before the imaginary parts. *Nodes* are the frames `node_spacing` apart from frame 0 on at which g is
    evaluated; *segments* are the stretches that a render interpolates.
    """

    any_frame: ClassVar = True
    initialisations: ClassVar = {
        "random": "",
        "physics": LINEAR_STRING,
        "averaging": f"{LINEAR_STRING}, and how tension couples them",
    }
    eigenvalue_parameters: ClassVar = eigenvalues.STORED
    coupling_parameters: ClassVar = frozenset({"K"})

    def __init__(self, configuration: IntegratedPhaseConfiguration) -> None:
        super().__init__(configuration)
        c, n = configuration, configuration.state_size
        self.encoder = nn.Linear(c.grid_points, 2 * n)
        self.encoder_residual = _mlp(c.grid_points, c.encoder_widths, 2 * n)  # added to the encoder; None: none
        # float64: of frequencies rounded to 1e-7 the phase has within seconds a larger error than all else
        self.nu_log = nn.Parameter(torch.zeros(n, dtype=torch.float64))  # log σ, σ in 1/samples
        self.theta_log = nn.Parameter(torch.zeros(n, dtype=torch.float64))  # log ω, ω in rad a sample
        self.K = nn.Parameter(torch.zeros(2 * n, n))  # (f of each latent, by each latent's energy), in these units:
        self.energy_units: Tensor  # 1/(normalised displacement)²
        self.rate_units: Tensor  # 1/samples
        for name, unit in (("energy_units", 1.0), ("rate_units", RATE_UNIT)):
            self.register_buffer(name, torch.full((n,), unit, dtype=torch.float64))
        self.g = _mlp(n, c.eigenvalue_widths, 2 * n, last_bias=False)  # g(0) is subtracted: it would cancel
        self.decoder = nn.Linear(2 * n, c.grid_points)
        self.M_in = nn.Parameter(torch.zeros(2 * n, 2 * n))  # (log gain then phase, by Re z² then Im z²)
        self.M_out = nn.Parameter(torch.zeros(2 * n, 2 * n))  # likewise, before the decoder
        self.A_in = nn.Parameter(torch.zeros(n, n)) if c.adiabatic else None  # None: no adiabatic change
        self.A_out = nn.Parameter(torch.zeros(n, n)) if c.adiabatic else None

    def encode(self, displacement: Tensor) -> IntegratedPhaseState:
        """The state at frame 0 of displacements (batch, grid_points): y of the encoders, changed by M_in and A_in."""
        z = self.encoder(displacement)
        if self.encoder_residual is not None:
            z = z + self.encoder_residual(displacement)
        real, imag = z.chunk(2, dim=-1)
        return _at_rest(torch.complex(*self._modulate(self.M_in, self.A_in, real, imag, slice(None))))

    def advance(
        self, state: IntegratedPhaseState, steps: int, readout: Tensor | None = None
    ) -> tuple[Tensor, IntegratedPhaseState]:
        """The next `steps` frames (batch, steps, points), rendered in blocks, and the state after them.

        Args:
            readout: (grid_points, points), applied to every frame; None: frames are on the grid.
        """
        rates = self._rates()
        most = max(1, NUMBERS_AT_ONCE // self.configuration.state_size)  # frames of a block
        blocks = []
        for done in range(0, steps, most):
            block, state = self._render(state, rates, min(most, steps - done), readout)
            blocks.append(block)
        return torch.cat(blocks, dim=1), state

    def sample(self, state: IntegratedPhaseState, frames: Tensor, steps: int) -> tuple[Tensor, IntegratedPhaseState]:
        """The frames (batch, frames, grid_points) of these numbers, 1 … steps, counted from the state's time.

        The state that is returned is that after all `steps`.
        """
        rates = self._rates()
        times = (state.time + frames).double()
        end = state.time + steps
        motion, integral = self._move(state, rates, times, end)
        latents = _latents(state.origin, rates, times, motion)
        return self.decode(latents), IntegratedPhaseState(state.origin, end, integral)

    def latents(self, origin: Tensor, frames: Tensor) -> Tensor:
        """z of any frames ≥ 0 (whole or not, any order), complex (batch, frames, state_size)."""
        rates, times = self._rates(), frames.double()
        motion, _ = self._move(_at_rest(origin), rates, times, 0)
        return _latents(origin, rates, times, motion)

    def decode(self, latents: Tensor) -> Tensor:
        """Displacement (..., grid_points) of latents (..., state_size)."""
        return self._displacement(latents.real, latents.imag, None, slice(None))

    def _rates(self) -> _Rates:
        """σ, ω and K of the parameters, with K's units multiplied in."""
        # below 1e-9, σ is as good as none, and 0 would be divided by; above 1e3, all is over within a sample
        sigma = self.nu_log.exp().clamp(1e-9, 1e3)
        coupling = self.K.double().T * self.energy_units[:, None] * self._rate_units
        return _Rates(sigma, self.theta_log.exp(), coupling)

    def _render(
        self, state: IntegratedPhaseState, rates: _Rates, count: int, readout: Tensor | None
    ) -> tuple[Tensor, IntegratedPhaseState]:
        """The next `count` frames and the state after them.

        Level and phase are computed at the ends of short segments, in float64, and are cubics with the right slopes
        in between (Hermite). This leaves errors of the order of h|f| (2σh)³/384 for segments of h samples: a frame
        costs a sine, a cosine and an exponential a latent.

        Args:
            readout: (grid_points, points), folded into the decoder; None: frames are on the grid.

        Returns:
            displacement (batch, count, points or grid_points) in normalised units, and the later state.
        """
        length = min(SEGMENT, self.configuration.node_spacing)  # frames of a segment
        ends, alive, later = self._segments(state, rates, count, length)
        ends = ends[..., alive].to(self.decoder.weight.dtype)  # (4, 2, batch, segments, latents alive)
        # log |z| and phase, (length, batch, segments, latents alive) each: all segments are one matrix product
        log_radius, phase = (hermite(length, ends) @ ends.flatten(1)).view(length, *ends.shape[1:]).unbind(1)
        radius = torch.exp(log_radius)
        frames = self._displacement(radius * torch.cos(phase), radius * torch.sin(phase), readout, alive)
        begin = (state.time + 1) % length  # frames of the first segment before the next frame
        # (length, batch, segments, points) to (batch, segments · length, points), of which `count` frames are kept
        return frames.permute(1, 2, 0, 3).flatten(1, 2)[:, begin : begin + count], later

    def _segments(
        self, state: IntegratedPhaseState, rates: _Rates, count: int, length: int
    ) -> tuple[Tensor, Tensor, IntegratedPhaseState]:
        """Cubics of log |z| and of its phase in the segments of `length` frames that hold the next `count` frames.

        Segments begin at multiples of `length`, so a frame is the same in whichever block it is rendered. A gain that
        would change by more than b in a segment, which no string does, has its slope held there: so within a segment
        no gain exceeds b by more than 8/27 of it.

        Returns:
            ends: values at the left and right end, then slopes there, per segment; float64
                (4, 2, batch, segments, state_size), log |z| in nepers before phases in rad.
            alive: numbers of the latents with log |z| above `SILENCE` at an end, in any string, int64 (latents,).
            state: after those frames.
        """
        first, last = (state.time + 1) // length, (state.time + count) // length  # numbers of segments
        # their ends, in samples since frame 0, (segments + 1,)
        times = torch.arange(first, last + 2, device=state.origin.device).double() * length
        end = state.time + count
        motion, integral = self._move(state, rates, times, end)

        start = state.origin.to(torch.complex128)[:, None]
        angle = torch.where(start == 0, 1, start).angle()  # at zero it has no gradient
        # log |z|, (batch, segments + 1, state_size)
        level = motion.gain - rates.sigma * times[:, None] + start.abs().clamp(min=1e-300).log()
        # a string's high modes are over long before it is, and numbers too small for float32 are slow
        alive = (level.detach() > SILENCE).flatten(0, 1).any(0).nonzero()[:, 0]
        left = torch.stack([level[:, :-1], torch.remainder(motion.phase[:, :-1] + angle, 2 * math.pi)])
        right = left + torch.stack([level.diff(dim=1), motion.phase.diff(dim=1)])
        held = (motion.gain_rate * length).clamp(-GAIN_LIMIT, GAIN_LIMIT)  # nepers a segment
        slopes = torch.stack([held - rates.sigma * length, motion.phase_rate * length])
        ends = torch.stack([left, right, slopes[:, :, :-1], slopes[:, :, 1:]])
        return ends, alive, IntegratedPhaseState(state.origin, end, integral)

    def _move(self, state: IntegratedPhaseState, rates: _Rates, times: Tensor, end: int) -> tuple[_Motion, Tensor]:
        """Gain and phase at `times` (times,) since frame 0, and the `integral` of a state at the time `end`.

        Everything is float64: what adds up over millions of samples keeps its last digits. All times are in samples;
        none of `times` lies before the node at which the integral of `state` ends. The second result has the shape
        (batch, 2 state_size).
        """
        start = state.origin.to(torch.complex128)
        energy = (start.real.square() + start.imag.square())[:, None]  # E(0), (batch, 1, state_size)
        fading = torch.exp(-2 * rates.sigma * times[:, None])  # (times, state_size)
        f = (energy * fading) @ rates.coupling  # as the integral: (batch, times, 2 state_size), Re before Im
        integral = (energy * ((1 - fading) / (2 * rates.sigma))) @ rates.coupling
        integral_at_end = state.integral
        if self.g is not None or self.configuration.adiabatic:
            to_times, slopes, to_end = self._integrate_higher_orders(state, rates, energy, times, end)
            integral = integral + state.integral[:, None] + to_times
            f = f + slopes
            integral_at_end = integral_at_end + to_end
        growth, turn = integral.chunk(2, dim=-1)
        growth_rate, turn_rate = f.chunk(2, dim=-1)
        saturated = torch.tanh((growth / GAIN_LIMIT).to(self.K.dtype)).double()
        motion = _Motion(
            GAIN_LIMIT * saturated,
            rates.omega * times[:, None] + turn,
            growth_rate * (1 - saturated.square()),
            rates.omega + turn_rate,
        )
        return motion, integral_at_end

    def _integrate_higher_orders(
        self, state: IntegratedPhaseState, rates: _Rates, energy: Tensor, times: Tensor, end: int
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Integrate f(E) - K E over time, from the node at which the state's integral ends.

        Args:
            energy: E(0), (batch, 1, state_size).
            times: in samples since frame 0, (times,).
            end: the time of the later state.

        Returns:
            the integrals to each of `times`, and f(E) - K E there, float64 (batch, times, 2 state_size); the integral
            to the node at which that of the later state ends, (batch, 2 state_size).
        """
        spacing = self.configuration.node_spacing
        first, last = _integrated_nodes(state.time, spacing), _integrated_nodes(end, spacing)
        latest = max(times.tolist(), default=0.0)
        segments = max(1, math.ceil(latest / spacing) - first, last - first)
        # the times of nodes and of the middles between them, (2 segments + 1,)
        nodes = torch.arange(2 * segments + 1, device=times.device).double() * (spacing / 2) + first * spacing
        f = self._higher_orders(energy * torch.exp(-2 * rates.sigma * nodes[:, None]), rates)
        positions = torch.cat([times / spacing - first, times.new_tensor([float(last - first)])])
        integrals, slopes = integrate_parabolas(f, positions)
        return integrals[:, :-1] * spacing, slopes[:, :-1], integrals[:, -1] * spacing

    def _higher_orders(self, energies: Tensor, rates: _Rates) -> Tensor:
        """f(E) - K E of energies (..., state_size), float64 (..., 2 state_size)."""
        f = energies.new_zeros(*energies.shape[:-1], 2 * len(rates.omega))
        if self.g is not None:
            reported = energies * self.energy_units
            dtype = self.K.dtype
            network = self.g(reported.to(dtype)) - self.g(reported.new_zeros(reported.shape[-1], dtype=dtype))
            f = network.double() * self._rate_units
            if self.configuration.second_order:
                f = f * reported.sum(-1, keepdim=True)
        if self.configuration.adiabatic:
            n = len(rates.omega)
            turn = stiffening(energies, rates.omega, rates.coupling[:, n:])
            f = f + nn.functional.pad(turn, (n, 0))  # it changes no level
        return f

    @property
    def _rate_units(self) -> Tensor:
        """The units of f, in radians and nepers a sample, float64 (2 state_size,)."""
        return self.rate_units.repeat(2)

    def _displacement(self, real: Tensor, imag: Tensor, readout: Tensor | None, alive: Tensor | slice) -> Tensor:
        """The displacement (..., points or grid_points) that the decoder gives for z.

        Args:
            real, imag: the parts of z, (..., latents), of the latents `alive` alone; the others count as 0.
            readout: (grid_points, points), folded into the decoder; None: displacement is on the grid.
            alive: numbers of latents, or a slice of all.
        """
        real, imag = self._modulate(self.M_out, self.A_out, real, imag, alive)
        weight, bias = read_layer(self.decoder, readout)
        of_real, of_imag = weight.chunk(2, dim=-1)
        displacement = nn.functional.linear(real, of_real[:, alive], bias)
        return displacement + nn.functional.linear(imag, of_imag[:, alive])

    def _modulate(
        self, matrix: Tensor, adiabatic: Tensor | None, real: Tensor, imag: Tensor, alive: Tensor | slice
    ) -> tuple[Tensor, Tensor]:
        """The real and imaginary parts of z ⊙ exp(M z² + change by A), (..., latents) as those given.

        Args:
            matrix: M, (2 state_size, 2 state_size).
            adiabatic: A, (state_size, state_size); None: no change.
            real, imag: the parts of z, of the latents `alive` alone.
            alive: numbers of latents, or a slice of all.
        """
        squares = torch.cat([real.square() - imag.square(), 2 * real * imag], dim=-1)
        n = self.configuration.state_size
        weight = (matrix * self._modulation_units).view(2, n, 2, n)[:, alive][..., alive]
        exponent = nn.functional.linear(squares, weight.flatten(2).flatten(0, 1))
        growth, turn = exponent.chunk(2, dim=-1)
        if adiabatic is not None:
            weight = (adiabatic * self._modulation_units[..., :n])[alive][:, alive]
            growth = growth + adiabatic_change(real.square() + imag.square(), weight)
        gain = torch.exp(GAIN_LIMIT * torch.tanh(growth / GAIN_LIMIT))
        cosine, sine = gain * torch.cos(turn), gain * torch.sin(turn)
        return real * cosine - imag * sine, real * sine + imag * cosine

    @property
    def _modulation_units(self) -> Tensor:
        """The units of M, half of them of A: radians and nepers for squares of normalised displacement.

        Its shape is (2 state_size,).
        """
        return self.energy_units.to(self.K.dtype).repeat(2)

    @torch.no_grad()
    def log_eigenvalues(self) -> list[Tensor]:
        """The log eigenvalues of a quiet string: they change with the energy."""
        return [self.eigenvalue_logs()]

    def set_weights(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """See the contract. Every network's last layer is zero at first, so f and the corrections start from nothing.

        random: eigenvalues uniform in the ring 0.99 ≤ |λ| ≤ 1, orthogonal encoder and decoder, K = 0: no physics.
        physics: the first `modes` latents are the linear string (its eigenvalues, sine transform and inverse); the
            others repeat those frequencies with other decay rates and are not yet heard. K = 0.
        averaging: physics, and K of the tension-modulated string to first order in ΔT/T₀, by averaging over a
            period: f_n = i k_n/4ω_n Σ_m η_m² E_m (1 + ½δ_nm). A solution without learning: a trained model must
            beat it to have learned more. M_out is what the same order adds within a period (`averaged_modulation`),
            and M_in undoes it at rest. A_out and A_in
            are the amplitude's share of the action (`averaged_amplitude`).

        The last two are prior knowledge that the paper's models do not have: say so in a table.
        """
        for network in (self.encoder_residual, self.g):
            if network is not None:
                draw_normal(dense_layers(network), generator)
                nn.init.zeros_(dense_layers(network)[-1].weight)
        draw_orthogonal((self.encoder, self.decoder), generator)
        for matrix in (self.K, self.M_in, self.M_out, self.A_in, self.A_out):
            if matrix is not None:
                nn.init.zeros_(matrix)
        if how == "random":
            self.draw_eigenvalues(generator)
            return
        self._set_linear_string(physics, generator)
        if how == "averaging" and physics.resonator.tension_modulated:
            self._set_averaging(physics)

    @torch.no_grad()
    def store_modes(self, modes: StringModes) -> None:
        """A latent for each mode, at first all that is heard; spare latents stay silent.

        z_n(0) = s_n q_n of a displacement Σ_n q_n shape_n, and û = Σ_n Re z_n shape_n.

        Raises:
            ValueError: more modes than latents.
        """
        n, count = self.configuration.state_size, len(modes.shapes)
        if count > n:
            raise ValueError(f"state_size must be at least {count}, the modes that the data show, not {n}")
        analysis = modes.analysis
        starts = modes.starts
        omega = modes.log_eigenvalues.imag
        self.store_eigenvalues(modes.log_eigenvalues)
        for linear in (self.encoder, self.decoder):
            nn.init.zeros_(linear.weight)
        self.encoder.weight[:count] = (starts.real[:, None] * analysis).to(self.K.dtype)
        self.encoder.weight[n : n + count] = (starts.imag[:, None] * analysis).to(self.K.dtype)
        self.decoder.weight[:, :count] = modes.shapes.T.to(self.K.dtype)
        coupling = modes.coupling / starts.abs().square()
        self.rate_units[:count] = omega
        self.energy_units[:count] = (coupling / omega[:, None]).abs().median(0).values
        coupling = coupling / self.energy_units[:count] / self._rate_units[:count, None]
        self.K[n : n + count, :count] = coupling.to(self.K.dtype)

    def _set_averaging(self, physics: Physics) -> None:
        """Write averaging's closed form into K, M and A, as `set_weights` describes.

        Latent n stands for mode n modulo the number of modes; only the first `modes` latents act on others.
        """
        n, modes = self.configuration.state_size, physics.modes
        mode = torch.arange(n) % modes
        averaged = torch.zeros(2 * n, n, dtype=torch.float64)
        averaged[n:, :modes] = averaged_coupling(physics)[mode]
        self.K.copy_((averaged.T / self._rate_units / self.energy_units[:, None]).T)
        gain, turn = (matrix[mode] for matrix in averaged_modulation(physics))
        modulation = torch.zeros(2 * n, 2 * n, dtype=torch.float64)
        modulation[:n, :modes], modulation[n:, n : n + modes] = gain, turn
        self.M_out.copy_(modulation / self._modulation_units)
        self.M_in[:n, :n] = -self.M_out[:n, :n]
        if self.A_in is not None and self.A_out is not None:
            self.A_in[:, :modes] = averaged_amplitude(physics)[mode] / self._modulation_units[:modes]
            self.A_out.copy_(-self.A_in)

    def _set_linear_string(self, physics: Physics, generator: torch.Generator) -> None:
        """Write the linear string into eigenvalues, units, encoder and decoder, as "physics" of `set_weights`.

        Latent n is encoded as mode n modulo the number of modes; only the first `modes` latents are decoded.
        """
        n, modes = self.configuration.state_size, physics.modes
        log_eigenvalues = linear_string_eigenvalues(n, physics, generator)
        self.store_eigenvalues(log_eigenvalues)
        mode = torch.arange(n) % modes
        unit_m = torch.eye(modes, dtype=torch.float64)[mode] * physics.scale_m
        self.energy_units.copy_(torch.from_numpy(physics.resonator.relative_tension_rise(unit_m.numpy())))
        self.rate_units.copy_(torch.from_numpy(physics.resonator.omega / physics.rate_hz)[mode])
        analysis = physics.analysis[mode]
        imaginary = eigenvalues.slope_at_rest(log_eigenvalues)[:, None] * analysis
        self.encoder.weight.copy_(torch.cat([analysis, imaginary]))
        self.decoder.weight.zero_()
        self.decoder.weight[:, :modes] = physics.shapes.to(self.decoder.weight)


def _integrated_nodes(time: int, spacing: int) -> int:
    """The node at which the integral of a state ends.

    One is kept back for the segment that `time` lies in.
    """
    return max(0, time // spacing - 1)


def _at_rest(origin: Tensor) -> IntegratedPhaseState:
    """The state at frame 0 of z(0), complex (batch, state_size)."""
    batch, n = origin.shape
    return IntegratedPhaseState(origin, 0, origin.real.new_zeros(batch, 2 * n, dtype=torch.float64))


def _latents(origin: Tensor, rates: _Rates, times: Tensor, motion: _Motion) -> Tensor:
    """z at `times` since frame 0, complex (batch, times, state_size)."""
    factor = torch.polar(torch.exp(motion.gain - rates.sigma * times[:, None]), motion.phase)
    return (origin[:, None] * factor).to(origin.dtype)


def _mlp(values: int, widths: tuple[int, ...], outputs: int, last_bias: bool = True) -> nn.Sequential | None:
    """Dense layers with SiLU between, from `values` inputs by the hidden `widths` to `outputs`; None: no widths."""
    if not widths:
        return None
    layers: list[nn.Module] = []
    for wide_in, wide_out in pairwise((values, *widths)):
        layers += [nn.Linear(wide_in, wide_out), nn.SiLU()]
    return nn.Sequential(*layers, nn.Linear(widths[-1], outputs, bias=last_bias))

"""Models by others, made to take any string, and trained on the family: what `koopman_tension` is measured beside.

koopman_var  the paper's model with the string's parameters beside the displacement, which it names as future work
dmsp         differentiable modal synthesis (Lee, Park, Choi, Lee, NeurIPS 2024, arXiv 2407.05516): modes of the
             linear string, whose frequencies and amplitudes a network of time and parameters bends

Both work in the dimensionless form (time in 1/Ω, amplitudes in (ℓ/π)√(4T₀/EA)) on 99 modal amplitudes, of which a
string leaves those above its own at rest: a sine transform away from the grid, as are their linear layers. Both are
given the frequencies and decays of the linear string in closed form, which the paper's model is not, and both begin
as the linear string.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields

import torch
from torch import Tensor, nn

from engine.models._diagonal import dense_layers, perceptron
from engine.models.eigenvalues import pack
from engine.resonators.family import inharmonicity
from engine.resonators.string import decay_rates, undamped_frequencies
from engine.values.string import StringParameters
from training.family.errors import Player
from training.family.strings import MOST_MODES, PluckedString

NODES = 48  # of DMSP's networks in a second, closer at its start; what they yield is linear between
EMBEDDING = 32  # of each of DMSP's inputs
LONGEST_S = 1.0  # DMSP learns time as an input
FRAMES_AT_ONCE = 2_048


@dataclass(frozen=True)
class Strings:
    """A batch of plucked strings in the dimensionless form.

    Attributes:
        start: modal amplitudes, (rows, MOST_MODES).
        present: 1 of modes that the string has, else 0, (rows, MOST_MODES).
        parameters: B, decay of the first mode, growth of decays, share of modes: scaled to about -1 … 1, (rows, 4).
        rise: ΔT/T₀ of the pluck, (rows, 1).
        sigma, omega: of the linear string, float64 (rows, MOST_MODES).
        longest: LONGEST_S in this unit of time, float64 (rows, 1).
    """

    start: Tensor
    present: Tensor
    parameters: Tensor
    rise: Tensor
    sigma: Tensor
    omega: Tensor
    longest: Tensor

    def rows(self, index: Tensor) -> Strings:
        return Strings(*(getattr(self, field.name)[index] for field in fields(self)))


def in_own_units(drawn: Sequence[PluckedString]) -> Strings:
    """Strings and plucks in the dimensionless form."""
    columns = zip(*(_one(plucked) for plucked in drawn), strict=True)
    return Strings(*(torch.stack(column) for column in columns))


def units(string: StringParameters) -> tuple[float, float]:
    """Ω in 1/s, and the unit of amplitude in m."""
    frequency = math.pi / string.length_m * math.sqrt(string.tension_n / string.mass_per_length_kg_m)
    ratio = 4 * string.tension_n / (string.youngs_modulus_pa * string.area_m2)
    return frequency, string.length_m / math.pi * math.sqrt(ratio)


def _one(plucked: PluckedString) -> tuple[Tensor, ...]:
    string, modes = plucked.string, plucked.resonator.modes
    frequency, amplitude_m = units(string)
    number = torch.arange(1, MOST_MODES + 1).double()
    present = (number <= modes).float()
    start = torch.zeros(MOST_MODES)
    start[:modes] = (plucked.amplitudes_m / amplitude_m).float()
    sigma = torch.from_numpy(decay_rates(string, MOST_MODES) / frequency)
    omega = torch.from_numpy(undamped_frequencies(string, MOST_MODES) / frequency)
    growth = float(sigma[1] - sigma[0]) / 3
    scaled = (
        math.log10(inharmonicity(string)) + 4,
        math.log10(float(sigma[0])) + 3,
        math.log10(growth) + 5,
        2 * modes / MOST_MODES - 1,
    )
    return (
        start,
        present,
        torch.tensor(scaled),
        torch.tensor([plucked.tension_rise]),
        sigma,
        (omega.square() - sigma.square()).clamp(min=1).sqrt(),
        torch.tensor([LONGEST_S * frequency]).double(),
    )


class Baseline(nn.Module, ABC):
    """A model of plucked strings at any times."""

    @abstractmethod
    def forward(self, strings: Strings, times: Tensor) -> Tensor:
        """Modal amplitudes (rows, times, MOST_MODES) at times (rows, times), float64, in the dimensionless form."""


class ConditionedKoopmanVar(Baseline):
    """z(t) = e^{λt} z₀ with z₀ = encoder(u₀, parameters), û = decoder(m(|z|², parameters) ⊙ z).

    The paper's sizes. What would be a constant of one string, its eigenvalues, is the linear string's, bent by a
    network of the parameters; latents beyond one for each mode begin as modes that fall three times as fast.
    """

    def __init__(self, state_size: int = 128, width: int = 128) -> None:
        super().__init__()
        self.mode = torch.arange(state_size) % MOST_MODES
        self.spare = torch.arange(state_size) >= MOST_MODES
        self.encoder = nn.Linear(MOST_MODES + 4, 2 * state_size)
        self.rates = perceptron(4, 64, 64, 2 * state_size)
        self.multiplier = perceptron(state_size + 4, width, width, width, 2 * state_size)
        self.decoder = nn.Linear(2 * state_size, MOST_MODES)
        with torch.no_grad():
            one, last = torch.eye(MOST_MODES), dense_layers(self.multiplier)[-1]
            for layer in (self.encoder, last, dense_layers(self.rates)[-1]):
                nn.init.zeros_(layer.weight)
                nn.init.zeros_(layer.bias)
            self.encoder.weight[:state_size, :MOST_MODES] = one[self.mode]
            self.decoder.weight[:, MOST_MODES:].mul_(0.01)
            self.decoder.weight[:, :MOST_MODES] = one
            self.decoder.bias.zero_()
            last.bias[:state_size] = 1

    def forward(self, strings: Strings, times: Tensor) -> Tensor:
        parameters = strings.parameters
        origin = pack(self.encoder(torch.cat([strings.start, parameters], dim=-1)))
        slower, higher = self.rates(parameters).double().chunk(2, dim=-1)
        sigma = strings.sigma[:, self.mode] * torch.where(self.spare, 3.0, 1.0) * slower.clamp(-5, 5).exp()
        omega = strings.omega[:, self.mode] * higher.clamp(-1, 1).exp()
        angle = torch.remainder(times[..., None] * omega[:, None], 2 * math.pi).float()
        z = origin[:, None] * torch.polar((-times[..., None] * sigma[:, None]).exp().float(), angle)
        beside = parameters[:, None].expand(-1, z.shape[1], -1)
        squares = z.real.square() + z.imag.square()
        seen = z * pack(self.multiplier(torch.cat([squares, beside], dim=-1)))
        out: Tensor = self.decoder(torch.cat([seen.real, seen.imag], dim=-1))
        return out * strings.present[:, None]


class ModalSynthesis(Baseline):
    """û_n(t) = u_n(0) (1 + a_n(t)) e^{-σ_n t} cos ∫ ω_n (1 + g f_n), a and f networks, g the gate tanh(gain · rise).

    The blocks are DMSP's: random Fourier features of each input with learned scale, a network of five layers with
    PReLU, a gated linear unit. It differs where this task does: whole strings instead of one point, so that the place
    is no input; every mode's own decay; no noise; and modes are given their shares of the tension, in more numbers
    than the mean that theirs is.
    """

    def __init__(self, width: int = 224) -> None:
        super().__init__()
        self.wave_numbers: Tensor
        inputs = 7  # time twice, four parameters, the rise
        self.register_buffer("wave_numbers", torch.randn(inputs, EMBEDDING // 2))
        self.scales = nn.Parameter(torch.zeros(inputs, 1))
        self.gain = nn.Parameter(torch.ones(()))
        self.frequency_block = _Block(inputs * EMBEDDING, width)
        self.amplitude_block = _Block(inputs * EMBEDDING, width)

    def forward(self, strings: Strings, times: Tensor) -> Tensor:
        share = torch.linspace(0, 1, NODES + 1, dtype=torch.float64).square()
        nodes = strings.longest * share
        higher, louder = self._bent(strings, nodes)
        rate = strings.omega[:, None] * higher
        step = nodes.diff()[..., None]
        turned = (0.5 * step * (rate[:, 1:] + rate[:, :-1])).cumsum(1)
        turned = torch.cat([torch.zeros_like(turned[:, :1]), turned], dim=1)
        left = (NODES * (times / strings.longest).sqrt()).long().clamp(0, NODES - 1)
        since = (times - nodes.gather(1, left))[..., None]

        def at(values: Tensor, index: Tensor) -> Tensor:
            return values.gather(1, index[..., None].expand(-1, -1, values.shape[-1]))

        part = since / at(step, left)
        here, there = at(rate, left), at(rate, left + 1)
        phase = (
            times[..., None] * strings.omega[:, None]
            + at(turned, left)
            + since * (here + 0.5 * part * (there - here))
        )
        gain = torch.lerp(at(louder, left), at(louder, left + 1), part)
        fallen = (-times[..., None] * strings.sigma[:, None]).exp() * gain
        swing = torch.remainder(phase, 2 * math.pi).float().cos() * fallen.float()
        return swing * (strings.start * strings.present)[:, None]

    def _bent(self, strings: Strings, nodes: Tensor) -> tuple[Tensor, Tensor]:
        """Relative rises of frequencies, and factors of amplitudes, at nodes, float64."""
        of_string = torch.cat([strings.parameters, strings.rise], dim=-1)[:, None].expand(-1, nodes.shape[1], -1)
        of_time = torch.stack([torch.log10(1 + nodes) - 2, (-2 * strings.sigma[:, :1] * nodes).exp()], dim=-1)
        inputs = torch.cat([of_time.float(), of_string], dim=-1)
        angle = inputs[..., None] * self.wave_numbers * 10**self.scales
        features = torch.cat([angle.sin(), angle.cos()], dim=-1).flatten(-2)
        number = torch.arange(1, MOST_MODES + 1)
        shares = (number * strings.start).square() / strings.rise
        gate = torch.tanh(self.gain * strings.rise)[..., None]
        higher = gate * self.frequency_block(features, shares)
        return higher.double(), (1 + self.amplitude_block(features, shares)).double()


class _Block(nn.Module):
    def __init__(self, features: int, width: int) -> None:
        super().__init__()
        self.modes = nn.Linear(MOST_MODES, EMBEDDING)
        layers: list[nn.Module] = []
        for wide_in in (features + EMBEDDING, *[width] * 4):
            layers += [nn.Linear(wide_in, width), nn.PReLU()]
        self.layers = nn.Sequential(*layers)
        self.out = nn.Linear(width + EMBEDDING, 2 * MOST_MODES)
        with torch.no_grad():
            self.out.weight.mul_(0.01)
            self.out.bias.zero_()

    def forward(self, features: Tensor, shares: Tensor) -> Tensor:
        modes = self.modes(shares)[:, None].expand(-1, features.shape[1], -1)
        hidden = self.layers(torch.cat([features, modes], dim=-1))
        out: Tensor = nn.functional.glu(self.out(torch.cat([hidden, modes], dim=-1)), dim=-1)
        return out


BASELINES: dict[str, type[Baseline]] = {"koopman_var": ConditionedKoopmanVar, "dmsp": ModalSynthesis}


def baseline_player(model: Baseline) -> Player:
    """As `errors.player`, of a trained baseline."""

    def play(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
        frequency, amplitude_m = units(plucked.string)
        strings = in_own_units([plucked])
        times = torch.arange(1, steps + 1, dtype=torch.float64)[None] * (frequency / rate_hz)
        blocks = [model(strings, part)[0] for part in times.split(FRAMES_AT_ONCE, dim=1)]
        return torch.cat(blocks)[:, : plucked.resonator.modes].double() * amplitude_m

    return play

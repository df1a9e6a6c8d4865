"""Train Fourier cells of `fno` from the weights that make them a string of known modes: python -m … RUN [OPTIONS].

RUN and options are those of `train`. So the presets of FGRU and FRNN by our recipe were made.

A Fourier convolution of a zero-padded field is any map that looks the same from every point: a kernel of lags for
each pair of channels. A string is not the same at every point. Its state is kept as numbers at single points
of channels of their own, whose lags are theirs alone. From an end of the grid a mode's amplitude reaches every point
by another lag, and spreads its shape there. A channel holds two such modes, one at each end.

FRNN. ReLU is the identity where a bias lifts all that may come, and 0 where a bias holds it down. That leaves
numbers only where they belong. The three layers are analysis of the field at the ends, one step of every mode, and
synthesis. So the field is a part of the state, and a linear string is kept exactly.

FGRU. tanh is the identity for numbers that are small, and the gates' biases are factors of single points: the cosine
and the sine of mode n's phase per sample are r's at the point n. Their channels hold copies of all modes' states.
z's say where anything is written. How far a mode turns follows the squares of all: a product r ⊙ h of two
copies is a square; their sum, at one point, reaches each mode's r by the lag between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from torch import Tensor

from engine.models.base import StringModes
from engine.models.fno import FGRU, FRNN, FourierConvolution
from training.fitting import phases
from training.fitting.modes import SLOWEST, Modes

ENDS = 2  # modes a channel that is read from the ends


def _store(
    model: FGRU | FRNN,
    layers: Sequence[FourierConvolution],
    kernels: Sequence[Kernels],
    weight_in: Tensor,
    bias_in: Tensor,
    weight_out: Tensor,
    bias_out: float,
) -> None:
    """Set a cell's convolutions, and its maps in and out: (width,), of the first input and of the displacement."""
    for layer, of_layer in zip(layers, kernels, strict=True):
        of_layer.store(layer.weight, layer.bias)
    with torch.no_grad():
        model.in_mapping.weight.zero_()
        model.in_mapping.weight[:, 0] = weight_in
        model.in_mapping.bias.copy_(bias_in)
        model.out_mapping.weight[0] = weight_out
        model.out_mapping.bias.fill_(bias_out)


class Kernels:
    """Kernels and biases of a Fourier convolution, to be set one by one.

    Attributes:
        lags: (2·grid_points, channels in, channels out), a negative lag counted from the end.
        bias: (grid_points, channels).
    """

    def __init__(self, grid_points: int, width: int) -> None:
        self.points = grid_points
        self.lags = torch.zeros(2 * grid_points, width, width, dtype=torch.float64)
        self.bias = torch.zeros(grid_points, width, dtype=torch.float64)

    def add_shifted(self, source: int, target: int, factor: float, lag: int = 0) -> None:
        """Add a channel's number at each point, times a factor, to another channel's `lag` points further."""
        self.lags[lag, source, target] += factor

    def spread(self, source: int, at: int, target: int, shape: Tensor) -> None:
        """Add the number at a point of a channel, times a shape (grid_points,), to another channel."""
        self.lags[torch.arange(self.points) - at, source, target] += shape

    def gather(self, source: int, target: int, at: int, weights: Tensor) -> None:
        """Add the sum of a channel, times weights (grid_points,), to one point of another."""
        self.lags[at - torch.arange(self.points), source, target] += weights

    @torch.no_grad()
    def store(self, weight: Tensor, bias: Tensor) -> None:
        """Store the kernels as the parameters of a `FourierConvolution`."""
        product = self._transformed(self.lags)
        weight.copy_(torch.stack([product.real, product.imag], dim=2))
        constant = self._transformed(torch.cat([self.bias, torch.zeros_like(self.bias)]))
        bias.copy_(torch.stack([constant.real, constant.imag], dim=1))

    def _transformed(self, values: Tensor) -> Tensor:
        """The spectrum (points, …) of values (2·points, …), without the highest frequency.

        The value at the middle, which no field sees, is set so that the highest frequency has nothing.
        """
        signs = torch.ones(2 * self.points, dtype=torch.float64)
        signs[1::2] = -1
        values = values.clone()
        values[self.points] = 0
        values[self.points] = -signs[self.points] * torch.tensordot(signs, values, dims=1)
        return torch.fft.rfft(values, dim=0)[: self.points]


def ends(modes: int, points: int, first: int) -> list[tuple[int, int]]:
    """The channel, from `first` on, and the end of the grid for each mode."""
    return [(first + mode // ENDS, (points - 1) * (mode % ENDS)) for mode in range(modes)]


def end_channels(modes: int) -> int:
    """Channels that hold a number of each mode."""
    return -(-modes // ENDS)


LIFT = 30.0  # standard deviations of displacement: a bias above all that may come, so that ReLU is the identity
HELD_DOWN = -300.0  # a bias below all that may come, so that ReLU is 0


def store_in_frnn(model: FRNN, modes: StringModes) -> None:
    """Set its weights to those of a linear string: its frequencies follow nothing, its pointwise maps are 0.

    The state of a mode are its amplitude, which the field holds, and a number that is 0 at rest. Pairs of modes that
    share a channel are kept as sum and difference, so that one kernel turns both.

    Raises:
        ValueError: there are too few channels or layers.
    """
    width, depth = model.configuration.width, model.configuration.depth
    count, points = modes.shapes.shape
    pairs = end_channels(count)
    if 1 + 2 * pairs > width or depth != 3:
        raise ValueError(f"{count} modes need a width of {1 + 2 * pairs} and a depth of 3, not {width} and {depth}")
    # first channels: the field, the amplitudes by pair, the numbers that are 0 at rest by pair
    field = 0
    now = 1
    rate = 1 + pairs
    last = points - 1  # the other end of the grid
    analyse, turn, synthesise = layers = tuple(Kernels(points, width) for _ in range(3))
    for layer in layers:
        layer.bias[:, 1 : 1 + 2 * pairs] = HELD_DOWN
    total = math.sqrt(0.5)
    odd = ENDS * pairs - count  # the last pair has one mode, and one that rests
    shapes_of, readings, flow = (
        torch.cat([of, of.new_zeros(odd, *of.shape[1:])]).unflatten(0, (pairs, ENDS))
        for of in (modes.shapes, modes.analysis, _turns(modes))
    )
    for pair in range(pairs):
        shapes, analysis, steps = shapes_of[pair], readings[pair], flow[pair]
        for end, sign in ((0, 1.0), (last, -1.0)):
            analyse.gather(field, now + pair, end, total * (analysis[0] + sign * analysis[1]))
            analyse.bias[end, now + pair] = LIFT - LIFT * float(total * (analysis[0] + sign * analysis[1]).sum())
            synthesise.spread(now + pair, end, field, total * (shapes[0] + sign * shapes[1]))
        same, crossed = (steps[0] + steps[1]) / 2, (steps[0] - steps[1]) / 2
        for target, row in ((now + pair, 0), (rate + pair, 1)):
            for source, column in ((now + pair, 0), (rate + pair, 1)):
                turn.add_shifted(source, target, float(same[row, column]))
                for lag in (-last, last):
                    turn.add_shifted(source, target, float(crossed[row, column]), lag)
            turn.bias[[0, last], target] = LIFT * (1 - float((same + crossed)[row].sum()))
        for layer in (analyse, synthesise):
            layer.add_shifted(rate + pair, rate + pair, 1.0)
            layer.bias[[0, last], rate + pair] = 0.0
        synthesise.bias[:, field] -= LIFT * total * 2 * shapes[0]
    for layer in (analyse, turn):
        layer.bias[:, field] = -1.0
    synthesise.bias[:, field] += LIFT
    through = torch.zeros(width, dtype=torch.float64)
    through[field] = 1.0
    lifted = LIFT * through
    lifted[rate : rate + pairs] = LIFT
    convolutions = [module for module in model.modules() if isinstance(module, FourierConvolution)]
    _store(model, convolutions, layers, through, lifted, through, -LIFT)
    with torch.no_grad():
        for parameter in model.pointwise_layers.parameters():
            parameter.zero_()


def _turns(modes: StringModes) -> Tensor:
    """The matrices (modes, 2, 2) that turn each mode's state by a sample.

    A state is (amplitude, a number that is 0 at rest).
    """
    eigenvalues = torch.exp(modes.log_eigenvalues)
    tilt = modes.starts.imag / modes.starts.real
    # c = amplitude + i (tilt · amplitude + other)
    a, b = eigenvalues.real, eigenvalues.imag
    rows = [
        torch.stack([a - b * tilt, -b], dim=-1),
        torch.stack([b + a * tilt - tilt * (a - b * tilt), a + tilt * b], dim=-1),
    ]
    return torch.stack(rows, dim=-2)


SMALL = 2e-3  # of a standard deviation of displacement: what tanh does not bend in 400 steps
FIELD_SIZE = 5e-3  # what it does not bend in one
OPEN, SHUT = 15.0, -15.0  # gates' biases
MARGIN = 0.46  # of a gate around one half. With it the sigmoid bends nearly as cosine and sine do over small angles
SQUARE_SIZE = 0.01  # what the roots of all squares come to, typically
SQUARE_SLOPE = 20.0  # of the gates in which squares arise
SUM_SIZE = 40.0  # factor in front of a square
OWN_SIZE = 0.02  # what a mode's own square comes to, typically
LARGEST_DRIFT = 7.0  # times the typical one: so much farther the loudest strings turn
RAREST = 0.01  # of the weight of a drift of 0: any drift counts so much, lest a loud string grow without end
LEAST_DRIFT = 1e-6  # rad a sample
WINDOW = 0.4  # how much the fields that a string is released in differ from one another
ALTERNATIONS = 30  # rounds of least squares for a, b and e
RIDGE = 1e-4  # on b, as a share of the diagonal
MOST_OWN = 1.0  # of e
TINY = 1e-30  # in place of 0 where something is divided


def store_in_fgru(model: FGRU, modes: StringModes) -> None:
    """Set its weights to those of a string of these modes, whose frequencies follow the squares.

    The initial field lasts for one step, in which the states of all modes are read from it. Those are then turned
    sample by sample, one frame ahead, and spread to the field that is read. Couplings are kept as far as they are
    κ_nm = a_n b_m (1 + e δ_nm).

    Raises:
        ValueError: there are too few channels or points.
    """
    width = model.configuration.width
    count, points = modes.shapes.shape
    channels = _Channels.of(count)
    if channels.start >= width or 3 * count >= points:
        raise ValueError(f"{count} modes need a width of {channels.start + 1} and {3 * count + 1} points")
    z, r, h = (Kernels(points, width) for _ in range(3))
    at_end = ends(count, points, channels.ends)

    z.bias[:] = SHUT
    z.bias[:, channels.field] = OPEN
    z.bias[:, channels.start :] = OPEN
    for channel, end in at_end:
        z.bias[end, channel] = OPEN
    z.bias[:count, list(channels.states)] = OPEN
    z.bias[: 3 * count, [channels.root, channels.plus, channels.minus]] = OPEN
    z.bias[: 2 * count, channels.own] = OPEN
    z.bias[points - 1, channels.sum] = OPEN
    r.bias[z.bias == SHUT] = SHUT  # nor is anything read from there

    real, imaginary = channels.states[:3], channels.states[3:]
    for target in real:
        _turn(h, real, imaginary, -1, target)
    for target in imaginary:
        _turn(h, imaginary, real, 1, target)
    for mode, (channel, end) in enumerate(at_end):
        _turn(h, real, imaginary, -1, channel, end - mode)
        h.spread(channel, end, channels.field, 2 * FIELD_SIZE / SMALL * modes.shapes[mode])
    _follow_squares(h, r, modes, channels, at_end)
    _release(h, r, modes, channels, at_end)

    weight_in, weight_out = torch.zeros(2, width, dtype=torch.float64)
    weight_in[channels.start :] = 1.0  # for a step that has no tanh before it
    weight_out[channels.field] = 1 / FIELD_SIZE
    layers = model.z_layer, model.r_layer, model.h_layer
    _store(model, layers, (z, r, h), weight_in, torch.zeros_like(weight_in), weight_out, 0.0)


@dataclass(frozen=True)
class _Channels:
    """The channels of an FGRU by their contents; `start` and all after it, the initial field.

    `states` are copies of all modes' complex amplitudes, mode n's at point n: three of the real parts, which r shows
    by the cosine, the sine, and by one half, and three of the imaginary ones. From two copies of their amplitudes
    (`root`; `plus` and `minus`) squares arise: for the cosines, for the sines, and for the sum over all modes.
    """

    field: int
    ends: int
    states: tuple[int, ...]
    root: int
    plus: int
    minus: int
    own: int
    sum: int
    start: int

    @classmethod
    def of(cls, modes: int) -> _Channels:
        first = 1 + end_channels(modes)
        return cls(0, 1, tuple(range(first, first + 6)), *range(first + 6, first + 12))


def _turn(
    h: Kernels, from_modes: tuple[int, ...], other: tuple[int, ...], sign: int, target: int, lag: int = 0
) -> None:
    """cos · own ± sin · other, where r shows (cosine, sine, one half) of either."""
    (own_cosine, _, own_half), (_, other_sine, other_half) = from_modes, other
    for source, factor in ((own_cosine, 1), (own_half, -1), (other_sine, sign), (other_half, -sign)):
        h.add_shifted(source, target, factor / MARGIN, lag)


def _follow_squares(
    h: Kernels, r: Kernels, modes: StringModes, channels: _Channels, at_end: list[tuple[int, int]]
) -> None:
    """Turn each mode in a sample by 2 Σ κ_nm q_m², whose mean over a period is Σ κ_nm |c_m|²."""
    count, points = modes.shapes.shape
    squares = modes.squares.mean(0)
    everyone, others, excess = shared_coupling(modes.coupling, modes.squares)
    bias, slope = _gates(modes)
    gates = (channels.states[0], channels.states[3]), (channels.states[1], channels.states[4])
    typical = float((others @ squares).clamp(min=TINY))
    roots = 2 * (others / typical).sqrt() * SQUARE_SIZE / SMALL
    unit = SUM_SIZE * SQUARE_SLOPE / 4  # a channel's product with itself comes to this times its square
    last = points - 1
    for number, pair in enumerate(gates):
        block = number * count
        alone = 2 * slope[number] * excess * everyone * others
        reach = max(TINY, float((alone * squares).abs().max()) / OWN_SIZE)
        content = 2 * alone / (reach * 2 * unit * roots.clamp(min=TINY) / 2 * SMALL**2)
        for target in pair:
            r.bias[:count, target] = bias[number]
            share = 2 * slope[number] * everyone * typical / (2 * unit * SQUARE_SIZE**2)
            r.lags[torch.arange(count) - last, channels.sum, target] += share
            r.add_shifted(channels.own, target, reach, -block)
        for mode, (channel, end) in enumerate(at_end):
            h.add_shifted(channel, channels.root, float(roots[mode]), block + mode - end)
            for target in (channels.plus, channels.minus):
                h.add_shifted(channel, target, float(content[mode]), block + mode - end)
    for mode, (channel, end) in enumerate(at_end):
        for target in (channels.root, channels.plus, channels.minus):
            h.add_shifted(channel, target, float(roots[mode]), 2 * count + mode - end)
        h.add_shifted(channels.plus, channels.sum, SUM_SIZE, last - 2 * count - mode)
        h.add_shifted(channels.minus, channels.sum, -SUM_SIZE, last - 2 * count - mode)
    h.add_shifted(channels.plus, channels.own, SUM_SIZE)
    h.add_shifted(channels.minus, channels.own, -SUM_SIZE)
    r.add_shifted(channels.root, channels.plus, SQUARE_SLOPE)
    r.add_shifted(channels.root, channels.minus, -SQUARE_SLOPE)


def shared_coupling(coupling: Tensor, squares: Tensor) -> tuple[Tensor, Tensor, float]:
    """κ_nm ≈ a_n b_m (1 + e δ_nm), with b ≥ 0 and e of 0 … MOST_OWN: (a, b, e).

    Fitted to how far the strings of these squares (strings, modes) turn, for κ may be any where no string is: by
    alternating least squares, in which a mode counts by its mean square.
    """
    from scipy.optimize import nnls  # slow to load

    angles = squares @ coupling.T
    loud = squares.mean(0).sqrt()
    own_share = 0.5
    a = angles.mean(0)
    b = torch.zeros_like(a)
    eye = torch.eye(len(a), dtype=torch.float64)
    for _ in range(ALTERNATIONS):
        weights = a * loud
        effects = squares[:, None] * (1 + own_share * eye)  # (strings, of, by)
        system = torch.einsum("rni,rnj,n->ij", effects, effects, weights**2)
        right = torch.einsum("rni,rn,n->i", effects, angles, weights * loud)
        scale = torch.diagonal(system).sqrt().clamp(min=TINY)
        root = torch.linalg.cholesky(system / scale / scale[:, None] + RIDGE * eye).T
        target = torch.linalg.solve_triangular(root.T, (right / scale)[:, None], upper=False)[:, 0]
        b = torch.from_numpy(nnls(root.numpy(), target.numpy())[0]) / scale
        together, alone = (squares @ b)[:, None], squares * b
        excess = alone * weights
        own_share = float((excess * (angles * loud - together * weights)).sum() / (excess**2).sum().clamp(min=TINY))
        own_share = min(max(own_share, 0.0), MOST_OWN)
        shared = together + own_share * alone
        a = (shared * angles).sum(0) / (shared**2).sum(0).clamp(min=TINY)
        size = float(b.max().clamp(min=TINY))
        a, b = a * size, b / size
    return a, b, own_share


def _gates(modes: StringModes) -> tuple[Tensor, Tensor]:
    """The inputs of r for cosine and sine, (2, modes) each: biases, and slopes per radian of a further turn."""
    decay, angle = torch.exp(modes.log_eigenvalues.real), modes.log_eigenvalues.imag
    shares = torch.linspace(0, LARGEST_DRIFT, 51, dtype=torch.float64)[:, None]
    likely = torch.exp(-shares) + RAREST  # larger drifts are rarer
    likely = likely / likely.sum()
    drift = torch.where(modes.drift.abs() < LEAST_DRIFT, LEAST_DRIFT, modes.drift)
    angles = angle + shares * drift
    wanted = torch.logit(0.5 + MARGIN * decay * torch.stack([torch.cos(angles), torch.sin(angles)]))
    apart = shares - (likely * shares).sum()
    slope = (likely * apart * wanted).sum(1) / (likely * apart**2).sum()
    bias = (likely * wanted).sum(1) - slope * (likely * shares).sum()
    return bias, slope / drift


def _release(h: Kernels, r: Kernels, modes: StringModes, channels: _Channels, at_end: list[tuple[int, int]]) -> None:
    """Start the states from the initial fields, in the one step that these last; r shows them through windows."""
    count, points = modes.shapes.shape
    start = slice(channels.start, None)
    generator = torch.Generator().manual_seed(0)  # any windows do that have nothing in common
    shares = torch.rand(r.bias[:, start].shape, generator=generator, dtype=torch.float64)
    r.bias[:, start] = torch.logit(0.5 + WINDOW * (2 * shares - 1))
    solve = partial(_least_kernels, torch.sigmoid(r.bias[:, start]), modes.shapes)
    turn = modes.log_eigenvalues + 1j * modes.drift
    # two frames on, and the drift of two more steps, in which the squares are not known yet
    ahead = SMALL * torch.diag(modes.starts * torch.exp(2 * turn + 2j * modes.drift))
    for wanted, targets in ((ahead.real, channels.states[:3]), (ahead.imag, channels.states[3:])):
        lag_values = solve(torch.arange(count), wanted)
        for target in targets:
            h.lags[:, start, target] += lag_values
    for mode, (channel, end) in enumerate(at_end):
        h.lags[:, start, channel] += solve(torch.tensor([end]), ahead.real[mode : mode + 1])
    first = FIELD_SIZE * (modes.starts * torch.exp(turn)).real
    h.lags[:, start, channels.field] += solve(torch.arange(points), modes.shapes.T * first)


def _least_kernels(windows: Tensor, shapes: Tensor, places: Tensor, wanted: Tensor) -> Tensor:
    """The smallest kernels (2·points, channels) from windows (points, channels) of a field to places of another.

    Of each shape they make what is wanted: (places, modes).
    """
    points, channels = windows.shape
    lags = torch.arange(1 - points, points)
    source = places[:, None] - lags  # (places, lags)
    inside = ((source >= 0) & (source < points)).double()
    source = source.clamp(0, points - 1)
    seen = shapes[:, source] * inside  # (modes, places, lags)
    rows = seen[..., None] * windows[source]  # (modes, places, lags, channels)
    rows = rows.transpose(0, 1).reshape(len(places) * len(shapes), -1)
    solution = torch.linalg.lstsq(rows, wanted.reshape(-1, 1), rcond=1e-4, driver="gelsd").solution
    kernels = torch.zeros(2 * points, channels, dtype=torch.float64)
    kernels[lags] = solution.view(len(lags), channels)
    return kernels


def mean_motions(modes: Modes) -> StringModes:
    """Fit to each mode the one exponential nearest to all its motions, each by its own start; no coupling."""
    motions = modes.motions.numpy()
    frames, count = motions.shape[1:]
    mean = np.einsum("rtn,rn->tn", motions, motions[:, 0]) / np.sum(motions[:, 0] ** 2, axis=0)
    guesses = [phases.first_guess(motions[..., mode], 0) for mode in range(count)]
    for last in phases.horizons(frames):
        times = np.arange(1.0, last + 1)
        for mode, guess in enumerate(guesses):
            seen = mean[1 : last + 1, mode]
            guesses[mode] = phases.ModeMotion(np.ones(last), seen, times, np.empty((last, 0))).fitted(guess)
    return phases.string_modes([phases.upright(guess) for guess in guesses], SLOWEST / (frames - 1), modes)


def _start_fgru(model: FGRU, modes: Modes, seed: int) -> None:
    store_in_fgru(model, phases.fit_phases(modes, seed))


def _start_frnn(model: FRNN, modes: Modes, seed: int) -> None:
    store_in_frnn(model, mean_motions(modes))


def use() -> None:
    """Give FGRU and FRNN these starts in this process, for `training.fitting.phases`."""
    phases.STORES.update(fgru=_start_fgru, frnn=_start_frnn)


if __name__ == "__main__":
    from training.cli.__main__ import main
    from training.cli.training import train

    use()
    main(train)

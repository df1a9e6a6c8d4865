"""The base of the state-space strings (LRU, S5): the recurrence, the block, the stack and its streaming state.

Source: the paper, §3.2. A first linear layer takes the initial displacement u₀ as an impulse,
x_{k+1} = Ā x_k + B̄ u_k δ_k, y_k = C̄ x_k; y is one sample late. Blocks follow: batch norm, a diagonal
state-space layer, GELU, a gate (two dense layers, GLU), a skip connection. Between the non-linearities, which are
pointwise in time, every layer is linear and time-invariant, so a whole stretch of time goes through layer by layer.

Inside, tensors are time-major: (steps, batch, features).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from engine.models._dense import Dense, linear
from engine.models.base import LINEAR_STRING, Physics, StringModel
from engine.models.configurations import LRUConfiguration, S5Configuration
from engine.models.eigenvalues import powers, slope_at_rest

CHUNK = 32  # steps between two exact carries; fewer cost more carries, more collect more rounding
ROWS_AT_ONCE = 1024  # batch × steps that go through the layers together and still fit the cache


def first_powers(log_eigenvalues: Tensor, count: int) -> Tensor:
    """λ¹ … λ^count, complex128 (count, n), by doubling: a few roundings in float64 instead of a sine each."""
    table = powers(log_eigenvalues, torch.ones(1, device=log_eigenvalues.device))
    while len(table) < count:
        table = torch.cat([table, table * table[-1]])
    return table[:count]


def evolve(log_eigenvalues: Tensor, state: Tensor, steps: int, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """x_k = λᵏ x₀ for k = 1 … steps, without recursion.

    Args:
        state: x₀, complex128 (batch, n).
        dtype: complex type of the result.

    Returns:
        The states (steps, batch, n), and the last one as complex128.
    """
    exponents = torch.arange(0, steps, CHUNK, device=state.device)
    coarse = powers(log_eigenvalues, exponents)[:, None] * state
    fine = first_powers(log_eigenvalues, min(CHUNK, steps))
    states = coarse.to(dtype)[:, None] * fine.to(dtype)[:, None]
    last = coarse[-1] * fine[(steps - 1) % CHUNK]
    return states.flatten(0, 1)[:steps], last


def recur(inputs: Tensor, log_eigenvalues: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
    """x_k = λ x_{k-1} + v_k, with a gradient that is one more recurrence, backwards in time.

    Rendering on a CPU takes `FoldedBlock` instead.

    Args:
        inputs: v, complex (steps, batch, n).
        state: x before the first step, complex128 (batch, n).

    Returns:
        All states, like `inputs`, and the last one, complex128.
    """
    power = first_powers(log_eigenvalues.detach(), min(CHUNK, len(inputs)))
    states: tuple[Tensor, Tensor] = _Recurrence.apply(inputs, log_eigenvalues, state, power)
    return states


class _Recurrence(torch.autograd.Function):
    """`recur`; the gradients u of the inputs are u_k = λ* u_{k+1} + g_k of those of the states, g.

    Arguments are v (steps, batch, n), log λ (n,), x before the first step (batch, n) and λ¹, λ² … (length, n).
    """

    @staticmethod
    def vmap(
        info: Any, in_dims: tuple[int | None, ...], *arguments: Tensor
    ) -> tuple[tuple[Tensor, ...], tuple[int, ...]]:
        """Compute the recurrences of several seeds, trained together, with states side by side on the last axis."""
        seeds = info.batch_size

        def joined(tensor: Tensor, seed_dim: int | None) -> Tensor:
            of_seeds = tensor.expand(seeds, *tensor.shape) if seed_dim is None else tensor.movedim(seed_dim, 0)
            return of_seeds.movedim(0, -2).flatten(-2)

        states, last = _Recurrence.apply(*map(joined, arguments, in_dims))
        return (states.unflatten(-1, (seeds, -1)), last.unflatten(-1, (seeds, -1))), (2, 1)

    @staticmethod
    def forward(inputs: Tensor, log_eigenvalues: Tensor, state: Tensor, power: Tensor) -> tuple[Tensor, Tensor]:
        return _scan(inputs, power, state)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Tensor, ...], output: tuple[Tensor, Tensor]) -> None:
        _, _, state, power = inputs
        ctx.save_for_backward(state, power, output[0])

    @staticmethod
    def backward(ctx: Any, *of_outputs: Tensor) -> tuple[Tensor, Tensor, Tensor, None]:
        """The gradients of v, log λ and the first x, from those of all states and of the last one."""
        state, power, states = ctx.saved_tensors
        of_states, of_last = of_outputs
        power = power.conj().resolve_conj()
        of_states = torch.cat([of_states[:-1], of_states[-1:] + of_last.to(of_states.dtype)])
        of_inputs, first = _scan(of_states, power, torch.zeros_like(state), backwards=True)
        products = (states[:-1].conj() * of_inputs[1:]).sum((0, 1)) + (state.conj() * first).sum(0)
        return of_inputs, power[0] * products, power[0] * first, None


def _scan(inputs: Tensor, power: Tensor, state: Tensor, backwards: bool = False) -> tuple[Tensor, Tensor]:
    """`recur` in two levels, or the same from the last step to the first: inside all chunks at once, then between.

    The carry is complex128 and its powers of λ are exact. So the rounding of `inputs` is bounded by what one chunk
    collects, however long the layer remembers and wherever a caller splits the time.

    Args:
        inputs: v, complex (steps, batch, n).
        power: λ, λ² … as many as a chunk has steps, complex128 (length, n).
        state: x before the first step, or behind the last, complex128 (batch, n).

    Returns:
        all states, like `inputs`, and the one that is reached last, complex128 (batch, n).
    """
    steps, *row = inputs.shape
    length = len(power)
    missing = -steps % length
    padding = inputs.new_zeros(missing, *row)
    padded = torch.cat([padding, inputs] if backwards else [inputs, padding])
    states = padded.unflatten(0, (-1, length))  # (chunks, length, batch, n): a copy, which is overwritten
    order = -1 if backwards else 1
    rows = states.unbind(1)[::order]  # (chunks, batch, n) each
    eigenvalue = power[0].to(inputs.dtype)
    for before, later in pairwise(rows):
        later.addcmul_(eigenvalue, before)
    carries = [state]  # x before each chunk, (batch, n), in the order of the recurrence
    for end in rows[-1].to(state.dtype).unbind(0)[::order][:-1]:
        carries.append(torch.addcmul(end, power[-1], carries[-1]))
    final = length - 1 - missing
    last = torch.addcmul(rows[final].unbind(0)[::order][-1].to(state.dtype), power[final], carries[-1])
    carried = torch.stack(carries[::order]).to(inputs.dtype)
    of_rows = power.flip(0) if backwards else power
    states.addcmul_(of_rows.to(inputs.dtype)[:, None], carried[:, None])
    return (states.flatten(0, 1)[missing:] if backwards else states.flatten(0, 1)[:steps]), last


def draw_lecun(shape: tuple[int, ...], fan_in: int, generator: torch.Generator) -> Tensor:
    """float64 of variance 1/fan_in, normal, truncated at two standard deviations (the sources' `lecun_normal`)."""
    drawn = torch.empty(shape, dtype=torch.float64)
    nn.init.trunc_normal_(drawn, a=-2, b=2, generator=generator)
    return drawn / (0.87962566103423978 * math.sqrt(fan_in))  # standard deviation of the truncated normal


def scale_rows(matrix: Tensor, factor: Tensor) -> Tensor:
    """Rows of a complex matrix, (n, 2, inputs) with real and imaginary parts in the middle, times complex (n,)."""
    re, im = matrix.unbind(1)
    scale_re, scale_im = factor.real.to(matrix.dtype)[:, None], factor.imag.to(matrix.dtype)[:, None]
    return torch.stack([scale_re * re - scale_im * im, scale_re * im + scale_im * re], dim=1)


class DiagonalSSM(nn.Module, ABC):
    """x_k = λ x_{k-1} + B̄ u_k, y_k = Re(C̄ x_k) + D u_k with complex diagonal dynamics.

    B is (states, 2, points) and C (points, states, 2), real and imaginary parts in the axis of size 2: products with
    interleaved real and imaginary parts then need no copy. Subclasses say how λ and B̄ follow from what is stored.
    """

    conjugates: ClassVar[int]  # states that each stored one stands for: C̄ = conjugates · C

    def __init__(self, states: int, points: int) -> None:
        super().__init__()
        self.B = nn.Parameter(torch.zeros(states, 2, points))  # from which B̄ follows
        self.C = nn.Parameter(torch.zeros(points, states, 2))
        self.D = nn.Parameter(torch.zeros(points))  # the way past the states

    @abstractmethod
    def log_eigenvalues(self) -> Tensor:
        """log λ per sample, complex128 (states,)."""

    @abstractmethod
    def input_matrix(self) -> Tensor:
        """B̄ in the layout of B."""

    @abstractmethod
    def initialise(self, how: str, generator: torch.Generator) -> None:
        """Draw every weight: for "paper" as the source does, for "physics" what the string is then written into."""

    @abstractmethod
    def set_modes(self, log_eigenvalues: Tensor, input_matrix: Tensor) -> None:
        """Store the first states so that they have these λ, complex128 (modes,), and this B̄, in the layout of B."""

    def input(self, inputs: Tensor, matrix: Tensor) -> Tensor:
        """`matrix` u, complex (..., states), of real inputs (..., inputs)."""
        return torch.view_as_complex(linear(inputs, matrix.flatten(0, 1)).unflatten(-1, (-1, 2)))

    def diagonal(self) -> tuple[Tensor, Tensor]:
        """The matrices around the diagonal recurrence: B̄ (2 states, inputs) and Re(C̄ x) (outputs, 2 states).

        All real parts come before all imaginary ones.
        """
        real, imaginary = (self.conjugates * self.C).unbind(-1)
        return self.input_matrix().transpose(0, 1).flatten(0, 1), torch.cat([real, -imaginary], dim=1)

    def output(self, states: Tensor) -> Tensor:
        """Re(C̄ x), (..., outputs)."""
        real, imaginary = (self.conjugates * self.C).unbind(-1)  # Re(c x) = c_re x_re - c_im x_im
        return linear(torch.view_as_real(states).flatten(-2), torch.stack([real, -imaginary], dim=-1).flatten(1))

    def forward(self, inputs: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """y (steps, batch, outputs) for u (steps, batch, inputs), and the last x."""
        driven = self.input(inputs, self.input_matrix())
        states, last = recur(driven, self.log_eigenvalues(), state)
        return torch.addcmul(self.output(states), self.D, inputs), last


class GatedBlock(nn.Module):
    """Batch norm, state-space layer, GELU, gate, skip: (steps, batch, features) to the same.

    Batch norm is over batch and time in training and uses the stored statistics in evaluation.
    """

    def __init__(self, seq: DiagonalSSM, features: int) -> None:
        super().__init__()
        self.normalization = nn.BatchNorm1d(features)
        self.seq = seq
        self.gate = Dense(features, 2 * features)  # the source's out1, then its out2

    def forward(self, inputs: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        normalised = self.normalization(inputs.flatten(0, 1)).view_as(inputs)
        outputs, last = self.seq(normalised, state)
        gated = functional.glu(self.gate(functional.gelu(outputs, approximate="tanh")), dim=-1)
        return inputs + gated, last

    def fold(self) -> FoldedBlock:
        """The folded block that equals this one in evaluation."""
        norm = self.normalization
        assert norm.running_mean is not None and norm.running_var is not None
        scale = norm.weight * torch.rsqrt(norm.running_var + norm.eps)
        shift = norm.bias - norm.running_mean * scale
        into_states, output = self.seq.diagonal()
        return FoldedBlock(
            input=into_states * scale,
            input_bias=into_states @ shift,
            eigenvalues=torch.view_as_real(self.seq.log_eigenvalues().exp()),
            output=output,
            through=self.seq.D * scale,
            through_bias=self.seq.D * shift,
            gate=self.gate,
        )

    def initialise(self, how: str, generator: torch.Generator) -> None:
        self.normalization.reset_parameters()
        self.seq.initialise(how, generator)
        self.gate.weight.copy_(draw_lecun(tuple(self.gate.weight.shape), self.gate.in_features, generator))
        self.gate.bias.zero_()


@dataclass(frozen=True)
class FoldedBlock:
    """A block in evaluation for rendering on a CPU.

    Batch norm is in the matrices, and what is left is few calls.

    Attributes:
        input, input_bias: what is added to the states, (2 states, features), all real parts first.
        eigenvalues: λ, float64 (states, 2).
        output: (features, 2 states).
        through, through_bias: D, (features,).
        gate: of the block.
    """

    input: Tensor
    input_bias: Tensor
    eigenvalues: Tensor
    output: Tensor
    through: Tensor
    through_bias: Tensor
    gate: nn.Linear

    def __call__(self, frames: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """The block's outputs, like `frames`, and its state after them.

        Args:
            frames: (steps, batch, features), which may be overwritten.
            state: of the state-space layer before them, complex128 (batch, states).
        """
        from engine.models import _ssm_kernel as kernel  # Numba only when it is needed

        last = state.clone()
        states = functional.linear(frames, self.input, self.input_bias)
        kernel.stream(
            states.unflatten(-1, (2, -1)).numpy(), self.eigenvalues.numpy(), torch.view_as_real(last).numpy()
        )
        outputs = functional.linear(states, self.output)
        if frames.dtype != torch.float32:
            outputs = outputs + self.through * frames + self.through_bias
            return frames + functional.glu(self.gate(functional.gelu(outputs, approximate="tanh"))), last
        rows = frames.flatten(0, 1).numpy()
        kernel.add_and_gelu(outputs.flatten(0, 1).numpy(), rows, self.through.numpy(), self.through_bias.numpy())
        kernel.add_gated(rows, self.gate(outputs).flatten(0, 1).numpy())
        return frames, last


@dataclass(frozen=True)
class SSMState:
    """The state x of every layer, complex128 (batch, states) each, the first layer's first.

    Double precision keeps the carried phases exact; the layers themselves run in the precision of the weights.

    Attributes:
        folded: the blocks with the weights with which the motion's rendering began; empty before it.
    """

    latents: tuple[Tensor, ...]
    folded: tuple[FoldedBlock, ...] = ()


class SSMString(StringModel[SSMState], ABC):
    """A first layer from the initial condition, then blocks."""

    initialisations: ClassVar = {"paper": "", "physics": LINEAR_STRING}

    def __init__(self, configuration: LRUConfiguration | S5Configuration) -> None:
        super().__init__(configuration)
        self.first_layer = self.build_layer()
        blocks = [GatedBlock(self.build_layer(), self.grid_points) for _ in range(configuration.layers)]
        self.layers = nn.ModuleList(blocks)

    @abstractmethod
    def build_layer(self) -> DiagonalSSM:
        """A layer of the model's kind and sizes."""

    def encode(self, displacement: Tensor) -> SSMState:
        """The state at frame 0: the first layer's from displacements (batch, grid_points), the blocks' at zero."""
        origin = self.first_layer.input(displacement, self.first_layer.input_matrix()).to(torch.complex128)
        of_blocks = (ssm.B.shape[0] for ssm in self._ssms()[1:])
        return SSMState((origin, *(origin.new_zeros(len(origin), states) for states in of_blocks)))

    @torch.no_grad()
    def log_eigenvalues(self) -> list[Tensor]:
        stored = [(ssm.log_eigenvalues(), ssm.conjugates) for ssm in self._ssms()]
        return [torch.cat([log, log.conj()]) if conjugates == 2 else log for log, conjugates in stored]

    def set_weights(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """See the contract.

        paper: as the source draws every layer.
        physics: the first layer is the linear string, released from rest, on its first `modes` states; its other
            states are not yet heard, and the blocks, which correct it, start at zero. Prior knowledge that the
            paper's models do not have: say so in a table.
        """
        self.first_layer.initialise(how, generator)
        for block in self._blocks():
            block.initialise(how, generator)
        if how == "physics":
            self._set_linear_string(physics)

    def _set_linear_string(self, physics: Physics) -> None:
        """Write the linear string into the first layer, and let the blocks add nothing.

        Raises:
            ValueError: the first layer has fewer stored states than there are modes.
        """
        modes, first = physics.modes, self.first_layer
        if first.B.shape[0] < modes:
            raise ValueError(
                f"initialisation 'physics' needs a stored state for each of the {modes} modes, not {first.B.shape[0]}"
            )
        log_eigenvalues = physics.log_eigenvalues
        # q_k = Re(z λᵏ) with Re z = q₀; Im z makes the velocity zero
        imaginary = slope_at_rest(log_eigenvalues)[:, None] * physics.analysis
        first.set_modes(log_eigenvalues, torch.stack([physics.analysis, imaginary], dim=1))
        first.C.zero_()
        first.C[:, :modes, 0] = (physics.shapes / first.conjugates).to(first.C)
        for block in self._blocks():
            block.gate.weight[: self.grid_points].zero_()

    def _blocks(self) -> list[GatedBlock]:
        return [block for block in self.layers if isinstance(block, GatedBlock)]

    def _ssms(self) -> list[DiagonalSSM]:
        return [module for module in self.modules() if isinstance(module, DiagonalSSM)]  # the first layer's first

    def advance(self, state: SSMState, steps: int, readout: Tensor | None = None) -> tuple[Tensor, SSMState]:
        """The next `steps` frames (batch, steps, points), in stretches of bounded size, and the state after them."""
        # batch statistics need the whole time at once
        at_once = steps if self.training else max(CHUNK, ROWS_AT_ONCE // max(1, len(state.latents[0])))
        rendering = not (self.training or torch.is_grad_enabled()) and self.first_layer.B.device.type == "cpu"
        folded = (state.folded or tuple(block.fold() for block in self._blocks())) if rendering else ()
        blocks: Sequence[GatedBlock | FoldedBlock] = folded or self._blocks()
        parts = []
        for done in range(0, steps, at_once):
            part, state = self._stretch(blocks, state, min(at_once, steps - done))
            parts.append(part if readout is None else part @ readout.to(part))
        return torch.cat(parts).transpose(0, 1), SSMState(state.latents, folded)

    def _stretch(
        self, blocks: Sequence[GatedBlock | FoldedBlock], state: SSMState, steps: int
    ) -> tuple[Tensor, SSMState]:
        """The next frames, time-major (steps, batch, grid_points), by the first layer and `blocks`, and the state."""
        first = self.first_layer
        states, last = evolve(first.log_eigenvalues(), state.latents[0], steps, first.B.dtype.to_complex())
        frames, latents = first.output(states), [last]
        for block, latent in zip(blocks, state.latents[1:], strict=True):
            frames, last = block(frames, latent)
            latents.append(last)
        return frames, SSMState(tuple(latents))

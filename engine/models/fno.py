"""FGRU and FRNN: Fourier neural operators in recurrent cells, over the points of the string.

Source: Parker et al., "Physical Modeling using Recurrent Neural Networks with Fast Convolutional Layers", DAFx 2022;
the paper, §4.2. The hidden state is a field h of `width` channels on the grid. 𝓕 is a Fourier
convolution (`FourierConvolution`), and every step is

    FGRU: z = σ(𝓕_z h),  r = σ(𝓕_r h),  h ← (1 - z) ⊙ h + z ⊙ tanh(𝓕_h(r ⊙ h)),
    FRNN: h ← ReLU(𝓕_l h) + W_l h + b_l  for layers l = 1 … depth,

with the same map of each point from the initial displacement to h and from h to the displacement.

Roll-outs take few and large products (`_fno_rollout`), and gradients pass through them; where none is wanted, on the
CPU in single precision, a compiled kernel is faster (`_fno_kernel`). A listening point costs what the grid costs: the
recurrence needs the whole field.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import torch
from torch import Tensor, nn
from torch.utils.checkpoint import checkpoint

from engine.models._fno_rollout import channel_matrices, fgru_rollout, frnn_rollout, joined
from engine.models._fno_transform import transform_matrices
from engine.models.base import Physics, StringModel
from engine.models.configurations import FGRUConfiguration, FRNNConfiguration

if TYPE_CHECKING:
    from engine.models import _fno_kernel as kernel

KEPT_BYTES = 2_000_000_000  # of a roll-out, for its gradient, on a CPU …
KEPT_SHARE = 0.2  # … and of a GPU's memory


@dataclass(frozen=True)
class FieldState:
    """The hidden field reached."""

    hidden: Tensor  # (batch, grid_points, width)


class FourierConvolution(nn.Module):
    """A linear map of a field: a complex matrix on its channels at each frequency, and a bias in frequency.

    The field is followed by as many zeros, so that one end does not reach round to the other. Of the grid_points + 1
    frequencies of the real transform all but the highest are kept.
    """

    def __init__(self, grid_points: int, width: int) -> None:
        super().__init__()
        # real and imaginary parts on the last axis but one: rows of outputs are contiguous, as the kernel reads them
        self.weight = nn.Parameter(torch.zeros(grid_points, width, 2, width))  # frequency, in, real/imaginary, out
        self.bias = nn.Parameter(torch.zeros(grid_points, 2, width))

    def bias_field(self) -> Tensor:
        """The bias in space (grid_points, width)."""
        points = len(self.bias)
        return torch.fft.irfft(torch.complex(self.bias[:, 0], self.bias[:, 1]), n=2 * points, dim=0)[:points]

    def initialise(self, generator: torch.Generator) -> None:
        """Uniform from 0 to 1/width² (weight) and 1/width (bias), real and imaginary parts alike."""
        width = self.bias.shape[-1]
        nn.init.uniform_(self.weight, 0, width**-2, generator=generator)
        nn.init.uniform_(self.bias, 0, 1 / width, generator=generator)


class _FourierRecurrent(StringModel[FieldState]):
    """The parts that both cells share: the maps in and out, and the choice of the roll-out or the kernel."""

    initialisations: ClassVar = {"paper": ""}
    mapped: ClassVar = False  # its training calls compiled code
    kept_fields: int  # hidden fields that a step keeps for its gradient, an estimate of its memory

    def __init__(self, configuration: FGRUConfiguration | FRNNConfiguration) -> None:
        super().__init__(configuration)
        self.in_mapping = nn.Linear(1, configuration.width)  # displacement of a point to its channels
        self.out_mapping = nn.Linear(configuration.width, 1)  # and back

    @abstractmethod
    def rollout(self, hidden: Tensor, steps: int) -> Tensor:
        """The fields after each step, (steps, grid_points, batch, width), of one (grid_points, batch, width)."""

    @abstractmethod
    def compiled(self) -> tuple[Callable[..., None], tuple[kernel.Pair, ...]]:
        """The kernel, and its weights and biases between the transforms and the map out."""

    def encode(self, displacement: Tensor) -> FieldState:
        return FieldState(self.in_mapping(displacement[..., None]))

    def advance(self, state: FieldState, steps: int, readout: Tensor | None = None) -> tuple[Tensor, FieldState]:
        """The next `steps` frames (batch, steps, points) and the state after them, by the kernel where it serves.

        A `readout` (grid_points, points) is applied to the frames of the whole grid.
        """
        hidden = state.hidden
        learning = torch.is_grad_enabled() and any(t.requires_grad for t in (hidden, *self.parameters()))
        paired = hidden.shape[-1] % 2 == 0  # the kernel takes channels two at a time
        compiled = paired and not learning and hidden.device.type == "cpu" and hidden.dtype == torch.float32
        frames, hidden = (self._advance_compiled if compiled else self._advance_plain)(hidden, steps)
        if readout is not None:
            frames = frames @ readout.to(frames)
        return frames, FieldState(hidden)

    def _advance_plain(self, hidden: Tensor, steps: int) -> tuple[Tensor, Tensor]:
        """Displacement (batch, steps, grid_points), with gradients, and the last hidden field, as `hidden`.

        Args:
            hidden: (batch, grid_points, width).
        """
        fields, parts = hidden.transpose(0, 1).contiguous(), []
        # a gradient needs much of every step: more than fits is kept for one stretch, computed again for the others
        step_bytes = max(1, self.kept_fields * fields.numel() * fields.element_size())
        kept_bytes = KEPT_BYTES
        if hidden.device.type == "cuda":
            kept_bytes = int(KEPT_SHARE * torch.cuda.get_device_properties(hidden.device).total_memory)
        length = min(steps, max(1, kept_bytes // step_bytes))  # steps of a stretch
        for first in range(0, steps, length):
            count = min(length, steps - first)
            if length == steps:
                part = self.rollout(fields, count)
            else:
                part = checkpoint(self.rollout, fields, count, use_reentrant=False, preserve_rng_state=False)
            fields = part[-1]
            parts.append(self.out_mapping(part)[..., 0])
        return torch.cat(parts).permute(2, 0, 1), fields.transpose(0, 1)

    def _advance_compiled(self, hidden: Tensor, steps: int) -> tuple[Tensor, Tensor]:
        """Compute the results of `_advance_plain`, without gradients, by the kernel, string by string."""
        fields = hidden.detach().clone(memory_format=torch.contiguous_format)
        frames = fields.new_empty(len(fields), steps, self.grid_points)
        advance, weights = self.compiled()
        transforms, out = transform_matrices(self.grid_points), _dense_arrays([self.out_mapping])
        for field, trajectory in zip(fields.numpy(), frames.numpy(), strict=True):
            advance(field, trajectory, transforms, *weights, out)
        return frames, fields

    def set_weights(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """See the contract.

        paper: Fourier weights and biases uniform and positive (`FourierConvolution.initialise`); the other maps
            uniform within ±1/√inputs.
        """
        for module in self.modules():
            if isinstance(module, FourierConvolution):
                module.initialise(generator)
            elif isinstance(module, nn.Linear):
                bound = module.in_features**-0.5
                nn.init.uniform_(module.weight, -bound, bound, generator=generator)
                nn.init.uniform_(module.bias, -bound, bound, generator=generator)


class FGRU(_FourierRecurrent):
    """See the module."""

    kept_fields = 20

    def __init__(self, configuration: FGRUConfiguration) -> None:
        super().__init__(configuration)
        sizes = configuration.grid_points, configuration.width
        self.z_layer = FourierConvolution(*sizes)
        self.r_layer = FourierConvolution(*sizes)
        self.h_layer = FourierConvolution(*sizes)

    def rollout(self, hidden: Tensor, steps: int) -> Tensor:
        z, r, candidate = (channel_matrices(layer.weight) for layer in (self.z_layer, self.r_layer, self.h_layer))
        gates_bias = torch.cat([self.z_layer.bias_field(), self.r_layer.bias_field()], dim=1)
        # both gates see the same field: one convolution
        weights = joined(z, r), gates_bias, candidate, self.h_layer.bias_field()
        return fgru_rollout(hidden, *weights, steps)

    def compiled(self) -> tuple[Callable[..., None], tuple[kernel.Pair, ...]]:
        from engine.models import _fno_kernel as kernel  # Numba only when it is needed

        return kernel.advance_fgru, (_convolution_arrays([self.z_layer, self.r_layer, self.h_layer]),)


class FRNN(_FourierRecurrent):
    """See the module. Nothing bounds it: it may blow up, more so before it is trained."""

    def __init__(self, configuration: FRNNConfiguration) -> None:
        super().__init__(configuration)
        self.kept_fields = 10 * configuration.depth
        sizes = configuration.grid_points, configuration.width
        self.fourier_layers = nn.ModuleList(FourierConvolution(*sizes) for _ in range(configuration.depth))
        self.pointwise_layers = nn.ModuleList(
            nn.Linear(configuration.width, configuration.width) for _ in range(configuration.depth)
        )

    def rollout(self, hidden: Tensor, steps: int) -> Tensor:
        matrices = torch.stack([channel_matrices(layer.weight) for layer in self._convolutions])
        biases = torch.stack([layer.bias_field() for layer in self._convolutions])
        pointwise = torch.stack([layer.weight for layer in self._pointwise])
        offsets = torch.stack([layer.bias for layer in self._pointwise])
        return frnn_rollout(hidden, matrices, biases, pointwise, offsets, steps)

    @property
    def _convolutions(self) -> list[FourierConvolution]:
        return [layer for layer in self.fourier_layers if isinstance(layer, FourierConvolution)]

    @property
    def _pointwise(self) -> list[nn.Linear]:
        return [layer for layer in self.pointwise_layers if isinstance(layer, nn.Linear)]

    def compiled(self) -> tuple[Callable[..., None], tuple[kernel.Pair, ...]]:
        from engine.models import _fno_kernel as kernel  # Numba only when it is needed

        return kernel.advance_frnn, (_convolution_arrays(self._convolutions), _dense_arrays(self._pointwise))


@torch.no_grad()
def _convolution_arrays(layers: Sequence[FourierConvolution]) -> kernel.Pair:
    """Weights (layers, frequency, in, real/imaginary, out), and biases in space (layers, grid_points, width)."""
    weights = torch.stack([layer.weight.detach() for layer in layers])
    return weights.numpy(), torch.stack([layer.bias_field() for layer in layers]).numpy()


@torch.no_grad()
def _dense_arrays(layers: Sequence[nn.Linear]) -> kernel.Pair:
    """Weights (layers, in, out) and biases (layers, out)."""
    weights = torch.stack([layer.weight.T.contiguous() for layer in layers])
    return weights.numpy(), torch.stack([layer.bias.detach() for layer in layers]).numpy()

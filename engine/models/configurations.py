"""The sizes of every learned model. Nothing here needs torch, so that presets are listed and checked without it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from engine import bounds

LEAST_PHASE = 0.02  # of `koopman_tension` between nodes: a voice of more would take too much of the device's time


@dataclass(frozen=True)
class _Sizes:
    """Sizes within `bounds`: every whole number of a model's configuration, and each of its tuples.

    Raises:
        ValueError: one is out of its bounds; the message names the field.
    """

    grid_points: int = 101

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, bool):
                continue
            if isinstance(value, int):
                bounds.check(name, value, bounds.SIZES.get(name, bounds.OTHER_SIZES))
            elif isinstance(value, float):
                bounds.check(name, value, (-1e12, 1e12))
            elif len(value) > bounds.MOST_LAYERS_OF_WIDTHS:
                most = bounds.MOST_LAYERS_OF_WIDTHS
                raise ValueError(f"{name} has {len(value)} entries, at most {most} may be given")
            else:
                for width in value:
                    bounds.check(name, width, (1, bounds.LARGEST_WIDTH))


@dataclass(frozen=True)
class DMDConfiguration(_Sizes):
    """Sizes; the defaults are the paper's (10,200 parameters: 50 complex eigenvalues, and modes on 101 points).

    Attributes:
        lags: frames in the embedding.
        rank: singular vectors kept, which is the number of modes. Two for each mode of the string are enough.
    """

    lags: int = 2
    rank: int = 50

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rank > self.lags * self.grid_points:
            raise ValueError(
                f"rank must be at most lags times grid_points, {self.lags * self.grid_points}, not {self.rank}"
            )


@dataclass(frozen=True)
class KoopmanConfiguration(_Sizes):
    """Sizes; the defaults are the paper's (191,077 parameters).

    Attributes:
        state_size: number n of complex eigenvalues.
        encoder_widths, decoder_widths: hidden widths of the MLPs.
        mixing_layer: a dense layer 2n → 2n at the encoder's end, without an activation before it. The paper's text
            does not name it, its number of parameters has it.
    """

    state_size: int = 128
    encoder_widths: tuple[int, ...] = (128, 128)
    decoder_widths: tuple[int, ...] = (128, 128)
    mixing_layer: bool = True


@dataclass(frozen=True)
class KoopmanVarConfiguration(_Sizes):
    """Sizes; the defaults are the paper's (134,885 parameters).

    Attributes:
        state_size: number n of complex eigenvalues.
        multiplier_widths: hidden widths of the multiplier's MLP.
    """

    state_size: int = 128
    multiplier_widths: tuple[int, ...] = (128, 128, 128)


@dataclass(frozen=True)
class IntegratedPhaseConfiguration(_Sizes):
    """Sizes. An empty tuple of widths leaves that network out.

    Attributes:
        state_size: number n of complex eigenvalues: one for each mode, or more to spare.
        encoder_widths: hidden widths of the MLP that is added to the linear encoder.
        eigenvalue_widths: hidden widths of g.
        adiabatic: whether f follows the mean tension to all orders and there are A_in and A_out.
        node_spacing: samples between the nodes of the integral of g; energies hardly change in between.
        second_order: whether g counts by Σ E_m.
    """

    state_size: int = 25
    encoder_widths: tuple[int, ...] = (128, 128)
    eigenvalue_widths: tuple[int, ...] = (128, 128)
    adiabatic: bool = False
    node_spacing: int = 40
    second_order: bool = False


@dataclass(frozen=True)
class KoopmanTensionConfiguration(_Sizes):
    """Sizes.

    Attributes:
        modes: number of latents: as many as the resonator has modes, or more, which then rest.
        degree: of each curve's polynomial in (hω)².
        node_phase: the largest phase in rad that the first mode turns between nodes.
        highest_phase: the same of the highest mode; below π/2 no two modes are pumped.
    """

    modes: int = 25
    degree: int = 3
    node_phase: float = 0.05
    highest_phase: float = 1.56

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.modes * self.grid_points > bounds.MOST_MATRIX_NUMBERS:
            raise ValueError(f"modes times grid_points must be at most {bounds.MOST_MATRIX_NUMBERS}")
        for name in ("node_phase", "highest_phase"):
            bounds.check(name, getattr(self, name), (LEAST_PHASE, math.pi))


@dataclass(frozen=True)
class FGRUConfiguration(_Sizes):
    """Sizes; the defaults are the paper's (640,033 parameters).

    Attributes:
        width: channels of the hidden field.
    """

    width: int = 32


@dataclass(frozen=True)
class FRNNConfiguration(_Sizes):
    """Sizes; the defaults are the paper's (643,201 parameters).

    Attributes:
        width: channels of the hidden field.
        depth: Fourier layers in a step.
    """

    width: int = 32
    depth: int = 3


@dataclass(frozen=True)
class LRUConfiguration(_Sizes):
    """Sizes; the defaults are the paper's (636,221 parameters).

    Attributes:
        state_size: complex states of every layer.
        layers: blocks after the first layer.
    """

    state_size: int = 128
    layers: int = 8


@dataclass(frozen=True)
class S5Configuration(_Sizes):
    """Sizes; the defaults are the paper's (307,879 parameters).

    Attributes:
        state_size: states of every layer; half of them, one of each conjugate pair, are stored.
        hippo_blocks: diagonal blocks of the initial state matrix, each a HiPPO-LegS matrix.
        layers: blocks after the first layer.
    """

    state_size: int = 128
    hippo_blocks: int = 16
    layers: int = 6

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.state_size % (2 * self.hippo_blocks):
            raise ValueError(
                f"state_size must be a multiple of twice the {self.hippo_blocks} hippo_blocks, not {self.state_size}"
            )

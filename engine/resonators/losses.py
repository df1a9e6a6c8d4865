"""The decay by mode as physics gives it.

A string's two numbers d₁ and d₃ stand beside it, and may be 0 then.

    σ_n = a π (ν + d √(π ν ρ f_n)) / ρA  +  ω_n/2 · (T δ + E I η_n² β) / (T + E I η_n²)

Air, by the diameter d, with its viscosity ν and density ρ: C. Valette, "The mechanics of vibrating strings", in
"Mechanics of Musical Instruments", Springer 1995. Friction inside the string δ, the same at all frequencies, and the
loss factor of bending β: J. Woodhouse, "Plucked guitar transients", Acta Acustica 90, 2004, whose loss factors are
weighted by the energies of tension and of bending. The bridge's share is in `engine.values.string`.
"""

from __future__ import annotations

import numpy as np

from engine.kernels.strings import Mode, loss
from engine.resonators.base import Array
from engine.values.string import Losses, StringParameters


def loss_rates(
    losses: Losses, string: StringParameters, partials: int, decay: float = 1.0, brightness_decay: float = 1.0
) -> Array:
    """σ of each partial in 1/s, float64 (partials,), without d₁ and d₃; see `loss_rate`."""
    return loss_rate(losses, string, np.arange(1.0, partials + 1), decay, brightness_decay)


def loss_rate(losses: Losses, string: StringParameters, partial: Mode, decay: float, brightness_decay: float) -> Mode:
    """σ of a partial in 1/s, or of each of an array, without d₁ and d₃.

    Args:
        decay, brightness_decay: factors of the losses to the air, and of those inside the string.
    """
    factors = decay * losses.air, brightness_decay * losses.friction, brightness_decay * losses.bending
    return loss(string.row, partial, *factors)

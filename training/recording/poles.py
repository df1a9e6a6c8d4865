"""Decaying exponentials in a narrow band, by the shift invariance of their subspace (ESPRIT; Roy, Kailath 1989).

The band is the complex envelope of a stretch of the spectrum. The subspace serves as a start only: on real notes its
poles are erratic, and `refine` follows always.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Complex = NDArray[np.complex128]

LONGEST_WINDOW = 120


def subspace_poles(envelope: Complex, count: int) -> Complex:
    """`count` factors z a step with envelope ≈ Σ a z^m, fewer where it is too short, (poles,)."""
    length = min(len(envelope) // 2, LONGEST_WINDOW)
    if length <= count:
        return np.zeros(0, complex)
    rows = linalg.hankel(envelope[: len(envelope) - length + 1], envelope[len(envelope) - length :])
    # of the small side alone
    gram = rows.conj().T @ rows
    _, vectors = linalg.eigh(gram, subset_by_index=(length - count, length - 1))
    space = vectors.conj()
    turned, *_ = linalg.lstsq(space[:-1], space[1:])
    return np.asarray(linalg.eigvals(turned))

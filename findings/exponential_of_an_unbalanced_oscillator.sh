#!/usr/bin/env bash
# The matrix exponential of an oscillator of displacement and velocity, as state-space models of strings need it.
#
# Guess, written before the run: exp of [[0, 1], [-ω², -2σ]]/rate loses digits, for its entries are as far apart as 1
# and ω². jax.scipy.linalg.expm, which halves a matrix until its 1-norm is small and squares the result as often, is
# off by 1e-11 for a mode of 20 kHz, after 18 squarings. scipy.linalg.expm, which looks at norms of powers of the
# matrix, is off by 1e-14. With velocity over ω both are right to 1e-15.
#
# Seen (Linux, x86-64, CPU): jax loses a hundred times as much as guessed, 1.3e-9 at 5 kHz, and already 2e-11 at 1
# kHz, where a sample turns the mode by an eighth of a rad. In single precision it is off by 2.5 % of the amplitude at
# 1 kHz, and at 5 kHz by more than the whole. scipy loses nothing, 2e-15 at most. The same numbers with velocity over
# ω are right to 1e-16 in jax, too, and to 1e-7 in single precision: it is the units that cost the digits, not the
# motion. So a layer that is made from a physical string by expm must be balanced first.
#
# Needs python3 (3.11 or later) with venv, and a package index. Fails if an error below changes its order.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check jax==0.10.2 jaxlib==0.10.2 numpy==2.4.6 \
    scipy==1.17.1
JAX_PLATFORMS=cpu "$folder/venv/bin/python" - <<'PY'
import jax
import jax.scipy.linalg
import numpy as np
import scipy.linalg

jax.config.update("jax_enable_x64", True)
RATE_HZ, SIGMA = 48_000, 3.0
EXPONENTIALS = {
    "scipy": scipy.linalg.expm,
    "jax": lambda matrix: np.asarray(jax.scipy.linalg.expm(matrix)),
    "jax, single": lambda matrix: np.asarray(jax.scipy.linalg.expm(matrix.astype(np.float32)), np.float64),
}


def errors(hz, exponential):
    """The largest error in the units that both have, displacement and velocity over ω: as it is, and balanced."""
    omega, time_s = 2 * np.pi * hz, 1 / RATE_HZ
    matrix = np.array([[0, 1], [-(omega**2), -2 * SIGMA]]) * time_s
    turns = np.sqrt(omega**2 - SIGMA**2)
    cosine, sine = np.cos(turns * time_s), np.sin(turns * time_s) / turns
    true = np.exp(-SIGMA * time_s) * np.array(
        [[cosine + SIGMA * sine, omega * sine], [-omega * sine, cosine - SIGMA * sine]]
    )
    scale = np.array([[1, omega], [1 / omega, 1]])
    plain = exponential(matrix) * scale
    return float(np.abs(plain - true).max()), float(np.abs(exponential(matrix * scale) - true).max())


print(f"jax {jax.__version__}, scipy {scipy.__version__}, a sample at {RATE_HZ} Hz; error plain, with v/ω:")
found = {}
for hz in (100, 1_000, 5_000, 20_000):
    for name, exponential in EXPONENTIALS.items():
        plain, balanced = found[name, hz] = errors(hz, exponential)
        print(f"  {hz:>6} Hz, {name:<12} {plain:.1e}  {balanced:.1e}")
assert all(plain < 2e-14 for (name, _), (plain, _) in found.items() if name == "scipy"), "scipy loses digits"
assert found["jax", 1_000][0] > 1e-12 and found["jax", 5_000][0] > 1e-10, "jax no longer loses digits"
assert found["jax, single", 5_000][0] > 0.1, "single precision is right at 5 kHz"
assert all(found["jax", hz][1] < 5e-15 for hz in (100, 1_000, 5_000, 20_000)), "balanced, jax loses digits, too"
PY

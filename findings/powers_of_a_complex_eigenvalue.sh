#!/usr/bin/env bash
# Powers of a complex eigenvalue in single precision, as diagonal state-space models (LRU, S5, Koopman) need them.
#
# Guess, written before the run: a tree of products (jax.lax.associative_scan) loses least, because each power is
# made of log2(k) products; jnp.cumprod is such a tree, too; `**` loses more, since the phase of a power is rounded;
# NumPy's cumprod, which multiplies step by step, loses most. NumPy keeps complex64 when its exponent is an integer.
#
# Seen (Linux, x86-64, CPU): the other way round. associative_scan is off by 1.2e-4, as much as `**`, and jnp.cumprod by
# 6.3e-5; NumPy's product of 4000 single steps by 7.0e-6, an eighteenth. In a tree the few factors are themselves powers
# with rounded phases, and their errors add in one direction; step by step the roundings differ and cancel. NumPy's `**`
# with an array of int64 exponents turns complex64 into complex128 and is off by 1.6e-12.
# So a model that is trained with a scan and rendered with steps, or in NumPy, plays other phases.
#
# Needs python3 (3.11 or later) with venv, and a package index. Fails if an ordering below changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet jax==0.10.2 jaxlib==0.10.2 numpy==2.4.6
JAX_PLATFORMS=cpu "$folder/venv/bin/python" - <<'PY'
import jax
import jax.numpy as jnp
import numpy as np

steps = 4000
phases = np.linspace(0.01, 3.1, 400)
single = (0.9995 * np.exp(1j * phases)).astype(np.complex64)
log = np.log(single.astype(np.clongdouble))  # of the rounded eigenvalue: rounding it is not counted
true = np.exp(steps * log)


def error(power):
    return float(np.abs(np.asarray(power).astype(np.clongdouble) / true - 1).max())


repeated = jnp.broadcast_to(single, (steps, len(single)))
integer = single ** np.full(len(single), steps)
errors = {
    "numpy cumprod": error(np.cumprod(np.asarray(repeated), axis=0)[-1]),
    "jnp.cumprod": error(jnp.cumprod(repeated, axis=0)[-1]),
    "jax.lax.associative_scan": error(jax.lax.associative_scan(jnp.multiply, repeated)[-1]),
    "jnp, x ** k": error(jnp.asarray(single) ** steps),
    "numpy, complex64 ** int64 array": error(integer),
}
print(f"jax {jax.__version__}, numpy {np.__version__}, relative error of the power {steps}, the largest of {len(single)}:")
for name, value in errors.items():
    print(f"  {name:<32} {value:.1e}")
assert errors["jax.lax.associative_scan"] > 8 * errors["numpy cumprod"], "the scan loses no more than single steps"
assert errors["jnp.cumprod"] > 4 * errors["numpy cumprod"], "jnp.cumprod loses no more than single steps"
assert errors["jnp, x ** k"] > 8 * errors["numpy cumprod"], "the power loses no more than single steps"
assert integer.dtype == np.complex128 and errors["numpy, complex64 ** int64 array"] < 1e-10, "numpy keeps complex64"
print(f"  dtype of numpy's complex64 ** int64 array: {integer.dtype}")
PY

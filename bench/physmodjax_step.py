"""Training steps of the paper's authors' code, which is imported unchanged, for `authors`.

Run by a Python with jax, flax, optax and einops: physmodjax_step.py SOURCE MODEL BATCH FRAMES POINTS THREADS, where
SOURCE is a clone of rodrigodzf/physmodjax. Each line of standard input is answered with one: the first with the
number of parameters, the others with a step's seconds and the processor's.

The sizes are those of the paper's table; the configuration files there have others.
"""

# ruff: noqa: E402
from __future__ import annotations

import os
import sys
import time
from functools import partial
from typing import Any

SOURCE, NAME = sys.argv[1:3]
BATCH, FRAMES, POINTS, THREADS = map(int, sys.argv[3:])
if hasattr(os, "sched_setaffinity"):  # XLA takes a thread for each core that it may use
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:THREADS])
sys.path.insert(0, SOURCE)

import flax.linen as nn
import jax
import jax.numpy as jnp
import optax
from physmodjax.models.autoencoders import BatchedKoopmanAutoencoder1D
from physmodjax.models.mlp import MLP
from physmodjax.models.recurrent import LRUDynamicsVarying
from physmodjax.models.ssm import LRU, S5SSM, BatchStackedSSMModel, LRUDynamics

N = 128
RING: dict[str, Any] = {"d_hidden": N, "r_min": 0.99, "r_max": 1.0, "max_phase": 6.28, "clip_eigs": False}
CONSISTENCY_WEIGHT = 0.01


def build(name: str) -> Any:
    """A model over a batch."""
    if name in ("lru", "s5"):
        layer = partial(LRU, d_hidden=N, r_min=0.99) if name == "lru" else partial(S5SSM, d_hidden=N)
        sizes = {"d_model": POINTS, "d_vars": 1, "n_layers": 8 if name == "lru" else 6, "n_steps": FRAMES}
        return BatchStackedSSMModel(ssm=layer, ssm_first_layer=layer, **sizes, norm="batch", activation="full_glu")
    if name == "koopman":
        encoder, decoder = partial(MLP, [N, N, 2 * N, 2 * N]), partial(MLP, [N, N, POINTS])
        dynamics = partial(LRUDynamics, **RING)
    else:
        encoder, decoder = partial(nn.Dense, 2 * N), partial(nn.Dense, POINTS)
        dynamics = partial(LRUDynamicsVarying, **RING, model=MLP([N, N, N, 2 * N]))
    models = {"encoder_model": encoder, "decoder_model": decoder, "dynamics_model": dynamics}
    return BatchedKoopmanAutoencoder1D(**models, d_vars=1, d_model=POINTS, n_steps=FRAMES)


key = jax.random.PRNGKey(0)
whole = jax.random.normal(key, (BATCH, FRAMES + 1, POINTS, 1))
initial, target = whole[:, :1], whole[:, 1:]
model, optimiser = build(NAME), optax.adamw(0.003)


def koopman_loss(weights: Any, statistics: Any) -> Any:
    """The loss of the paper's text: frame 0 is decoded again, and latents are compared before the multiplier."""
    method = {
        name: partial(model.apply, {"params": weights}, method=name) for name in ("encode", "advance", "decode")
    }
    encoded = method["encode"](whole)
    predicted = method["decode"](method["advance"](encoded[:, 0]))
    decoded = method["decode"](encoded[:, 0])
    eigenvalues = {"params": {name: weights["dynamics"][name] for name in ("nu_log", "theta_log")}}
    origin = jax.lax.complex(encoded[:, 0, :N], encoded[:, 0, N:])
    latents = jax.vmap(lambda z: LRUDynamics(**RING).apply(eigenvalues, z, FRAMES))(origin)
    latents = jnp.concatenate([latents.real, latents.imag], axis=-1)
    loss = jnp.mean((predicted - target) ** 2) + jnp.mean((decoded - initial[:, 0]) ** 2)
    return loss + CONSISTENCY_WEIGHT * jnp.mean((latents - encoded[:, 1:]) ** 2), statistics


def state_space_loss(weights: Any, statistics: Any) -> Any:
    predicted, statistics = model.apply({"params": weights, **statistics}, initial, mutable=["batch_stats"])
    return jnp.mean((predicted - target) ** 2), statistics


@jax.jit
def step(weights: Any, moments: Any, statistics: Any) -> Any:
    loss = koopman_loss if NAME.startswith("koopman") else state_space_loss
    gradients, statistics = jax.grad(loss, has_aux=True)(weights, statistics)
    updates, moments = optimiser.update(gradients, moments, weights)
    return optax.apply_updates(weights, updates), moments, statistics


statistics = dict(model.init(key, initial))
weights = statistics.pop("params")
state = weights, optimiser.init(weights), statistics
for number, _ in enumerate(sys.stdin):
    if number == 0:
        print(sum(each.size for each in jax.tree.leaves(weights)), flush=True)
        continue
    began, busy = time.perf_counter(), time.process_time()
    state = jax.block_until_ready(step(*state))
    print(time.perf_counter() - began, time.process_time() - busy, flush=True)

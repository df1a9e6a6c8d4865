"""Programs: what all voices of one source share, at one sample rate.

A model whose decoder is linear becomes a bank of latents, and the string itself a solver; both are compiled and
sound at once, at the device's own rate. Any other model is rendered ahead at its own rate, and converted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from engine.bounds import SUBSTEPS_IN_A_PERIOD
from engine.kernels.scheme import KICKS, ROTATIONS
from engine.kernels.voice_records import (
    RENDERED,
    RENDERED_PROGRAM,
    STAGES,
    TENSION,
    TENSION_PROGRAM,
    TRUTH,
    TRUTH_PROGRAM,
)
from engine.levels import FULL_SCALE_M
from engine.models._tension_law import CURVES
from engine.models.configurations import KoopmanTensionConfiguration
from engine.presets import Preset, PresetInfo
from engine.resonators.base import Array, Resonator
from engine.voices.program import Program, fits, packed, voice_ends_s

HEARD_SILENCE = 4e-6  # of a mode, of all: what the truth leaves out where it is heard is 108 dB down
# Drums radiate high modes better than low ones: at 4e-6 they would leave with audible steps.
DRUM_SILENCE = 2e-7
# Of the model's drums: shares of the sound, below which a mode rests if it hardly stretches the drum, and of all
# amplitudes, below which it is laid to rest for good.
DRUM_UNHEARD, DRUM_STILL = 1e-7, 1e-8
HEARD_COARSER = 15  # times fewer sub-steps than data are made with: 1e-5 off after a second, far below audibility
FILTER_TAPS = 32  # samples to either side of a frame that its value is taken from
FILTER_PHASES = 512  # places between two samples for which taps are kept
FILTER_BETA = 10.0  # shape of the Kaiser window


def tension_program(
    weights: Mapping[str, Array], c: KoopmanTensionConfiguration, resonator: Resonator, rate_hz: int
) -> Program:
    """The program of what the model of many strings learned (its curves), for any kind of resonator at any rate."""
    return _with_modes(TENSION, tension_memory(weights, c, rate_hz), resonator, rate_hz)


def tension_memory(
    weights: Mapping[str, Array],
    c: KoopmanTensionConfiguration,
    rate_hz: int,
    silence: float = HEARD_SILENCE,
    unheard: float = 0.0,
) -> Array:
    """The memory that the kernels read of the model, whatever the resonator.

    Args:
        silence: of a mode, of all together, from which on the highest are laid to rest.
        unheard: see `DRUM_UNHEARD`; 0: all modes move.
    """
    values = {
        "coefficients": c.degree + 1,
        "node_phase": c.node_phase,
        "highest_phase": c.highest_phase,
        "silence": silence,
        "loudness": -math.log(FULL_SCALE_M),
        "rate_hz": rate_hz,
        "unheard": unheard,
    }
    return packed(TENSION_PROGRAM, values, *(weights[name] for name in CURVES))


def truth_program(info: PresetInfo, rate_hz: int, coarser: int = HEARD_COARSER) -> Program:
    """The physics of a preset's string, with its modes, at any rate.

    Args:
        coarser: how many times fewer sub-steps than `default_substeps`.
    """
    return solver_program(info.resonator, rate_hz, coarser, aliased=rate_hz == info.rate_hz)


def solver_program(
    resonator: Resonator, rate_hz: int, coarser: int = HEARD_COARSER, aliased: bool = False
) -> Program:
    """The physics of a resonator at any rate.

    Args:
        aliased: modes that are too high for the rate are heard as others, as they are in data of that rate.
    """
    return _with_modes(TRUTH, solver_memory(rate_hz, coarser), resonator, rate_hz, aliased)


def solver_memory(rate_hz: int, coarser: int = HEARD_COARSER, silence: float = HEARD_SILENCE) -> Array:
    """The memory that the kernels read of the solver, whatever the resonator.

    Args:
        coarser: how many times fewer sub-steps than `default_substeps`.
        silence: share of all amplitudes, below which the highest modes are laid to rest.
    """
    values = {
        "substeps": SUBSTEPS_IN_A_PERIOD / coarser,
        "silence": silence,
        "loudness": -math.log(FULL_SCALE_M),
        "rate_hz": rate_hz,
        "rotations": ROTATIONS[: STAGES // 2],
        "kicks": KICKS,
    }
    return packed(TRUTH_PROGRAM, values)


def _with_modes(kind: int, memory: Array, resonator: Resonator, rate_hz: int, aliased: bool = False) -> Program:
    """The program of a kind whose voices move amplitudes of the resonator's modes.

    Args:
        memory: the kind's record with what it points to.
        aliased: whether modes that are too high for the rate are heard, as others; else they are silent.
    """
    omega = resonator.eigenvalues().imag  # it swings
    shapes, n = resonator.shapes, resonator.modes
    if not aliased:
        shapes = shapes * fits(omega / rate_hz)[:, None]

    def start(displacement_m: Array) -> tuple[Array, Array]:
        return resonator.to_modes(displacement_m), np.zeros(n)

    def read(weights: Array) -> tuple[Array, Array]:
        weighted = weights.T @ shapes.T / FULL_SCALE_M
        return np.concatenate([weighted, np.zeros_like(weighted)], axis=1), np.zeros(len(weighted))

    return Program(kind, memory, n, rate_hz, resonator.points, start, read, resonator, force=resonator.force_weights)


def model_program(preset: Preset, rate_hz: int) -> Program:
    """The compiled voice of a model where it has one, otherwise for samples that are rendered ahead."""
    if preset.info.of_many_strings:
        return tension_program(preset.weights, preset.configuration, preset.info.resonator, rate_hz)
    if preset.info.model in ("dmd", "koopman_integrated"):
        from engine.voices.banks import bank_program  # and torch, which a preset of many strings plays without

        if (bank := bank_program(preset.model, preset.info, rate_hz)) is not None:
            return bank
    return rendered_program(preset.info, rate_hz)


def rendered_program(info: PresetInfo, rate_hz: int) -> Program:
    """The program for samples that are rendered ahead at the preset's own rate."""
    force = info.resonator.force_weights
    return _samples_program(info.rate_hz, rate_hz, info.grid_points, voice_ends_s(info), force)


@lru_cache(maxsize=4)
def plain_program(rate_hz: int) -> Program:
    """The program for samples of the device's own rate, which are played as they are."""
    return _samples_program(rate_hz, rate_hz, 0, math.inf)


def _samples_program(
    source_rate_hz: int, rate_hz: int, grid_points: int, ends_s: float, force: Array | None = None
) -> Program:
    """Convert by a Kaiser-windowed sinc in `FILTER_PHASES` phases; equal rates leave every sample as it is."""
    ratio = source_rate_hz / rate_hz
    cutoff = min(1.0, 1 / ratio)
    phase = np.arange(FILTER_PHASES + 1)[:, None] / FILTER_PHASES
    # distance of a sample from the frame, in samples, (phases + 1, taps of both sides)
    place = np.arange(-FILTER_TAPS + 1, FILTER_TAPS + 1)[None] - phase
    window = np.i0(FILTER_BETA * np.sqrt(np.clip(1 - (place / FILTER_TAPS) ** 2, 0, 1))) / np.i0(FILTER_BETA)
    sinc = np.sinc(cutoff * place)
    table = cutoff * np.where(np.abs(sinc) < 1e-15, 0.0, sinc) * window
    values = {"ratio": ratio, "taps": FILTER_TAPS, "phases": FILTER_PHASES}
    memory = packed(RENDERED_PROGRAM, values, np.concatenate([table, table[-1:]]), names=("filter",))

    def start(_displacement_m: Array) -> tuple[Array, Array]:
        return np.zeros(0), np.zeros(0)

    def read(weights: Array) -> tuple[Array, Array]:
        return np.zeros((weights.shape[1], 0)), np.zeros(weights.shape[1])

    return Program(RENDERED, memory, 0, rate_hz, grid_points, start, read, None, ends_s, force)

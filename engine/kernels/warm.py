"""Everything compiled is compiled, or loaded, by using it once: `python -m engine.kernels.warm`.

It takes the better part of a minute where nothing has been compiled yet, and about a second where all is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from engine.kernels import cache, layout
from engine.kernels.mixer import call
from engine.models import StringModel, build_model
from engine.models.base import Physics
from engine.pluck import Pluck
from engine.preset import PresetInfo, TrainedRange
from engine.sine_transform import listening_weights
from engine.sources import TruthSource, project
from engine.string import StringParameters
from engine.voices import Ear, Mixer, Program, Voice, bank_program, plain_program, truth_program

RATE_HZ = 48_000
INFO = PresetInfo(
    title="",
    model="koopman_integrated",
    model_configuration={},
    string=StringParameters(),
    tension_modulated=True,
    initial="pluck",
    rate_hz=16_000,
    modes=4,
    grid_points=16,
    horizon_steps=1,
    scale_m=1e-3,
    trained_range=TrainedRange(None, None, (0.0, 1.0)),
    initialisation="",
    seed=0,
)
LATENTS = {"grid_points": INFO.grid_points, "state_size": 4}
MODULATED = {"modulation": True, "adiabatic": True, "physical_units": True}
BANKS: tuple[dict[str, Any], ...] = ({}, MODULATED)
EARS = (Ear((0.3,)), Ear((0.3, 0.7), "velocity"))
FRAMES = 4 * layout.QUANTUM


def warm() -> None:
    """All that sounds; and, where it has not been compiled yet, all that models and the solver render with."""
    voices()
    if not cache.is_whole():
        models()
        cache.set_whole()


def voices() -> None:
    """A few quanta of every kind of voice; and what a device calls, which is compiled as it is imported."""
    assert call.address
    programs = [bank_program(_model("koopman_integrated", LATENTS | sizes), INFO, RATE_HZ) for sizes in BANKS]
    _sound([program for program in programs if program], lambda p, ear: Voice(p, _initial_m(), ear))
    _sound([truth_program(INFO, RATE_HZ)], lambda p, ear: Voice(p, _initial_m(), ear))
    silence = np.zeros((FRAMES, 1), np.float32)
    _sound([plain_program(RATE_HZ)], lambda p, _ear: Voice.of_samples(p, silence))


def models() -> None:
    """A few frames of every model that has compiled parts, and of the solver."""
    readout = listening_weights(torch.tensor([0.3]), INFO.grid_points).float()
    with torch.inference_mode():
        for name, sizes in (
            ("koopman_integrated", LATENTS),
            ("s5", {"grid_points": INFO.grid_points}),
            ("fgru", {"grid_points": INFO.grid_points}),
            ("frnn", {"grid_points": INFO.grid_points}),
        ):
            model = _model(name, sizes)
            _, state = model.advance(model.release((_initial_m()[None] / INFO.scale_m).float()), 2)
            model.advance(state, 2, readout)
    truth = TruthSource(INFO)
    truth.advance(truth.start(_initial_m()[None]), 2)


def _sound(programs: list[Program], strike: Callable[[Program, Ear], Voice]) -> None:
    for program in programs:
        for ear in EARS:
            mixer, voice = Mixer(RATE_HZ), strike(program, ear)
            voice.skip(layout.QUANTUM / RATE_HZ, Mixer(RATE_HZ).memory)
            mixer.add(voice)
            mixer.render(FRAMES)


def _model(name: str, sizes: dict[str, Any]) -> StringModel[Any]:
    model = build_model(name, sizes)
    physics = Physics(INFO.string, INFO.modes, INFO.rate_hz)
    model.initialise(model.initialisations[0], physics, torch.Generator().manual_seed(0))
    return model.eval()


def _initial_m() -> torch.Tensor:
    return project(Pluck().displacement(INFO.grid_points), INFO.modes)


if __name__ == "__main__":
    warm()

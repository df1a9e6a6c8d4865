"""The preparation of compiled code by using it once: it is compiled, or loaded. Run `python -m engine.warm`.

It takes a minute where nothing has been compiled yet, and about a second where all is kept.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from engine.effects import Body, Effects, Impulse
from engine.effects.body import curves_of
from engine.kernels import cache
from engine.kernels.constants import QUANTUM
from engine.models._tension_law import CURVES
from engine.pluck import Pluck
from engine.presets import Preset, PresetInfo, TrainedRange
from engine.resonators.sine_transform import listening_weights, project
from engine.values.drum import DrumParameters
from engine.values.ear import Ear
from engine.values.effects import Room
from engine.values.string import StringParameters
from engine.voices import CompiledPlayer, Mixer, Voice, model_program, plain_program, truth_program

if TYPE_CHECKING:
    from engine.models.base import StringModel

RATE_HZ = 48_000
INFO = PresetInfo(
    title="",
    model="koopman_tension",
    model_configuration={"grid_points": 16, "modes": 4, "degree": 0},
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
INITIAL_M = project(Pluck().displacement(INFO.grid_points), INFO.modes)
PRESET = Preset("", Path(), INFO, dict.fromkeys(CURVES, np.zeros(1)))
LATENTS = {"grid_points": INFO.grid_points, "state_size": 4}
BANKS: tuple[dict[str, Any], ...] = ({}, {"adiabatic": True})
EARS = (Ear((0.3,)), Ear((0.3, 0.7), "velocity"))
FRAMES = 4 * QUANTUM


def warm() -> None:
    """Load what a pluck needs at once; where not all has been compiled yet, compile all."""
    if cache.is_whole():
        _sound(Voice(model_program(PRESET, RATE_HZ), INITIAL_M, EARS[0]))
    else:
        for compile_part in (voices, models, responses, _drum, _loudness):
            compile_part()
        cache.set_whole()


def voices() -> None:
    """Compile all sound by a few quanta of every kind of voice, unheard and heard, and by a player."""
    player, mixer = CompiledPlayer(RATE_HZ, INFO.modes), Mixer(RATE_HZ)
    player.catch_up(mixer.address)
    for voice in _each():
        mixer.skip(voice, QUANTUM / RATE_HZ)
        _sound(voice)
    _sound(Voice.of_samples(plain_program(RATE_HZ), np.zeros((FRAMES, 1), np.float32)))


def responses() -> None:
    """Compile the responses of bodies of either kind and of a room, and what a body does to loudness."""
    impulse = Impulse(np.ones((1, 1)), RATE_HZ)
    for body in (Body(), Body(impulse=impulse)):
        Mixer(RATE_HZ).set_effects(Effects(body, Room(0.2, 0.8)))
        curves_of(body)


def _each() -> Iterator[Voice]:
    """A voice of each kind that is computed as it sounds, by each of the pick-ups."""
    from engine.voices.banks import bank_program

    banks = [bank_program(_model("koopman_integrated", LATENTS | sizes), INFO, RATE_HZ) for sizes in BANKS]
    for program in (*filter(None, banks), model_program(PRESET, RATE_HZ), truth_program(INFO, RATE_HZ)):
        for ear in EARS:
            yield Voice(program, INITIAL_M, ear)


def models() -> None:
    """A few frames of every model that has compiled parts, and of the solver."""
    import torch

    from engine.sources import TruthSource

    readout = torch.from_numpy(listening_weights(np.array([0.3]), INFO.grid_points)).float()
    with torch.inference_mode():
        grid = {"grid_points": INFO.grid_points}
        for name, sizes in ((INFO.model, INFO.model_configuration), ("s5", grid), ("fgru", grid), ("frnn", grid)):
            model = _model(name, sizes)
            _, state = model.advance(model.encode(torch.from_numpy(INITIAL_M[None] / INFO.scale_m).float()), 2)
            model.advance(state, 2, readout)
    truth = TruthSource(INFO)
    truth.advance(truth.start(INITIAL_M[None]), 2)


def _drum() -> None:
    """Compile what makes modes of a drum, and a picture of it."""
    from engine.kernels import drum_modes
    from engine.kernels.records import DRUM_ROWS
    from engine.resonators.drum import modes_of, numbers_of, tune
    from engine.resonators.surface import tools

    drum = tune(DrumParameters(air_kg_m3=1.2), 1.1, 400)
    modes, blow = modes_of(drum, 400), np.append(numbers_of(drum), np.zeros(drum_modes.DRUM - drum_modes.X))
    modes.struck((0.0, 0.0), 0.01)
    modes.radiated((0.0, 0.0))
    modes.resonator(np.zeros((1, 2)))
    block = np.zeros(drum_modes.HEADER + DRUM_ROWS * len(modes))
    drum_modes.write(blow, modes.rows, np.zeros(1), tools(), block.ctypes.data, len(modes))


def _loudness() -> None:
    """Compile the loudness of a sound, by one of one mode."""
    from engine.kernels import constants, loudness

    sound, no_body = np.ones(constants.SOUND_ROWS), np.zeros(0)
    no_body.setflags(write=False)  # as curves are
    loudness.gain(sound, 1, 1, no_body, 0.0)
    loudness.limit(loudness.peak(sound, 1, False, no_body, 0.0, 0.0))
    loudness.looked_at(0, 1, 0)


def _sound(voice: Voice) -> None:
    """Render a few quanta of a voice, so that what it needs is compiled."""
    mixer = Mixer(RATE_HZ)
    mixer.add(voice)
    mixer.render(FRAMES)


def _model(name: str, sizes: dict[str, Any]) -> StringModel[Any]:
    """A model of these sizes at its own start, in evaluation mode."""
    import torch

    from engine.models import build_model
    from engine.models.base import Physics

    model = build_model(name, sizes)
    physics = Physics(INFO.resonator, INFO.rate_hz)
    model.initialise(model.own_initialisation(), physics, torch.Generator().manual_seed(0))
    return model.eval()


if __name__ == "__main__":
    gc.disable()  # collections took a fifth of the time
    warm()

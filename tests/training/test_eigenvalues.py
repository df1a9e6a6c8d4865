from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch

from engine.models import build_model
from engine.models.base import Physics
from engine.presets import Preset, PresetInfo, TrainedRange
from engine.resonators.string import resonator_of
from engine.schema import write
from training.configuration import DatasetConfiguration, Recipe, TrainingConfiguration

HORIZON = 40
SIZES: dict[str, dict[str, Any]] = {
    "dmd": {"rank": 12},
    "koopman": {"state_size": 6, "encoder_widths": [32], "decoder_widths": [32]},
    "koopman_var": {"state_size": 8, "multiplier_widths": [4]},
    "koopman_integrated": {"state_size": 5, "encoder_widths": [], "eigenvalue_widths": [4]},
    "lru": {"state_size": 6, "layers": 1},
    "s5": {"state_size": 12, "hippo_blocks": 2, "layers": 1},
    "frnn": {},
}


def preset(model: str = "koopman_var", name: str = "", horizon: int = HORIZON, **data: Any) -> Preset:
    """A preset that has not been trained, with what one says of its training."""
    fields: dict[str, Any] = {"initial": "gaussian", "rate_hz": 4000, "modes": 5, "steps": 50, "count": 30} | data
    c = DatasetConfiguration(**fields)
    built = build_model(model, SIZES[model])
    how = "physics" if "physics" in built.initialisations else built.own_initialisation()
    built.initialise(how, Physics(resonator_of(c.string, c.modes), c.rate_hz, 1e-3), torch.Generator().manual_seed(0))
    training = TrainingConfiguration("Tiny", model, c, Recipe(1), model_configuration=SIZES[model])
    info = PresetInfo(
        title="Tiny",
        model=model,
        model_configuration=write(built.configuration),
        string=c.string,
        tension_modulated=c.tension_modulated,
        initial=c.initial,
        rate_hz=c.rate_hz,
        modes=c.modes,
        grid_points=c.grid_points,
        horizon_steps=horizon,
        scale_m=1e-3,
        trained_range=TrainedRange(None, None, (1e-3, 1e-2)),
        initialisation=how,
        seed=0,
        training=write(training),
    )
    weights = {key: tensor.numpy() for key, tensor in built.state_dict().items()}
    return Preset(name or f"tiny_{model}", Path(f"{name or model}.safetensors"), info, weights)


@pytest.mark.parametrize(
    ("model", "layers"), [("dmd", 1), ("koopman", 1), ("koopman_integrated", 1), ("lru", 2), ("s5", 2)]
)
def test_every_model_with_linear_dynamics_has_eigenvalues(model: str, layers: int) -> None:
    one = preset(model)
    found = one.model.log_eigenvalues()
    assert [log.dtype for log in found] == [torch.complex128] * layers
    linear = torch.from_numpy(resonator_of(one.info.string, 5).eigenvalues() / 4000)
    nearest = (found[0].exp()[:, None] - linear.exp()).abs().amin(0)
    assert float(nearest.max()) < 1e-5  # all of them started from the string's

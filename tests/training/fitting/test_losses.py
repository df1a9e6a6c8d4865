"""The terms of the Koopman loss, written out."""

from dataclasses import replace
from typing import Any

import pytest
import torch

from engine.models import build_model
from engine.models.base import Physics
from engine.models.configurations import KoopmanVarConfiguration
from engine.models.koopman_var import KoopmanVar
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters
from training.configuration import Recipe
from training.data.batches import Batch
from training.fitting import losses
from training.fitting.losses import training_loss

RECIPE = Recipe(epochs=1, consistency_weight=0.3)


def model_and_batch() -> tuple[KoopmanVar, Batch]:
    model = KoopmanVar(KoopmanVarConfiguration(101, 6, (5,))).double()
    model.initialise("paper", Physics(resonator_of(StringParameters(), 6), 4_000), torch.Generator().manual_seed(1))
    draw = torch.Generator().manual_seed(2)
    frames = torch.tensor([1, 3, 4])
    target = torch.randn(2, 3, 101, generator=draw, dtype=torch.float64)
    return model, Batch(torch.randn(2, 101, generator=draw, dtype=torch.float64), frames, target)


def test_the_published_loss_is_the_scripts_sum_of_means() -> None:
    """Written out with real numbers, as `lindyn_loss` of rodrigodzf/physmodjax takes its means."""
    model, batch = model_and_batch()
    recipe = Recipe(epochs=1, koopman_terms="published", consistency_weight=0.005)
    loss, prediction = training_loss(model, batch, recipe)

    frames = torch.cat([batch.initial[:, None], batch.target], dim=1)
    encoded = model.encoder(frames)  # real parts first
    eigenvalues = torch.exp(torch.complex(-model.nu_log.exp(), model.theta_log.exp()))
    origin = torch.complex(*encoded[:, 0].chunk(2, dim=-1))
    latents = torch.stack([origin * eigenvalues**k for k in (1, 3, 4)], dim=1)
    factor = torch.complex(*model.multiplier(latents.abs().square()).chunk(2, dim=-1))
    states = torch.cat([(latents * factor).real, (latents * factor).imag], dim=-1)
    predicted = mean_square(model.decoder(states) - batch.target)
    reconstruction = mean_square(model.decoder(encoded) - frames)
    linear_dynamics = mean_square(states - encoded[:, 1:])
    assert float(prediction) == pytest.approx(predicted, rel=1e-9)
    assert float(loss.detach()) == pytest.approx(predicted + reconstruction + 0.01 * linear_dynamics, rel=1e-9)


def mean_square(values: torch.Tensor) -> float:
    return float(values.detach().square().mean())


def test_the_loss_is_the_weighted_sum_of_its_terms() -> None:
    model, batch = model_and_batch()
    loss, prediction = training_loss(model, batch, RECIPE)

    eigenvalues = torch.exp(torch.complex(-model.nu_log.exp(), model.theta_log.exp()))
    origin = model.encode(batch.initial).origin
    latents = torch.stack([origin * eigenvalues**k for k in (1, 3, 4)], dim=1)

    def multiplied(z: torch.Tensor) -> torch.Tensor:
        real, imaginary = model.multiplier(z.abs().square()).chunk(2, dim=-1)
        return z * torch.complex(real, imaginary)

    def decoded(z: torch.Tensor) -> torch.Tensor:
        return model.decoder(torch.cat([z.real, z.imag], dim=-1))

    wanted = mean_square(decoded(multiplied(latents)) - batch.target)
    assert float(prediction) == pytest.approx(wanted, rel=1e-9)
    encoded = model.encode(batch.target.flatten(0, 1)).origin.unflatten(0, (2, 3))
    encoding = mean_square(decoded(multiplied(origin)) - batch.initial)
    consistency = float((encoded - latents).detach().abs().square().mean())
    assert float(loss.detach()) == pytest.approx(wanted + encoding + 0.3 * consistency, rel=1e-9)


def test_frames_that_were_drawn_twice_are_compared_with_themselves() -> None:
    """As many frames as the last one's number need not be all of them."""
    model = build_model("lru", {"layers": 0, "state_size": 4})
    model.initialise("paper", Physics(resonator_of(StringParameters(), 6), 4_000), torch.Generator().manual_seed(1))
    model.eval()
    initial, frames = torch.randn(2, 101, generator=torch.Generator().manual_seed(2)), torch.tensor([1, 3, 3, 4])
    whole = model(initial, 4).detach()
    _, prediction = training_loss(model, Batch(initial, frames, whole[:, frames - 1]), RECIPE)
    assert float(prediction) < 1e-12
    assert float(training_loss(model, Batch(initial, frames, whole), RECIPE)[1]) > 1e-9


@pytest.mark.parametrize("terms", ["text", "published"])
@pytest.mark.parametrize("name", ["koopman", "koopman_var", "koopman_integrated"])
def test_parts_of_a_batch_have_its_gradients_and_error(
    name: str, terms: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = build_model(name, {"grid_points": 101}).double()
    physics = Physics(resonator_of(StringParameters(), 6), 4_000)
    model.initialise(model.own_initialisation(), physics, torch.Generator().manual_seed(1))
    target = torch.randn(7, 4, 101, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    batch = Batch(target[:, 0], torch.tensor([1, 3, 4]), target[:, 1:])
    recipe = replace(RECIPE, koopman_terms=terms)

    def gradients(frames_at_once: int) -> tuple[list[torch.Tensor], float]:
        monkeypatch.setattr(losses, "FRAMES_AT_ONCE", frames_at_once)
        model.zero_grad()
        error = losses.backward(model, batch, recipe)
        return [p.grad.clone() for p in model.parameters() if p.grad is not None], float(error)

    (whole, error), (parts, same) = gradients(1000), gradients(6)
    assert same == pytest.approx(error, rel=1e-12)
    assert len(parts) == len(whole) > 4
    for own, all_at_once in zip(parts, whole, strict=True):
        torch.testing.assert_close(own, all_at_once, rtol=1e-9, atol=1e-12)

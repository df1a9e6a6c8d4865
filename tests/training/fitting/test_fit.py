import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
import torch

from engine.compare.relative import RelativeError
from tests.training.conftest import DATA, fit
from training.cell import Cell, configuration_of
from training.configuration import Recipe, Run, TrainingConfiguration
from training.data.batches import Batch
from training.evaluate import evaluate_model
from training.fitting import fit as module
from training.fitting.checkpoint import Checkpoint
from training.fitting.fit import Diverged, FitProgress, fit_seeds, horizon_at, learning_rate_at
from training.fitting.losses import training_loss
from training.fitting.start import new_model

QUICK = {"epochs": 4, "validate_every": 1, "batch_size": 8, "first_horizon": 20, "steps_per_batch": 16}
SMALL = {
    "koopman": {"state_size": 16, "encoder_widths": [24], "decoder_widths": [24]},
    "koopman_var": {"state_size": 16, "multiplier_widths": [8]},
    "koopman_integrated": {"state_size": 5, "encoder_widths": [], "eigenvalue_widths": [8]},
    "lru": {"state_size": 8, "layers": 1},
    "s5": {"state_size": 16, "layers": 1, "hippo_blocks": 2},
    "fgru": {"width": 20},
    "frnn": {"width": 8},
}

SLOW = ("fgru", "frnn")  # they take every frame one after the other


def small(model: str, recipe: str = "ours", horizon: int = 40, **changes: Any) -> TrainingConfiguration:
    cell = Cell(model, True, "gaussian", 4000, horizon, recipe)
    by_hand = {"start": "paper"} if model in SLOW and recipe == "ours" else {}
    configuration = configuration_of(cell, DATA, {**QUICK, **by_hand, **changes})
    return replace(configuration, model_configuration=SMALL.get(model, {}))


def named(configurations: Sequence[TrainingConfiguration]) -> list[Run]:
    return [Run(str(number), "", configuration) for number, configuration in enumerate(configurations)]


def weights(folder: Path) -> dict[str, torch.Tensor]:
    return dict(Checkpoint.load(folder / "checkpoint.safetensors").model)


LEARNING = {"ours": "koopman koopman_integrated fgru", "paper": "koopman_var s5", "published": "koopman lru frnn"}


@pytest.mark.parametrize(
    ("model", "recipe"), [(model, name) for name in LEARNING for model in LEARNING[name].split()]
)
def test_every_model_learns(small_dataset, runs, model, recipe, monkeypatch):
    monkeypatch.setattr("training.fitting.pursuit.POLISH_ITERATIONS", 10)
    seen: list[FitProgress] = []
    horizon = 12 if model in SLOW else 40
    configuration = small(model, recipe, horizon, epochs=4, patience=0, first_horizon=horizon // 2)
    found = fit(configuration, small_dataset, runs, report=seen.append)
    seen = [p for p in seen if p.ends_epoch]  # a slow machine reports more
    assert [p.epoch for p in seen] == [1, 2, 3, 4]
    assert seen[-1].loss < seen[0].loss or seen[-1].horizon > seen[0].horizon
    starts = [found.start] if found.start else []  # FRNN may run away before it is trained
    assert found.validation.total().rel_mae == min(e.rel_mae for e in (*starts, *(p.validation for p in seen)) if e)


def test_the_bound_of_the_gradient_can_leave_the_eigenvalues_out(small_dataset, runs):
    """The first moments of one step with a tiny bound: those of nu_log and theta_log alone are not scaled down."""
    largest = {}
    for bounded in (True, False):
        folder, changes = runs / str(bounded), {"clip_norm": 1e-9, "clip_eigenvalues": bounded, "patience": 0}
        fit(small("koopman", "published", epochs=1, batch_size=16, **changes), small_dataset, folder)
        saved = Checkpoint.load(folder / "checkpoint.safetensors").optimiser
        largest[bounded] = [float(moments["exp_avg"].abs().max()) for moments in saved.values()]
    assert max(largest[True]) < 1e-9
    assert sum(moment > 1e-8 for moment in largest[False]) == 2


def test_training_that_only_harms_leaves_the_start(small_dataset, runs):
    """The start is epoch 0: a result is never worse."""
    configuration = small("koopman_integrated", epochs=2, peak_learning_rate=1.0, start="averaging")
    seen: list[FitProgress] = []
    found = fit(configuration, small_dataset, runs, report=seen.append)
    assert found.start is not None
    assert all(p.validation is None or p.validation.rel_mae > found.start.rel_mae for p in seen)
    assert (found.best_epoch, found.validation.total()) == (0, found.start)
    again = evaluate_model(found.model, small_dataset, "validation", 40).total()
    assert again.rel_mae == pytest.approx(found.start.rel_mae, rel=1e-5)


CUTS = [
    ("koopman_var", "ours", {"average_decay": 0.9, "schedule": "constant", "patience": 100}),
    ("lru", "ours", {"optimiser": "soap", "batch_size": 3, "loss": "log10_mse"}),  # refreshes its basis, too
    ("lru", "ours", {"batch_statistics_until": 0.5}),
    ("koopman", "ours", {"latent_epochs": 4, "latent_polish": 2}),  # one of them in the last epoch's midst
    ("koopman", "blind", {"latent_epochs": 2, "latent_polish": 1}),
    ("koopman_integrated", "ours", {}),
    ("koopman_integrated", "blind", {}),
    ("frnn", "ours", {"batch_size": 4, "epochs": 2}),
    ("fgru", "paper", {"batch_size": 4, "epochs": 2}),
]


@pytest.mark.parametrize(("model", "recipe", "changes"), CUTS)
def test_a_run_that_is_cut_anywhere_is_the_whole_run(small_dataset, runs, model, recipe, changes, monkeypatch):
    """Bit for bit: cut within an epoch and at the end of one, and continued from the checkpoint before."""
    monkeypatch.setattr("training.fitting.pursuit.POLISH_ITERATIONS", 10)
    monkeypatch.setattr(module, "TELL_EVERY_S", -1.0)
    configuration = small(model, recipe, 12 if model in SLOW else 40, **changes)
    whole: list[FitProgress] = []
    rest: list[FitProgress] = []
    train = partial(fit, configuration, small_dataset, checkpoint_every_s=-1)
    left = train(runs / "whole", report=whole.append)
    assert [p.step for p in whole] == list(range(1, whole[-1].steps + 1))
    for step in (4, 7):
        with pytest.raises(KeyboardInterrupt):
            train(runs / "cut", report=cut_at(step))
        assert Checkpoint.load(runs / "cut" / "checkpoint.safetensors").facts["step"] == step - 1
    right = train(runs / "cut", report=rest.append)
    assert [p.loss for p in rest] == [p.loss for p in whole[6:]]
    assert (left.validation.total(), left.best_epoch) == (right.validation.total(), right.best_epoch)
    pairs = [(weights(runs / "whole"), weights(runs / "cut")), (left.model.state_dict(), right.model.state_dict())]
    assert all(torch.equal(one[name], other[name]) for one, other in pairs for name in one)
    if "batch_statistics_until" in changes:  # of four epochs of two batches
        assert int(weights(runs / "whole")["layers.0.normalization.num_batches_tracked"]) == 4


def cut_at(step: int) -> Callable[[FitProgress], None]:
    def report(progress: FitProgress) -> None:
        if progress.step == step:
            raise KeyboardInterrupt

    return report


def test_a_checkpoint_of_another_version_or_configuration_is_refused(small_dataset, runs):
    fit(small("koopman_var"), small_dataset, runs)
    with pytest.raises(ValueError, match="was trained with other settings; delete it to start again"):
        fit(small("koopman_var", epochs=5), small_dataset, runs)
    path = runs / "checkpoint.safetensors"
    checkpoint = Checkpoint.load(path)
    facts = {name: value for name, value in checkpoint.facts.items() if name != "step"}
    replace(checkpoint, facts=facts).save(path)
    with pytest.raises(ValueError, match=r"checkpoint.safetensors: of another version .*delete it to start"):
        fit(small("koopman_var"), small_dataset, runs)


def test_what_cannot_be_trained_is_refused_before(small_dataset, runs):
    with pytest.raises(ValueError, match="lower its widths"):
        new_model(replace(small("koopman"), model_configuration={"encoder_widths": [4096, 4096]}), 1.0)
    with pytest.raises(ValueError, match="differ in their seeds alone"):
        fit_seeds(named([small("koopman", epochs=n) for n in (2, 3)]), small_dataset, runs)


def test_early_stopping_begins_with_a_prediction_and_ends_when_nothing_gets_better(small_dataset, runs, monkeypatch):
    """Not while Koopman's encoder learns the fitted latents."""
    found = fit(
        small("koopman", epochs=8, latent_epochs=5, latent_polish=1, patience=3), small_dataset, runs / "late"
    )
    assert found.epochs >= 5 and math.isfinite(found.validation.total().rel_mae)
    monkeypatch.setattr(module, "learning_rate_at", lambda recipe, share: 0.0)
    seen: list[FitProgress] = []
    found = fit(small("koopman_var", epochs=50, patience=3), small_dataset, runs, report=seen.append)
    assert (found.best_epoch, found.epochs, len(seen)) == (0, 3, 3)
    again = fit(small("koopman_var", epochs=50, patience=3), small_dataset, runs, report=seen.append)
    assert len(seen) == 3 and again.epochs == 3  # a run that has ended stays ended


def test_the_mean_of_the_weights_is_what_is_kept_and_a_coupling_without_a_rate_stays(small_dataset, runs):
    found = fit(small("koopman_var", average_decay=0.99), small_dataset, runs)
    assert not torch.equal(found.model.state_dict()["decoder.weight"], weights(runs)["decoder.weight"])
    start = new_model(small("koopman_integrated"), small_dataset.scale_m)
    for rate in (0.0, 1.0):
        found = fit(small("koopman_integrated", coupling_rate=rate), small_dataset, runs / str(rate))
        assert torch.equal(found.model.K, start.K) == (rate == 0)


def test_a_loss_or_an_error_that_is_no_number_is_a_divergence(small_dataset, runs, monkeypatch):
    with pytest.raises(Diverged, match=r"the loss is nan in epoch \d; lower peak_learning_rate"):
        fit(small("frnn", peak_learning_rate=1e30, clip_norm=1e30), small_dataset, runs / "frnn")
    overflowing = SimpleNamespace(total=lambda: RelativeError(math.inf, 1e10))
    monkeypatch.setattr(module, "evaluate_model", lambda *asked: overflowing)
    for model, words in (("koopman_var", "the validation error was never a number"), ("dmd", "beyond all numbers")):
        with pytest.raises(Diverged, match=words):
            fit(small(model), small_dataset, runs / model)


def test_learning_rate_and_horizon_follow_the_recipe():
    cycle = Recipe(epochs=1, peak_learning_rate=1.0, start_share=0.1, warm_up=0.25)
    rates = [learning_rate_at(cycle, share) for share in (0, 0.125, 0.25, 0.625, 1)]
    assert rates == pytest.approx([0.1, 0.55, 1, 0.5, 0])
    assert learning_rate_at(Recipe(epochs=1, schedule="constant", peak_learning_rate=3e-3), 0.9) == 3e-3
    recipe = Recipe(epochs=1, first_horizon=100, grow_until=0.5)
    assert [horizon_at(recipe, share, 1600) for share in (0, 0.125, 0.25, 0.5, 0.9)] == [100, 200, 400, 1600, 1600]


class Shifted(torch.nn.Module):
    """A "model" whose every frame is the initial one plus one."""

    def encode(self, displacement: torch.Tensor, second: torch.Tensor | None = None) -> torch.Tensor:
        return displacement

    def advance(self, state: torch.Tensor, steps: int) -> tuple[torch.Tensor, torch.Tensor]:
        return (state + 1)[:, None].expand(-1, steps, -1), state


@pytest.mark.parametrize(
    ("kind", "targets", "expected"),
    [
        ("mse", (3.0, 3.0), 4.0),
        ("log10_mse", (3.0, 3.0), math.log10(4)),
        ("relative_mse", (4.0, 0.01), (0.75**2 + 99**2) / 2),  # soft strings count as loud ones
    ],
)
def test_the_loss_of_a_model_without_latents_is_its_prediction_alone(kind, targets, expected):
    target = torch.stack([torch.full((2, 3), value) for value in targets])
    batch = Batch(torch.zeros(2, 3), torch.tensor([1, 4]), target)  # the model says 1
    loss, error = training_loss(Shifted(), batch, Recipe(epochs=1, loss=kind))
    assert float(loss) == pytest.approx(expected)
    assert float(error) == pytest.approx(sum((value - 1) ** 2 for value in targets) / 2)


@pytest.fixture
def mapped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seeds take one pass here, too, as on a GPU."""
    monkeypatch.setattr(module.together, "MAPPED_ON", ("cpu",))


RECIPES = {"koopman_var": "paper", "s5": "published", "frnn": "published"}  # others: ours


@pytest.mark.parametrize("model", SMALL)
@pytest.mark.usefixtures("mapped")
def test_a_seed_trained_with_others_is_the_seed_alone(small_dataset, runs, model, monkeypatch):
    """Adam's first steps would make much of the rounding of gradients near zero, as after a start from physics."""
    recipe = RECIPES.get(model, "ours")
    horizon, epochs = (12, 4) if model in SLOW else (40, 10)
    changes = {"epochs": epochs, "validate_every": 10, "peak_learning_rate": 1e-4}
    if recipe == "published":
        changes["steps_per_batch"] = 0  # the same frames for all
    if (model, recipe) == ("koopman", "ours"):
        changes |= {"latent_epochs": 5, "latent_polish": 1}
    seeds = named([small(model, recipe, horizon, seed=seed, **changes) for seed in range(2)])
    counted = Mock(wraps=module.together.backward)
    monkeypatch.setattr(module.together, "backward", counted)
    losses: list[float] = []
    follow = lambda run, progress: losses.append(progress.loss) if progress.ends_epoch else None  # noqa: E731
    for seed in seeds:
        fit_seeds([seed], small_dataset, runs / "alone", report=follow)
    counted.assert_not_called()
    fit_seeds(seeds, small_dataset, runs / "together", report=follow)
    alone, found = torch.tensor(losses).view(2, -1)
    torch.testing.assert_close(found.view(epochs, 2).T, alone.view(2, epochs), rtol=1e-5, atol=0)
    assert counted.call_count == 2 * epochs or model != "s5"


@pytest.mark.usefixtures("mapped")
def test_seeds_that_were_cut_apart_end_as_the_whole(small_dataset, runs):
    """One seed is a checkpoint ahead: the other catches up, and both end as without the cut, to rounding."""
    configurations = [small("koopman", "paper", seed=n) for n in range(2)]
    ahead = runs / "cut" / "0"
    with pytest.raises(KeyboardInterrupt):
        fit(configurations[0], small_dataset, ahead, report=cut_at(4), checkpoint_every_s=-1)
    for way in ("whole", "cut"):
        fit_seeds(named(configurations), small_dataset, runs / way)
    for n in range(2):
        whole, cut = (weights(runs / way / str(n)) for way in ("whole", "cut"))
        for name, weight in whole.items():
            torch.testing.assert_close(cut[name], weight, rtol=1e-4, atol=1e-6)


def test_a_seed_that_diverges_leaves_the_others(small_dataset, runs, monkeypatch):
    backward, first = module.backward, []

    def broken(model: Any, *rest: Any) -> torch.Tensor:
        first.append(model)
        return backward(model, *rest) * (math.inf if model is first[0] else 1)

    monkeypatch.setattr(module, "backward", broken)
    broke, well = fit_seeds(named([small("koopman_var", seed=n) for n in range(2)]), small_dataset, runs)
    assert isinstance(broke, Diverged) and well.epochs == 4

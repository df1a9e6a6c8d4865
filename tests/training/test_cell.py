from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import pytest

from engine.models import MODELS, OF_MANY_STRINGS
from engine.models.configurations import LRUConfiguration
from engine.schema import SchemaError
from training.cell import Case, Cell, configuration_of, load, recipe_names
from training.fitting.fit import learning_rate_at
from training.start import starts_of

OF_CELLS = sorted(MODELS.keys() - OF_MANY_STRINGS)

EVERY_CELL = [
    Cell(model, nonlinear, initial, rate_hz, horizon, recipe, seed)
    for model, nonlinear, initial, rate_hz, horizon, recipe, seed in itertools.product(
        OF_CELLS, (False, True), ("gaussian", "noise"), (4000, 16000), (400, 4000), ("ours", "paper"), (0, 3)
    )
]


def test_a_name_is_its_cell() -> None:
    assert len({cell.name for cell in EVERY_CELL}) == len(EVERY_CELL)
    assert len({cell.title for cell in EVERY_CELL}) == len(EVERY_CELL)
    assert all(Cell.parse(cell.name) == cell for cell in EVERY_CELL)


def test_every_cell_of_the_tables_can_be_built() -> None:
    digests = set()
    for cell in EVERY_CELL:
        configuration = load(cell.name)
        assert configuration.steps == cell.horizon
        assert configuration.data.modes == {4000: 10, 16000: 25}[cell.rate_hz]
        assert configuration.data.tension_modulated == cell.tension_modulated
        assert configuration.recipe.seed == cell.seed
        digests.add(configuration.digest)
    assert len(digests) == len(EVERY_CELL)


@pytest.mark.parametrize("model", OF_CELLS)
@pytest.mark.parametrize("recipe", ["ours", "paper", "published"])
def test_a_recipe_starts_as_its_model_can(model: str, recipe: str) -> None:
    configuration = configuration_of(Cell(model, True, "noise", 16000, recipe=recipe))
    assert configuration.recipe.start in ("", *starts_of(model))


def test_the_papers_recipe_is_the_papers() -> None:
    koopman = configuration_of(Cell("koopman", True, "noise", 4000, 400, "paper")).recipe
    assert (koopman.epochs, koopman.schedule, koopman.peak_learning_rate) == (2500, "constant", 0.003)
    assert koopman.consistency_weight == 0.01
    assert (koopman.steps_per_batch, koopman.flip, koopman.start) == (0, False, "")
    assert koopman.patience > 0
    fgru = configuration_of(Cell("fgru", True, "noise", 4000, 400, "paper")).recipe
    assert (fgru.epochs, fgru.schedule, fgru.loss, fgru.batch_size) == (2000, "one_cycle", "log10_mse", 256)
    assert (fgru.peak_learning_rate, fgru.peak_learning_rate * fgru.start_share) == pytest.approx((1e-3, 1e-4))


def test_the_published_recipe_is_the_scripts() -> None:
    """The table of differences between the paper's text and its script, in docs/reproduce.md."""
    recipes = {
        model: configuration_of(Cell(model, True, "noise", 4000, 400, "published")).recipe
        for model in ("koopman", "koopman_var", "lru", "s5")
    }
    for recipe in recipes.values():
        assert (recipe.epochs, recipe.batch_size, recipe.peak_learning_rate) == (2500, 50, 0.001)
        assert (recipe.steps_per_batch, recipe.flip, recipe.patience, recipe.start) == (0, False, 0, "")
        assert (recipe.fixed_batches, recipe.validate_every, recipe.clip_norm) == (True, 50, 1.0)
        assert [learning_rate_at(recipe, share) for share in (0, 0.5, 1)] == pytest.approx([1e-3, 5e-4, 0])
    assert {recipes[model].koopman_terms for model in ("koopman", "koopman_var")} == {"published"}
    slow = {name: (set(r.slow_parameters), r.eigenvalue_rate, r.clip_eigenvalues) for name, r in recipes.items()}
    assert slow["lru"] == ({"nu_log", "theta_log", "gamma_log", "B", "C"}, 0.25, False)
    assert slow["koopman"] == slow["koopman_var"] == ({"nu_log", "theta_log", "gamma_log"}, 0.25, False)
    assert slow["s5"] == (set(), 1.0, True)


def test_a_digest_is_for_good() -> None:
    """Rows are known by it: where this fails, a default has changed; leave it."""
    cells = [
        Cell("koopman_var", True, "noise", 4000, 400, "paper"),
        Cell("koopman_integrated", False, "noise", 16000),
    ]
    assert [configuration_of(cell).digest for cell in cells] == ["68b69a9cfa060660", "570c5b253699d762"]


def test_a_digest_covers_what_a_model_has_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    found = configuration_of(Cell("lru", True, "noise", 4000))
    assert replace(found, model_configuration={"state_size": 128}).digest == found.digest
    digest = found.digest

    @dataclass(frozen=True)
    class Larger(LRUConfiguration):
        state_size: int = 256

    monkeypatch.setitem(MODELS, "lru", ("lru.LRU", Larger))
    assert found.digest != digest


def test_titles_do_not_enter_the_digest_but_the_seed_does() -> None:
    one, other = (configuration_of(Cell("lru", True, "noise", 4000, seed=seed)) for seed in (0, 1))
    assert one.digest != other.digest
    same = configuration_of(Cell("lru", True, "noise", 4000), {"count": 1000})
    assert same.digest == one.digest


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nylon_nonlinear_noise_16k_foo", "model 'foo' is not one of dmd, koopman"),
        ("nylon_nonlinear_noise_8k_lru", "rate_hz must be one of 4000, 16000"),
        (
            "nylon_nonlinear_noise_4k_lru_400_theirs",
            "recipe 'theirs' is not one of blind, hinted, ours, paper, published",
        ),
        ("nylon_nonlinear_noise_4k_lru_0", "horizon must be at least 1"),
        ("no_such_thing", "no training configuration 'no_such_thing'"),
    ],
)
def test_a_name_that_is_no_cell_is_reported(name: str, words: str) -> None:
    with pytest.raises(SchemaError, match=words):
        load(name)


@pytest.mark.parametrize(
    ("data", "recipe", "words"),
    [
        ({"counts": 3}, {}, "data: unknown field 'counts'"),
        ({}, {"epoch": 3}, "unknown field 'epoch'"),
        ({"steps": 100}, {}, r"horizon must lie in 1 … 100, the data's steps, not 4000"),
    ],
)
def test_wrong_overrides_are_reported(data: dict[str, int], recipe: dict[str, int], words: str) -> None:
    with pytest.raises(SchemaError, match=words):
        configuration_of(Cell("koopman", True, "noise", 4000), data, recipe)


def test_a_case_matches_what_it_names() -> None:
    cell = Cell("koopman", True, "noise", 4000)
    assert Case().matches(cell)
    assert Case(model=("lru", "koopman"), rate_hz=(4000,), tension_modulated=True).matches(cell)
    assert not Case(horizon=(400,)).matches(cell)
    assert not Case(tension_modulated=False).matches(cell)
    with pytest.raises(ValueError, match="model 'koop' is not one of"):
        Case(model=("koop",))
    assert recipe_names() == ["blind", "hinted", "ours", "paper", "published"]


def test_a_model_of_many_strings_is_no_cells() -> None:
    with pytest.raises(SchemaError, match="`family train` trains it"):
        Cell.parse("nylon_nonlinear_noise_4k_koopman_tension")

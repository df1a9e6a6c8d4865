import itertools
from dataclasses import dataclass, replace

import pytest

from engine.models import MODELS, OF_MANY_STRINGS
from engine.models.configurations import LRUConfiguration
from engine.schema import SchemaError
from training.cell import Cell, configuration_of, load
from training.start import starts_of

OF_CELLS = sorted(MODELS.keys() - OF_MANY_STRINGS)

EVERY_CELL = [
    Cell(model, nonlinear, initial, rate_hz, horizon, recipe, seed)
    for model, nonlinear, initial, rate_hz, horizon, recipe, seed in itertools.product(
        OF_CELLS, (False, True), ("gaussian", "noise"), (4000, 16000), (400, 4000), ("ours", "paper"), (0, 3)
    )
]


def test_every_cell_of_the_tables_can_be_built_from_its_name():
    assert len({cell.name for cell in EVERY_CELL}) == len({cell.title for cell in EVERY_CELL}) == len(EVERY_CELL)
    assert all(Cell.parse(cell.name) == cell for cell in EVERY_CELL)
    some = EVERY_CELL[::31]  # of every model, string, data set, horizon, recipe and seed
    built = [load(cell.name) for cell in some]
    assert len({configuration.digest for configuration in built}) == len(some)
    for cell, made in zip(some, built, strict=True):
        found = (made.steps, made.data.modes, made.data.tension_modulated, made.recipe.seed)
        assert found == (cell.horizon, {4000: 10, 16000: 25}[cell.rate_hz], cell.tension_modulated, cell.seed)


@pytest.mark.parametrize("model", OF_CELLS)
@pytest.mark.parametrize("recipe", ["ours", "paper", "published"])
def test_a_recipe_starts_as_its_model_can(model, recipe):
    configuration = configuration_of(Cell(model, True, "noise", 16000, recipe=recipe))
    assert configuration.recipe.start in ("", *starts_of(model))


DIGESTS = {
    Cell("koopman_var", True, "noise", 4000, 400, "paper"): "68b69a9cfa060660",
    Cell("koopman_integrated", False, "noise", 16000): "570c5b253699d762",
    # the paper's text, and its script: the table of differences is in docs/reproduce.md
    Cell("koopman", True, "noise", 4000, 400, "paper"): "27d19485a3d0f4f5",
    Cell("fgru", True, "noise", 4000, 400, "paper"): "bd67c985ff38a240",
    Cell("koopman", True, "noise", 4000, 400, "published"): "b09499adb7a74972",
    Cell("koopman_var", True, "noise", 4000, 400, "published"): "11bd5426458b30f8",
    Cell("lru", True, "noise", 4000, 400, "published"): "bc3c027e66aba681",
    Cell("s5", True, "noise", 4000, 400, "published"): "e73be9288f224315",
}


@pytest.mark.parametrize("cell", DIGESTS, ids=lambda cell: cell.name)
def test_a_digest_is_for_good(cell):
    """Rows are known by it: where this fails, a default has changed; leave it."""
    assert configuration_of(cell).digest == DIGESTS[cell]


def test_a_digest_covers_what_a_run_has_by_default_and_its_seed_but_no_title(monkeypatch):
    found = configuration_of(Cell("lru", True, "noise", 4000))
    assert replace(found, model_configuration={"state_size": 128}).digest == found.digest
    assert configuration_of(Cell("lru", True, "noise", 4000), {"count": 1000}).digest == found.digest
    assert replace(found, title="other").digest == found.digest
    digest = found.digest

    @dataclass(frozen=True)
    class Larger(LRUConfiguration):
        state_size: int = 256

    monkeypatch.setitem(MODELS, "lru", ("lru.LRU", Larger))
    assert found.digest != digest


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
        ("nylon_nonlinear_noise_4k_koopman_tension", "`family train` trains it"),
    ],
)
def test_a_name_that_is_no_cell_is_reported(name, words):
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
def test_wrong_overrides_are_reported(data, recipe, words):
    with pytest.raises(SchemaError, match=words):
        configuration_of(Cell("koopman", True, "noise", 4000), data, recipe)

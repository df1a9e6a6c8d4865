from collections import Counter
from pathlib import Path

import pytest

from engine.models import MODELS, OF_MANY_STRINGS
from engine.schema import SchemaError
from training.cell import Cell
from training.sweeping.plan import load_plan, plan_names

PLAN = """
description = "Two blocks."

[[block]]
models = ["koopman_var", "dmd"]
strings = ["linear", "nonlinear"]
initials = ["noise"]
rates_hz = [4000]
horizons = [4000, 400]
seeds = [0, 1]

[[block]]
models = ["lru", "dmd"]
strings = ["nonlinear"]
initials = ["noise", "gaussian"]
rates_hz = [4000]
horizons = [400]
recipe = "ours"
"""

BLOCKS = PLAN[PLAN.index("[[block]]") :]
TOO_MANY = f"""[[block]]
models = {["koopman"] * 1000}
strings = ["linear"]
initials = ["gaussian", "noise"]
rates_hz = [4000, 16000]
horizons = [400, 800, 1600, 4000]
seeds = {[*range(1000)]}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "plan.toml"
    file.write_text(PLAN, encoding="utf-8")
    return file


def change(path: Path, old: str, new: str) -> str:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return str(path)


def test_the_order_is_of_value(path):
    """Block, seed, the non-linear string first, the short horizon first, then as named; each run once."""
    plan = load_plan(str(path))
    first = [
        f"{string}_noise_4k_{model}{horizon}{seed}"
        for seed in ("", "_seed1")
        for string in ("nonlinear", "linear")
        for horizon in ("_400", "")
        for model in ("koopman_var", "dmd")
    ]
    second = ["nonlinear_noise_4k_lru_400", "nonlinear_gaussian_4k_lru_400", "nonlinear_gaussian_4k_dmd_400"]
    # dmd on noise is there already
    assert [run.name.removeprefix("nylon_") for run in plan.runs] == first + second
    assert (plan.name, plan.trial) == ("plan", False)
    assert plan.runs[0].configuration.horizon == 400
    assert plan.runs[8].configuration.recipe.seed == 1


def test_a_trial_differs_from_the_cells_that_it_is_named_after(path):
    real = load_plan(str(path))
    trial = load_plan(change(path, "[[block]]", "[data]\ncount = 20\n[recipe_fields]\nepochs = 3\n\n[[block]]"))
    assert trial.trial
    assert [run.name for run in trial.runs] == [run.name for run in real.runs]
    assert not {run.digest for run in trial.runs} & {run.digest for run in real.runs}
    assert {(run.configuration.data.count, run.configuration.recipe.epochs) for run in trial.runs} == {(20, 3)}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"koopman_var"', '"koopmann"', "block[0]: model 'koopmann' is not one of dmd, koopman"),
        ('"noise"', '"plucked"', "block[0].initials[0]: must be 'gaussian' or 'noise', found 'plucked'"),
        ('"linear"', '"curved"', "block[0].strings[0]: must be 'linear' or 'nonlinear', found 'curved'"),
        ("[4000]", "[8000]", "block[0]: rate_hz must be one of 4000, 16000"),
        ("4000, 400]", "0]", "block[0]: horizon must be at least 1 frame"),
        ("4000, 400]", "400_000]", "horizon must lie in 1 … 4000"),
        ("[0, 1]", "[-1]", "block[0]: seed must be at least 0"),
        ("[0, 1]", "[]", "block[0]: seeds is empty"),
        ('recipe = "ours"', 'recipe = "theirs"', "recipe 'theirs' is not one of blind, hinted, ours"),
        ("seeds", "seed", "block[0]: unknown field 'seed'; known are models"),
        ("models =", "model =", "block[0]: unknown field 'model'"),
        ("[[block]]", "[data]\ncuont = 1\n[[block]]", "data: unknown field 'cuont'"),
        ("[[block]]", "[recipe_fields]\nepoch = 1\n[[block]]", "unknown field 'epoch'"),
        ("[[block]]", "[recipe_fields]\nseed = 1\n[[block]]", "recipe_fields cannot set the seed"),
        ("description", "title", "unknown field 'title'"),
        ("[[block]]", "[block", "not valid TOML"),
        (BLOCKS, "block = []", "there is no [[block]]"),
        (BLOCKS, TOO_MANY, "a block of 16000000 cells is too large"),  # before one is made
    ],
)
def test_what_cannot_be_is_reported_with_its_place(path, old, new, message, monkeypatch):
    if new == TOO_MANY:
        monkeypatch.setattr("training.sweeping.plan.Cell", None)
    with pytest.raises(SchemaError) as error:
        load_plan(change(path, old, new))
    assert str(error.value).startswith(str(path))
    assert message in str(error.value)


@pytest.mark.parametrize("name", ["nothing", "nothing.toml"])
def test_a_plan_that_is_not_there_is_reported_with_those_that_are(name):
    with pytest.raises(SchemaError, match=f"no plan '{name}'; give a .toml file or one of: published, tables, tiny"):
        load_plan(name)


def test_committed_plans_are_whole():
    plans = {name: load_plan(name) for name in plan_names()}
    assert plans.keys() == {"published", "tables", "tiny"} and plans["tiny"].trial
    runs = {name: [(run, run.configuration) for run in plan.runs] for name, plan in plans.items()}
    counts = {name: Counter((c.model, c.steps, run.recipe) for run, c in of) for name, of in runs.items()}
    # what the paper is judged by: strings, data sets and five seeds; then long runs and the paper's text
    models = "koopman_var", "koopman", "lru", "s5"
    assert counts["published"] == {(model, 400, "published"): 2 * 4 * 5 for model in models} | {
        ("koopman_var", 4000, "published"): 4 * 3,
        ("koopman_var", 400, "paper"): 4 * 3,
    }
    first = [Cell.parse(run.name) for run, _ in runs["published"][:5]]
    assert first == [Cell("koopman_var", True, "noise", 4000, 400, "published", seed) for seed in range(5)]
    # the paper's: eight data sets, two horizons, five seeds; the Fourier models over 400 frames alone, one DMD
    expected = {(model, n, "paper"): 8 * 5 for model in models for n in (400, 4000)}
    expected |= {(model, 400, "paper"): 8 * 5 for model in ("fgru", "frnn")}
    expected |= {(model, n, "ours"): count for (model, n, _), count in expected.items()}
    for n in (400, 4000):
        expected |= {("dmd", n, "ours"): 8, ("koopman_integrated", n, "ours"): 8 * 5}
    found = counts["tables"]
    blind = {key: found.pop(key) for key in list(found) if key[2] == "blind"}
    assert found == expected and {model for model, *_ in expected} == MODELS.keys() - OF_MANY_STRINGS
    assert sum(blind.values()) == 2 * 8
    # one seed of ours everywhere before two anywhere
    seeds = [c.recipe.seed for run, c in runs["tables"] if run.recipe == "ours"]
    assert seeds.index(1) == seeds.count(0)

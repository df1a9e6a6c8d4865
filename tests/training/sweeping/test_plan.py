from collections import Counter
from pathlib import Path

import pytest

from engine.models import MODELS, OF_MANY_STRINGS
from engine.schema import SchemaError
from training.cell import Cell
from training.sweeping.plan import Plan, load_plan, plan_names
from training.sweeping.processes import fitted

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
    return tmp_path / "plan.toml"


def changed(path: Path, old: str = "", new: str = "") -> Plan:
    assert old in PLAN
    path.write_text(PLAN.replace(old, new, 1), encoding="utf-8")
    return load_plan(str(path))


def test_the_order_is_of_value(path):
    """Block, seed, the non-linear string first, the short horizon first, then as named; each run once."""
    plan = changed(path)
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
    real = changed(path)
    trial = changed(path, "[[block]]", "[data]\ncount = 20\n[recipe_fields]\nepochs = 3\n\n[[block]]")
    assert trial.trial
    assert [run.name for run in trial.runs] == [run.name for run in real.runs]
    assert not {run.digest for run in trial.runs} & {run.digest for run in real.runs}
    assert {(run.configuration.data.count, run.configuration.recipe.epochs) for run in trial.runs} == {(20, 3)}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"koopman_var"', '"koopmann"', "block[0]: model 'koopmann' is not one of dmd, koopman"),
        ('"noise"', '"plucked"', "block[0].initials[0]: must be 'gaussian' or 'noise', found 'plucked'"),
        ("[4000]", "[8000]", "block[0]: rate_hz must be one of 4000, 16000"),
        ("4000, 400]", "0]", "block[0]: horizon must be at least 1 frame"),
        ("4000, 400]", "400_000]", "horizon must lie in 1 … 4000"),
        ("[0, 1]", "[-1]", "block[0]: seed must be at least 0"),
        ("[0, 1]", "[]", "block[0]: seeds is empty"),
        ('recipe = "ours"', 'recipe = "theirs"', "recipe 'theirs' is not one of blind, hinted, ours"),
        ("seeds", "seed", "block[0]: unknown field 'seed'; known are models"),
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
        changed(path, old, new)
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
    assert all(Cell.parse(run.name).name == run.name for of in runs.values() for run, _ in of)
    counts = {name: Counter((run.recipe, c.steps) for run, c in of) for name, of in runs.items()}
    # what the paper is judged by, of four models: strings, data sets and five seeds; then long runs and the text
    assert counts["published"] == {("published", 400): 4 * 2 * 4 * 5, ("published", 4000): 12, ("paper", 400): 12}
    # the paper's: eight data sets, two horizons, five seeds; the Fourier models over 400 frames alone, one DMD
    paper, own = {("paper", 400): 6 * 40, ("paper", 4000): 4 * 40}, {("ours", 400): 7 * 40 + 8, ("ours", 4000): 208}
    assert counts["tables"] == paper | own | {("blind", 400): 8, ("blind", 4000): 8}
    assert {c.model for _, c in runs["tables"]} == MODELS.keys() - OF_MANY_STRINGS
    # one seed of ours everywhere before two anywhere
    seeds = [c.recipe.seed for run, c in runs["tables"] if run.recipe == "ours"]
    assert seeds.index(1) == seeds.count(0)


def set_machine(monkeypatch: pytest.MonkeyPatch, cores: int, memory_bytes: int, gpus: int = 0) -> None:
    sizes = {"SC_PHYS_PAGES": memory_bytes, "SC_PAGE_SIZE": 1}
    monkeypatch.setattr("os.sysconf", sizes.__getitem__, raising=False)
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: set(range(cores)), raising=False)
    monkeypatch.setattr("torch.cuda.is_available", lambda: gpus > 0)
    monkeypatch.setattr("torch.cuda.device_count", lambda: gpus)


@pytest.mark.parametrize(
    ("memory_gib", "tasks", "options", "count"),
    [
        (20, 100, {}, 2),
        (1000, 100, {}, 8),
        (1000, 3, {}, 3),
        (1000, 100, {"threads": 4}, 2),
        (1000, 100, {"threads": 16}, 1),
        (9, 100, {"workers": 20}, 20),
    ],
)
def test_workers_fit_the_machine(monkeypatch, memory_gib, tasks, options, count):
    set_machine(monkeypatch, 8, memory_gib * 2**30)
    found, threads = fitted(tasks, **options), options.get("threads", 1)
    assert (found.device, found.threads, len(found.environments)) == ("cpu", threads, count)
    assert {environment["OMP_NUM_THREADS"] for environment in found.environments} == {str(threads)}
    with pytest.raises(ValueError, match="no CUDA device can be used here"):
        fitted(1, device="cuda")


@pytest.mark.parametrize(("visible", "gpus"), [(None, ["0", "1"]), ("3, MIG-7", ["3", "MIG-7"])])
def test_several_runs_share_a_gpu(monkeypatch, visible, gpus):
    set_machine(monkeypatch, 12, 2**40, gpus=2)
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    if visible:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", visible)

    for tasks, per_device, places in ((100, 1, gpus), (100, 3, gpus * 3), (3, 3, [*gpus, gpus[0]])):
        found = fitted(tasks, per_device=per_device)  # the few are spread
        assert [environment["CUDA_VISIBLE_DEVICES"] for environment in found.environments] == places
    packed = fitted(100, per_device=3)
    assert (packed.device, packed.threads) == ("cuda", 2)
    assert fitted(100, device="cpu").device == "cpu"

"""Steps that a GPU records: which can be, and what becomes of them."""

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode

from engine.models import build_model
from tests.training.conftest import DATA
from tests.training.fitting.test_fit import SMALL
from training.cell import Cell, configuration_of
from training.configuration import Recipe
from training.data.batches import TrainingData
from training.fitting import recorded, together
from training.fitting.fit import Steps, TrainingState, take_step
from training.fitting.losses import backward

CPU, META = torch.device("cpu"), torch.device("meta")
MODELS = ("koopman", "koopman_var", "lru", "s5", "fgru", "frnn")
EVERY = Recipe(epochs=1, steps_per_batch=0, flip=False, koopman_terms="published")
READS = ("local_scalar_dense", "equal", "is_nonzero", "nonzero")  # by the host, which waits for them


class _Apart(TorchDispatchMode):
    """Refuse what a recording cannot hold: a value that the host reads, or one that it sends."""

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        name = func.overloadpacket.__name__.strip("_")
        assert name not in READS, f"{name}: the host reads a value"
        given = [each for each in args if isinstance(each, torch.Tensor)]
        sent = [each for each in given if each.device != META and (each.ndim or name in ("copy", "to_copy"))]
        assert not sent, f"{name}: the host sends a value"
        return func(*args, **(kwargs or {}))


@pytest.mark.parametrize("name", MODELS)
def test_a_step_asks_nothing_of_the_host(name, small_dataset, monkeypatch):
    """On tensors without values, which no host can read."""
    monkeypatch.setattr(together, "MAPPED_ON", ("meta",))
    data = TrainingData(small_dataset, META)
    models = [build_model(name, SMALL[name]).to(META) for _ in range(2)]

    def step() -> None:
        batches = [data.draw(EVERY, torch.zeros(4, dtype=torch.int64, device=META), 8, 0) for _ in models]
        if together.can_be_mapped(models, batches):
            together.backward(models, batches, EVERY)
        for model, batch in zip(models, batches, strict=True):
            backward(model, batch, EVERY)
            torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)

    step()  # which makes the constants that are kept
    with _Apart():
        step()


@pytest.mark.parametrize(
    ("recipe", "changes", "repeats"),
    [
        ("published", {}, True),
        ("paper", {}, True),
        ("ours", {}, False),  # other frames each time
        ("published", {"flip": True}, False),
        ("published", {"batch_size": 5}, False),  # 16 trajectories: the last batch has one
    ],
)
def test_a_step_on_all_frames_of_as_many_strings_repeats_itself(small_dataset, recipe, changes, repeats):
    cell = Cell("koopman_var", True, "gaussian", 4000, 400, recipe)
    made = configuration_of(cell, DATA, {"batch_size": 4, **changes})
    assert TrainingState(made, small_dataset, CPU).repeats_itself is repeats


def test_work_is_done_some_times_then_recorded_and_repeated(monkeypatch):
    """Each call is one time; what the recording itself runs is not a further one."""
    seen: list[str] = []
    stream = SimpleNamespace(wait_stream=lambda other: None)
    graph = SimpleNamespace(replay=lambda: seen.append("repeated"))
    for name in ("Stream", "current_stream"):
        monkeypatch.setattr(torch.cuda, name, lambda: stream)
    monkeypatch.setattr(torch.cuda, "stream", lambda which: nullcontext())
    monkeypatch.setattr(torch.cuda, "CUDAGraph", lambda: graph)
    monkeypatch.setattr(torch.cuda, "graph", lambda which: nullcontext(seen.append("recorded")))
    precision = torch.get_float32_matmul_precision()
    work = recorded.RecordedWork(lambda: seen.append(torch.get_float32_matmul_precision()))
    for _ in range(recorded.BEFORE + 2):
        work()
    assert seen == [recorded.PRECISION] * recorded.BEFORE + ["recorded", recorded.PRECISION, "repeated", "repeated"]
    assert torch.get_float32_matmul_precision() == precision


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no CUDA device")
@pytest.mark.parametrize("name", MODELS)
def test_a_repeated_step_is_the_launched_one(name, small_dataset, monkeypatch):
    monkeypatch.setattr(recorded, "PRECISION", "highest")
    cells = [Cell(name, True, "gaussian", 4000, 20, "paper", seed) for seed in range(2)]
    changes = {"batch_size": 4, "schedule": "one_cycle"}
    made = [configuration_of(cell, DATA, changes) for cell in cells]
    cuda, steps = torch.device("cuda"), Steps()
    repeated, launched = ([TrainingState(each, small_dataset, cuda) for each in made] for _ in range(2))
    for _ in range(11):
        steps.take(repeated)
        for run in launched:
            run.begin_step()
        take_step(launched)
        for run in launched:
            run.end_step()
    for one, other in zip(repeated, launched, strict=True):
        assert one.loss == pytest.approx(other.loss, rel=1e-4)

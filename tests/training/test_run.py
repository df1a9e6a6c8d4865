from dataclasses import replace
from pathlib import Path

import pytest

from engine.compare.relative import RelativeError
from engine.models.base import count_parameters
from engine.presets import load_preset
from tests.training.conftest import DATA
from training.cell import Cell, configuration_of
from training.configuration import DatasetConfiguration, Run, TrainingConfiguration
from training.data.dataset import load_dataset
from training.evaluate import evaluate_model
from training.fitting.fit import FitProgress
from training.fitting.log import Epoch, TrainingLog
from training.results import Row
from training.run import run_rows, trained_range


def progress(epoch: int, loss: float = 1.0) -> FitProgress:
    validation = RelativeError(0.5, 0.25) if epoch % 2 == 0 else None
    return FitProgress(2 * epoch, 18, epoch, 9, 150, 1e-3, loss, validation, 2.0 * epoch, 1.0)


def test_the_log_has_a_line_per_epoch_also_after_an_older_checkpoint(tmp_path):
    path = tmp_path / "run" / "log.csv"
    log = TrainingLog(path)
    for epoch in (1, 2, 3, 4):
        log.add(progress(epoch))
    lines = path.read_text(encoding="utf-8").splitlines()[:3]
    assert lines == [",".join(Epoch.__dataclass_fields__), "1,150,0.001,1.0,,,2.0", "2,150,0.001,1.0,0.5,0.25,4.0"]
    with path.open("a", encoding="utf-8") as file:
        file.write("5,150,0.0")  # killed within a line
    log = TrainingLog(path)
    log.add(progress(3, loss=7))
    log.add(progress(4, loss=8))
    rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()[1:]]
    assert [(row[0], row[3]) for row in rows] == [("1", "1.0"), ("2", "1.0"), ("3", "7.0"), ("4", "8.0")]


@pytest.mark.parametrize("kind", ["gaussian", "noise", "pluck"])
def test_the_trained_range_is_that_of_the_draws(kind):
    found = trained_range(DatasetConfiguration(kind, 4000, 5, largest_tension_rise=0.5))
    widths = {"gaussian": {"gaussian": (0.02, 0.1)}, "noise": None}
    assert found.width == widths.get(kind, {"gaussian": (0.03, 0.3), "raised_cosine": (0.03, 0.3)})
    assert found.peak_m == ((5e-4, 1e-2) if kind == "pluck" else (1e-3, 1e-2))
    assert (found.position is None, found.width is None) == (kind == "noise", kind == "noise")
    assert found.tension_rise == 0.5


QUICK = {"epochs": 2, "validate_every": 1, "batch_size": 8, "first_horizon": 20, "steps_per_batch": 16}
CELL = Cell("koopman_var", True, "gaussian", 4000, 420)


def configuration(**changes: object) -> TrainingConfiguration:
    made = configuration_of(CELL, DATA, {**QUICK, **changes})
    return replace(made, model_configuration={"state_size": 8, "multiplier_widths": [4]})


def run_row(made: TrainingConfiguration, folder: Path, name: str = CELL.name, preset: Path | None = None) -> Row:
    (row,) = run_rows([Run(name, "ours", made)], folder / "runs", output=preset, cache=folder / "cache")
    return row


def test_a_row_reports_what_its_preset_measures_and_is_read_again(tmp_path, monkeypatch):
    made = configuration()
    row = run_row(made, tmp_path)
    preset = load_preset(tmp_path / "runs" / CELL.name / f"{CELL.name}.safetensors")
    dataset = load_dataset(made.data, tmp_path / "cache")
    sums = evaluate_model(preset.model, dataset, "validation", 420)
    test, first = (evaluate_model(preset.model, dataset, "test", frames) for frames in (420, 400))
    quarters = sums.windows(4000, [0.105 * q / 4 for q in range(5)])
    expected = {
        "": sums.total(),
        "_400": sums.total(400),
        "_q1": quarters[0],
        "_q4": quarters[3],
        "_se": sums.standard_error(),
    }
    expected = {f"rel_{{}}{ending}": error for ending, error in expected.items()}
    expected |= {"test_rel_{}": test.total(), "test_rel_{}_400": first.total()}
    expected["test_rel_{}_400_se"] = first.standard_error()
    for name, error in expected.items():
        found = getattr(row, name.format("mse")), getattr(row, name.format("mae"))
        assert found == pytest.approx((error.rel_mse, error.rel_mae), rel=1e-4) and error.rel_mse > 0
    assert (row.status, row.digest, row.epochs, row.string) == ("done", made.digest, 2, "nonlinear")
    assert (row.initialisation, row.structured, row.horizon) == ("physics", True, 420)
    assert row.parameters == count_parameters(preset.model) and preset.info.horizon_steps == 420

    # a run that was done is read, and another configuration is not its
    with monkeypatch.context() as instrumented:
        instrumented.setattr("training.run.fit_seeds", lambda *_, **__: pytest.fail("trained again"))
        assert run_row(configuration(), tmp_path) == row
    with pytest.raises(ValueError, match="was trained with other settings"):
        run_row(configuration(epochs=3), tmp_path)
    (tmp_path / "runs" / CELL.name / "row.json").write_text("{")
    with pytest.raises(ValueError, match=r"row.json: not a row .*delete it to measure the run again"):
        run_row(configuration(), tmp_path)


def test_a_preset_that_is_elsewhere_is_written_again_and_its_row_stays(tmp_path, monkeypatch):
    """As `train` leaves a run in which `sweep` finds it, on another day and machine."""
    monkeypatch.setattr("training.provenance.commit", lambda: "first")
    row = run_row(configuration(), tmp_path, preset=tmp_path / "elsewhere.safetensors")
    monkeypatch.setattr("training.provenance.commit", lambda: "second")
    own = tmp_path / "runs" / CELL.name / f"{CELL.name}.safetensors"
    for _ in range(2):
        assert run_row(configuration(), tmp_path) == row
        assert own.read_bytes() == (tmp_path / "elsewhere.safetensors").read_bytes()
    run_row(configuration(seed=1), tmp_path, "other", own)  # over it
    assert run_row(configuration(), tmp_path) == row
    assert own.read_bytes() == (tmp_path / "elsewhere.safetensors").read_bytes()


def test_a_run_that_diverges_is_a_row_that_says_so(tmp_path):
    wild = configuration(peak_learning_rate=1e30, clip_norm=1e30, schedule="constant")
    row = run_row(wild, tmp_path)
    assert row.status == "diverged" and "lower peak_learning_rate" in row.message
    assert row.rel_mse is None and row.initialisation == "physics" and row.seed == 0
    assert not (tmp_path / "runs" / CELL.name / f"{CELL.name}.safetensors").exists()

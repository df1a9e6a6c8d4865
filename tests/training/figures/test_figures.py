from __future__ import annotations

import io
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread

from engine.metrics import ErrorSums
from engine.models import build_model
from engine.models.base import Physics
from engine.presets import Preset, PresetError, PresetInfo, TrainedRange
from engine.resonators.base import Array
from engine.resonators.sine_transform import listening_weights, to_grid
from engine.schema import write
from engine.truth import ModalState, SplittingSolver
from training.configuration import DatasetConfiguration, Recipe, TrainingConfiguration
from training.data.dataset import Dataset, draw_initial
from training.evaluate import evaluate_past_horizon
from training.figures import extrapolation, style
from training.figures.run_plot import plot_run, run_figure
from training.fitting.log import read_log

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
    built.initialise(how, Physics(c.string.resonator(c.modes), c.rate_hz, 1e-3), torch.Generator().manual_seed(0))
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


def truth_and_model(one: Preset, rows: slice, steps: int) -> tuple[Array, Array]:
    """Frames 0 … steps in m, by the solver and the model themselves."""
    data = extrapolation.common_data([one])
    solver = SplittingSolver(data.resonator, data.rate_hz)
    truth = to_grid(solver.solve(ModalState.at_rest(draw_initial(data)[rows]), steps).numpy(), data.grid_points)
    with torch.no_grad():
        model = one.model(torch.from_numpy(truth[:, 0] / 1e-3).float(), steps).double().numpy() * 1e-3
    return truth, np.concatenate([truth[:, :1], model], axis=1)


def line(axes: Axes, index: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = axes.lines[index].get_data()
    return np.asarray(x), np.asarray(y)


def titled(figure: Figure, words: str) -> Axes:
    (found,) = (axes for axes in figure.axes if words in axes.get_title())
    return found


# ---- what is compared ----


def test_sounds_are_those_of_the_validation_set() -> None:
    one = preset()
    data = Dataset(extrapolation.common_data([one]), torch.empty(0), 1e-3)
    truth, model = truth_and_model(one, slice(25, 27), 60)
    weights = listening_weights(np.array([0.2]), 101)
    shares: list[float] = []
    for frames in (1000, 7):  # blocks do not show
        found = evaluate_past_horizon(
            one.model,
            data,
            "validation",
            0.015,
            horizon=0,
            trajectories=slice(1, 3),
            listen=0.2,
            frames_at_once=frames,
            report=shares.append,
        )
        expected = torch.from_numpy(np.stack([model, truth]) @ weights[:, 0] / 1e-3)
        torch.testing.assert_close(found.sounds, expected.float(), atol=1e-5, rtol=1e-4)
    assert shares[-1] == 1


@pytest.mark.parametrize(
    ("field", "other"),
    [
        ("tension_modulated", False),
        ("initial", "noise"),
        ("rate_hz", 8000),
        ("modes", 4),
        ("seed", 1),
        ("largest_tension_rise", 0.1),
    ],
)
def test_presets_of_different_data_are_refused(field: str, other: Any) -> None:
    pair = [preset(name="one"), preset(name="two", **{field: other})]
    with pytest.raises(PresetError, match=f"one and two were trained on different data \\({field}: "):
        extrapolation.extrapolation(pair)


def test_the_starts_of_a_data_set_are_named() -> None:
    reported = [
        extrapolation.describe(extrapolation.common_data([preset(initial=kind)]))
        for kind in ("gaussian", "noise", "pluck")
    ]
    assert [words.split(", ")[1] for words in reported] == [
        "Gaussian plucks",
        "noise-like starts",
        "plucks of three shapes",
    ]


def test_what_a_figure_cannot_be_made_of_is_reported() -> None:
    with pytest.raises(PresetError, match="needs at least one"):
        extrapolation.common_data([])
    with pytest.raises(ValueError, match="there is no trajectory 3: the validation set has 0 … 2"):
        extrapolation.extrapolation([preset()], trajectory=3)
    with pytest.raises(ValueError, match="choose at least 64"):
        extrapolation.extrapolation([preset()], seconds=0.001)
    silent = preset()
    with pytest.raises(PresetError, match=r"metadata\.training: field 'title' is missing"):
        extrapolation.extrapolation([replace(silent, info=replace(silent.info, training={}))])


def test_labels_differ() -> None:
    names = ("nylon_koopman_var", "nylon_koopman_var_paper_seed1", "nylon_lru")
    found = [preset(name.split("_", 1)[1].removesuffix("_paper_seed1"), name) for name in names]
    assert extrapolation.labels(found) == ["Koopman_var", "Koopman_var (paper seed1)", "LRU"]
    assert extrapolation.labels([preset(name="a"), preset(name="b")]) == ["a", "b"]
    assert extrapolation.horizons(found) == [("end of training", 0.01)]
    apart = extrapolation.horizons([preset(), preset("lru", horizon=80)])
    assert apart == [("end of training\nKoopman_var", 0.01), ("end of training\nLRU", 0.02)]


# ---- figures ----


def test_a_spectrum_has_its_peak_where_the_tone_is() -> None:
    time_s = np.arange(1000) / 4000
    tone, weaker = np.sin(2 * np.pi * 500 * time_s), 0.1 * np.sin(2 * np.pi * 500 * time_s)
    levels = extrapolation.levels_db(weaker, tone)
    assert levels.argmax() == 500 * 1000 // 4000
    assert levels.max() == pytest.approx(-20)
    assert extrapolation.levels_db(np.zeros(64), np.zeros(64)).max() == extrapolation.FLOOR_DB


def test_extrapolation_goes_past_training() -> None:
    one = preset()
    figure = extrapolation.extrapolation([one], seconds=0.1, trajectory=2, trajectories=2)
    truth, model = truth_and_model(one, slice(26, 27), 400)
    weights = listening_weights(np.array([0.37]), 101)
    for words, first in (("the start", 0), ("the end", 320)):
        (axes,) = (axes for axes in figure.axes if axes.get_title() == words)
        for place, frames in ((0, truth), (1, model)):
            time_ms, heard = line(axes, place)
            np.testing.assert_allclose(time_ms, np.arange(first, first + 81) / 4)
            np.testing.assert_allclose(heard, 1000 * (frames @ weights)[0, first : first + 81, 0], atol=2e-3)
    axes = titled(figure, "error (bold: 2 trajectories, thin: trajectory 2")
    time_s, alone = line(axes, 0)
    sums = ErrorSums(400)
    sums.add(model[:, 1:], truth[:, 1:])
    expected = [w.rel_mae for w in sums.windows(4000, [0.01 * edge for edge in range(11)])]
    np.testing.assert_allclose(alone, expected, rtol=2e-3)
    np.testing.assert_allclose(time_s, np.arange(0.005, 0.1, 0.01))


def test_extrapolation_over_less_than_a_look_is_drawn() -> None:
    assert len(extrapolation.extrapolation([preset(), preset("lru")], seconds=0.016).axes) == 6


def test_a_model_that_runs_away_is_drawn_as_far_as_it_is_finite() -> None:
    one = preset("dmd")
    with torch.no_grad():
        one.model.magnitude_log.fill_(2.0)  # type: ignore[operator,union-attr]
    figure = extrapolation.extrapolation([one])
    figure.draw_without_rendering()
    assert all(math.isfinite(limit) for axes in figure.axes for limit in (*axes.get_xlim(), *axes.get_ylim()))


@pytest.mark.parametrize(
    ("model", "layers"), [("dmd", 1), ("koopman", 1), ("koopman_integrated", 1), ("lru", 2), ("s5", 2)]
)
def test_every_model_with_linear_dynamics_has_eigenvalues(model: str, layers: int) -> None:
    one = preset(model)
    found = one.model.log_eigenvalues()
    assert [log.dtype for log in found] == [torch.complex128] * layers
    linear = torch.from_numpy(one.info.string.resonator(5).eigenvalues() / 4000)
    nearest = (found[0].exp()[:, None] - linear.exp()).abs().amin(0)
    assert float(nearest.max()) < 1e-5  # all of them started from the string's


# ---- files ----


def small() -> Figure:
    figure = Figure(figsize=(3, 2))
    figure.add_subplot().plot([1, 2], [3, 4])
    return figure


@pytest.mark.parametrize(("suffix", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".PDF", b"%PDF")])
def test_files_are_of_their_format_and_repeat(tmp_path: Path, suffix: str, start: bytes) -> None:
    path = tmp_path / f"figure{suffix}"
    style.save_figure(small(), path)
    assert path.read_bytes().startswith(start)
    assert list(tmp_path.iterdir()) == [path]
    assert style.figure_bytes(small(), suffix) == path.read_bytes()


def test_a_picture_has_the_size_of_its_figure() -> None:
    figure = extrapolation.extrapolation([preset()])
    width, height = figure.get_size_inches()
    found = imread(io.BytesIO(style.figure_bytes(figure, ".png")))
    assert found.shape[:2] == (round(height * style.DPI), round(width * style.DPI))
    assert len(np.unique(found)) > 10


def test_an_unknown_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"is written as \.png, \.svg, \.pdf"):
        style.save_figure(Figure(), tmp_path / "figure.bmp")
    assert not list(tmp_path.iterdir())


# ---- a run's plot ----

HEAD = "epoch,horizon,learning_rate,loss,rel_mse,rel_mae,seconds\n"


def log(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "run" / "log.csv"
    path.parent.mkdir()
    path.write_text(text, encoding="utf-8")
    return path


def test_a_runs_plot_has_its_numbers(tmp_path: Path) -> None:
    text = HEAD + "1,150,0.001,0.5,,,1\n2,200,0.003,0.25,0.1,0.3,2\n3,400,0.002,,0.05,0.2,3\n4,40"
    path = log(tmp_path, text)
    errors, rates, horizon = run_figure(path).axes
    drawn = {entry.get_label(): tuple(map(list, entry.get_data())) for entry in errors.lines}
    assert drawn == {
        "loss": ([1, 2], [0.5, 0.25]),
        "validation rel. MSE": ([2, 3], [0.1, 0.05]),
        "validation rel. MAE": ([2, 3], [0.3, 0.2]),
    }
    assert list(line(rates, 0)[1]) == [0.001, 0.003, 0.002]
    assert list(line(horizon, 0)[1]) == [150, 200, 400]
    assert errors.get_yscale() == "log"
    plot_run(path, path.with_suffix(".png"))
    assert imread(path.with_suffix(".png")).shape[:2] == (1300, 2000)
    assert sorted(entry.name for entry in path.parent.iterdir()) == ["log.csv", "log.png"]


@pytest.mark.parametrize("lines", ["", "1,150,0.001,0.5,,,1\n", "1,150,0.001,-2.5,,,1\n2,150,0.001,-3,,,1\n"])
def test_a_log_may_be_short_without_validation_or_negative(tmp_path: Path, lines: str) -> None:
    path = log(tmp_path, HEAD + lines)
    plot_run(path, path.with_suffix(".svg"))
    assert path.with_suffix(".svg").exists()
    assert len(read_log(path)) == lines.count("\n")


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n"])
def test_what_is_no_log_is_reported(tmp_path: Path, text: str) -> None:
    path = log(tmp_path, text)
    with pytest.raises(ValueError, match=r"log\.csv: not a training log"):
        plot_run(path, path.with_suffix(".png"))
    assert not path.with_suffix(".png").exists()

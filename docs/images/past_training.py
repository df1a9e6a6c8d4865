"""Draw `past-training.png`: `PYTHONPATH=. .venv/bin/python docs/images/past_training.py` (some minutes of one core).

The error of five models per time step, over four times their training: ten trajectories of the validation set.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import style
import torch
from matplotlib.figure import Figure

from engine.presets import find_preset, load_preset
from training.data.dataset import Dataset
from training.evaluate import evaluate_past_horizon
from training.run import data_of

HERE = Path(__file__).resolve().parent
DATA = "nylon_nonlinear_gaussian_16k"
MODELS = {
    "koopman_integrated": "integrated phase",
    "koopman_integrated_hinted": "integrated phase (hinted)",
    "koopman_var": "Koopman_var",
    "koopman": "Koopman",
    "lru": "LRU",
}
SECONDS, TRAJECTORIES, SMOOTHED_S = 1.0, 10, 0.01


def main() -> None:
    presets = [load_preset(find_preset(f"{DATA}_{name}")) for name in MODELS]
    data = data_of(presets[0])
    with style.styled():
        figure = Figure(figsize=(9, 5), layout="constrained")
        axes = figure.subplots()
        for place, (preset, label) in enumerate(zip(presets, MODELS.values(), strict=True)):
            own = Dataset(data, torch.empty(0), preset.info.scale_m)
            found = evaluate_past_horizon(
                preset.model, own, "validation", SECONDS, horizon=0, trajectories=slice(TRAJECTORIES)
            )
            mse, _ = found.string.per_frame()
            time_s = np.arange(1, len(mse) + 1) / data.rate_hz
            axes.plot(time_s, mse, linewidth=0.5, alpha=0.25, color=style.COLOURS[place])
            axes.plot(
                time_s, smoothed(mse, round(SMOOTHED_S * data.rate_hz)), label=label, color=style.COLOURS[place]
            )
        axes.set_yscale("log")
        axes.set_ylim(top=min(axes.get_ylim()[1], 100.0))  # a model that runs away must not squeeze the others
        axes.set_xlim(0, SECONDS)
        horizon_s = presets[0].info.horizon_s
        axes.axvspan(horizon_s, SECONDS, color="#D55E00", alpha=0.07, linewidth=0, zorder=0)
        axes.axvline(horizon_s, color="#777777", linewidth=1.2, linestyle="--", zorder=1)
        place = ((horizon_s, 1), (4, -4), ("data", "axes fraction"))
        axes.annotate("end of training", *place, textcoords="offset points", va="top", fontsize=9, color="#777777")
        axes.set_xlabel("time in s")
        axes.set_ylabel("relative MSE per time step")
        axes.set_title(
            f"{TRAJECTORIES} trajectories of the validation set: tension-modulated string, Gaussian plucks, 16 kHz"
        )
        figure.legend(loc="outside lower center", ncols=len(MODELS))
    style.save_figure(figure, HERE / "past-training.png")


def smoothed(values: np.ndarray, width: int) -> np.ndarray:
    """The running mean over `width` frames, at the ends over those that exist."""
    window = np.ones(width)
    return np.convolve(values, window, "same") / np.convolve(np.ones(len(values)), window, "same")


if __name__ == "__main__":
    main()

"""What a model learned of decay and frequency: its eigenvalues in the unit circle, beside the linear string's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from engine.models.eigenvalues import VANISHED
from engine.presets import Preset, PresetError
from training.figures import motions, style

REFERENCE = "#222222"


def eigenvalues(presets: Sequence[Preset]) -> Figure:
    """A column each preset: the unit circle above, decay over frequency below. Any presets go together.

    Raises:
        PresetError: a model has no eigenvalues (`fgru`, `frnn`), or there is no preset.
    """
    if not presets:
        raise PresetError("no preset was given; a figure needs at least one")
    found = []
    for preset in presets:
        layers = [log[log.real > np.log(VANISHED)].numpy() for log in preset.model.log_eigenvalues()]
        if not layers:
            raise PresetError(
                f"{preset.path}: a {preset.info.model} has no eigenvalues; its field goes through a network"
            )
        found.append(layers)
    with style.styled():
        figure = Figure(figsize=(1.4 + 4.8 * len(presets), 9.4), layout="constrained")
        axes = figure.subplots(2, len(presets), squeeze=False, sharey="row", height_ratios=(1.25, 1))
        for place, (preset, layers) in enumerate(zip(presets, found, strict=True)):
            info, drawn = preset.info, style.colour(place)["color"]
            linear = info.resonator.eigenvalues().numpy() / info.rate_hz
            _draw_circle(axes[0, place], layers, linear, drawn)
            _draw_decay(axes[1, place], layers, linear, info.rate_hz, drawn)
            kind = "tension-modulated" if info.tension_modulated else "linear"
            axes[0, place].set_title(
                f"{motions.labels(presets)[place]}\n{kind}, {info.initial}, {info.rate_hz / 1000:g} kHz",
                color=drawn,
                fontweight="bold",
            )
        for row, name in enumerate(("Im λ", "decay rate σ in 1/s")):
            axes[row, 0].set_ylabel(name)
        style.add_legend(figure, axes[1])
        figure.suptitle("Learned eigenvalues λ and those of the linear string")
    return figure


def _draw_circle(axes: Axes, layers: Sequence[np.ndarray], linear: np.ndarray, drawn: str) -> None:
    turn = np.exp(2j * np.pi * np.linspace(0, 1, 721))
    axes.plot(turn.real, turn.imag, color=style.MARKED, linewidth=1)
    for log in reversed(layers[1:]):
        learned = np.exp(log)
        axes.plot(learned.real, learned.imag, "o", color="#bbbbbb", markersize=3, alpha=0.6)
    learned, pairs = np.exp(layers[0]), np.exp(np.concatenate([linear, linear.conj()]))
    axes.plot(learned.real, learned.imag, "o", color=drawn, markersize=9, alpha=0.6, markeredgewidth=0)
    axes.plot(pairs.real, pairs.imag, "x", color=REFERENCE, markersize=6, markeredgewidth=1.2)
    axes.set_aspect("equal")
    axes.set_xlabel("Re λ")
    axes.set_xticks((-1, -0.5, 0, 0.5, 1))
    axes.set_yticks((-1, -0.5, 0, 0.5, 1))


def _draw_decay(axes: Axes, layers: Sequence[np.ndarray], linear: np.ndarray, rate_hz: int, drawn: str) -> None:
    for log in reversed(layers[1:]):
        axes.plot(*_decay(log, rate_hz), "o", color="#bbbbbb", markersize=3, alpha=0.6)
    if len(layers) > 1:
        axes.lines[0].set_label("other layers")
    axes.plot(
        *_decay(layers[0], rate_hz), "o", color=drawn, markersize=9, alpha=0.6, markeredgewidth=0, label="learned"
    )
    axes.plot(
        *_decay(linear, rate_hz), "x", color=REFERENCE, markersize=6, markeredgewidth=1.2, label="linear string"
    )
    axes.set_yscale("log")
    axes.set_xlim(0, rate_hz / 2000)
    axes.locator_params(axis="x", nbins=5)
    folded = "" if np.abs(linear.imag).max() < np.pi else ", folded at half the rate"
    axes.set_xlabel(f"frequency in kHz{folded}")
    growing = sum(int((log.real >= 0).sum()) for log in layers)
    if growing:
        axes.annotate(
            f"{growing} with |λ| ≥ 1: not shown here", (0.02, 0.98), xycoords="axes fraction", va="top", color=drawn
        )


def _decay(log: np.ndarray, rate_hz: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequency in kHz as it is heard, below half the rate, and decay rate in 1/s, of those that decay."""
    decaying = log[log.real < 0]
    angle = np.abs(np.angle(np.exp(1j * decaying.imag)))
    return angle * rate_hz / (2000 * np.pi), -decaying.real * rate_hz

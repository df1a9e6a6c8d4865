"""Options of a pluck and of where it is heard, with the ranges and words of the table of parameters."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import typer

from app.shared.parameters import OF_CHOICES
from engine.pluck import Pluck
from engine.pluck import Shape as PluckShape
from training.cli.arguments import check_range

DEFAULT_SHAPE = Pluck().shape
DEFAULT_WIDTH = Pluck().width
DEFAULT_LISTEN = OF_CHOICES["listen"].default


def _option(id: str, metavar: str) -> Any:
    """An option with the parameter's tip and range."""
    parameter = OF_CHOICES[id]
    low, high = parameter.limits
    return typer.Option(metavar=metavar, help=f"{parameter.tip}: {low:g} … {high:g} {parameter.unit}".rstrip() + ".")


POSITION, AMPLITUDE_MM = _option("position", "X"), _option("amplitude_mm", "MM")
SECONDS = typer.Option(metavar="S", help="Duration in s.")  # up to that of the longest file, not the window's
Position = Annotated[float, POSITION]
AmplitudeMm = Annotated[float, AMPLITUDE_MM]
Seconds = Annotated[float, SECONDS]
Shape = Annotated[PluckShape, typer.Option(help="The pluck's shape.")]
Width = Annotated[float, _option("width", "X")]
Listen = Annotated[float, _option("listen", "X")]
ListenRight = Annotated[
    float | None, typer.Option(help="Listening point of a right channel; without it the file is mono.", metavar="X")
]
ModelOrTruth = Annotated[
    Literal["model", "truth"], typer.Option(help="The learned model, or the truth: the solved physics.")
]
GainDb = Annotated[float, typer.Option(metavar="DB", help="Gain of the difference.")]


def check(**values: float | None) -> None:
    """Check options, by the names of their parameters, against the table's ranges; None: not given.

    Raises:
        typer.BadParameter: one is out of its range; the message names option, value and range.
    """
    for id, value in values.items():
        if value is not None:
            parameter = OF_CHOICES[id]
            check_range(f"--{id.replace('_', '-')}", value, *parameter.limits, parameter.unit)


def check_pluck(position: float, amplitude_mm: float, shape: PluckShape, width: float) -> Pluck:
    """The pluck of these options, whose ranges are checked."""
    check(position=position, amplitude_mm=amplitude_mm, width=width)
    return Pluck(position, amplitude_mm, shape, width)


def check_shortest(seconds: float, rate_hz: int) -> None:
    """Raise typer.BadParameter: `seconds` are less than one sample."""
    if round(seconds * rate_hz) < 1:
        raise typer.BadParameter(f"must hold a sample of {rate_hz} Hz, not {seconds:g} s", param_hint="--seconds")

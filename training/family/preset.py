"""A preset of many strings: a configuration, its strings, the fit, and what the preset says of itself."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean

import torch

from engine import bounds
from engine.compare.relative import relative_error
from engine.models import build_model
from engine.models.base import Physics
from engine.models.koopman_tension import KoopmanTension
from engine.presets import PresetInfo, TrainedRange, save_preset
from engine.resonators.string import resonator_of
from engine.schema import SchemaError, read, read_toml, write
from engine.values.string import StringParameters
from training.family.errors import player
from training.family.fit import FitCase, fit_curves
from training.family.motion import SCALE_M, of_many
from training.family.strings import FAMILY, GRID_POINTS, draw_string, solve

CONFIGURATION = Path(__file__).parent / "studio_any_string.toml"


@dataclass(frozen=True)
class FamilyConfiguration:
    """The complete configuration of a run.

    Attributes:
        string: that the preset plays by default, with `modes`.
        initialisation: a start of `koopman_tension`, "kicks" or "series".
        degree: of the polynomials that are its curves.
        strings, validation_strings, test_strings: how many of each split.
        seconds: of each string's motion.
        steps: of the fit, see `fit_curves`; the first reaches `first_s` seconds of the motion.
    """

    title: str
    description: str
    modes: int
    string: StringParameters = field(default_factory=StringParameters)
    rate_hz: int = 48_000
    initialisation: str = "kicks"
    degree: int = 3
    strings: int = 64
    validation_strings: int = 32
    test_strings: int = 64
    seconds: float = 0.5
    steps: int = 10
    first_s: float = 0.0625
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("strings", "validation_strings", "test_strings", "steps"):
            bounds.check(name, getattr(self, name), (1, 10_000))
        if not 0 < self.first_s <= self.seconds <= 10:
            raise ValueError("first_s and seconds must be above 0, first_s at most seconds, and seconds at most 10")


def read_configuration(path: Path = CONFIGURATION) -> FamilyConfiguration:
    """Read a run's .toml file; default that of studio_any_string. Raises SchemaError, which names file and field."""
    if not path.is_file():
        raise SchemaError(f"{path}: no such configuration; give a .toml file")
    return read(FamilyConfiguration, read_toml(path), str(path))


def train_preset(
    configuration: FamilyConfiguration,
    output: Path,
    *,
    report: Callable[[float, str, float | None], None] = lambda share, text, left_s: None,
) -> PresetInfo:
    """Make the preset's file, in some minutes.

    Args:
        report: receives the share that is done, what is being done, and the time left, where it is known.
    """
    c, started = configuration, time.monotonic()
    steps = round(c.seconds * c.rate_hz)  # frames of each motion; c.steps are the fit's
    counts = {"train": c.strings, "validation": c.validation_strings, "test": c.test_strings}
    cases: dict[str, list[FitCase]] = {split: [] for split in counts}
    for split, count in counts.items():
        for number in range(count):
            plucked = draw_string("inside", split, number, c.seed)
            # as a data set keeps them, in single precision: 4e-15 of the energy
            cases[split].append(FitCase(plucked, solve(plucked, c.rate_hz, steps).float().double()))
            report(0.5 * sum(map(len, cases.values())) / sum(counts.values()), "true motions", None)
    sizes = {"grid_points": GRID_POINTS, "modes": c.modes, "degree": c.degree}
    model = of_many(build_model("koopman_tension", sizes))
    resonator = resonator_of(c.string, c.modes, grid_points=GRID_POINTS)
    model.initialise(c.initialisation, Physics(resonator, c.rate_hz, SCALE_M), torch.Generator().manual_seed(c.seed))
    model.eval()
    first = max(1, round(c.first_s * c.rate_hz))
    fit_curves(
        model,
        cases["train"],
        cases["validation"],
        c.rate_hz,
        steps=c.steps,
        first_frames=first,
        seed=c.seed,
        report=lambda share, text, left_s: report(0.5 + 0.5 * share, text, left_s),
    )
    rel_mse, rel_mae = mean_errors(model, cases["validation"], c.rate_hz)
    test_rel_mse, test_rel_mae = mean_errors(model, cases["test"], c.rate_hz)
    family = FAMILY["inside"]
    info = PresetInfo(
        title=c.title,
        description=c.description,
        model="koopman_tension",
        model_configuration=write(model.configuration),
        string=c.string,
        tension_modulated=True,
        initial="pluck",
        rate_hz=c.rate_hz,
        modes=c.modes,
        grid_points=GRID_POINTS,
        horizon_steps=steps,
        scale_m=SCALE_M,
        trained_range=TrainedRange(family.position, family.width, None, family.tension_rise[1]),
        initialisation=c.initialisation,
        knows=KoopmanTension.initialisations[c.initialisation],
        seed=c.seed,
        rel_mse=rel_mse,
        rel_mae=rel_mae,
        test_rel_mse=test_rel_mse,
        test_rel_mae=test_rel_mae,
        training_seconds=time.monotonic() - started,
        training={"family": write(c)},
        family=family,
    )
    save_preset(output, info, model)
    return info


@torch.inference_mode()
def mean_errors(model: KoopmanTension, cases: list[FitCase], rate_hz: int) -> tuple[float, float]:
    """Relative MSE and MAE of displacement on the grid: the mean over the strings of each string's own."""
    play = player(model)
    errors = []
    for case in cases:
        shapes = torch.from_numpy(case.plucked.resonator.shapes)
        displacement = play(case.plucked, rate_hz)(len(case.truth)) @ shapes
        errors.append(relative_error(displacement[None], (case.truth @ shapes)[None]))
    return mean(error.rel_mse for error in errors), mean(error.rel_mae for error in errors)

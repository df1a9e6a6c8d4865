"""A run's configuration by its name: a committed file, a cell of the paper's tables, or any TOML file by path."""

from __future__ import annotations

from pathlib import Path

from engine.schema import SchemaError, read, read_toml
from training.cell import Cell, configuration_of
from training.configuration import TrainingConfiguration

CONFIGURATIONS = Path(__file__).parent / "configurations"


def load(name_or_path: str) -> TrainingConfiguration:
    """A committed configuration by its file's name, a cell of the tables by its name, or any TOML file by path.

    Raises:
        SchemaError: not found, not TOML, or a field is wrong; the message names the file and the field.
    """
    path = Path(name_or_path)
    if not path.suffix:
        path = CONFIGURATIONS / f"{name_or_path}.toml"
        if not path.is_file() and (cell := Cell.parse(name_or_path)) is not None:
            return configuration_of(cell)
    if not path.is_file():
        known = "".join(f", {p.stem}" for p in sorted(CONFIGURATIONS.glob("*.toml")))
        raise SchemaError(
            f"no training configuration {name_or_path!r}; give a .toml file, or a name: a cell of the tables like "
            f"nylon_nonlinear_noise_16k_koopman_var_400_seed1{known}"
        )
    return read(TrainingConfiguration, read_toml(path), str(path))

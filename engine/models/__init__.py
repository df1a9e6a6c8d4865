"""The learned models, by name. Adding one: its file, and a line in `MODELS`."""

from __future__ import annotations

from typing import Any

from engine.models.base import StringModel, count_parameters
from engine.models.koopman_var import KoopmanVar, KoopmanVarConfiguration

# name in presets and on the command line -> (class, configuration, whose defaults are the paper's sizes)
MODELS: dict[str, tuple[type[StringModel[Any]], type]] = {
    "koopman_var": (KoopmanVar, KoopmanVarConfiguration),
}

__all__ = ["MODELS", "KoopmanVar", "KoopmanVarConfiguration", "StringModel", "count_parameters"]

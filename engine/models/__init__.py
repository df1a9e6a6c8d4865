"""The learned models, by name. Adding one: its configuration, its file, and a line in `MODELS`.

Nothing here imports torch before a model is made: presets are listed and played without it.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from engine.models import configurations as sizes
from engine.schema import read, without_retired

if TYPE_CHECKING:
    from engine.models.base import StringModel

# name in presets and on the command line -> (file and class, configuration). Defaults are the paper's sizes, and our
# own for models that the paper does not have: `koopman_integrated`, `koopman_tension`.
MODELS: dict[str, tuple[str, type]] = {
    "dmd": ("dmd.DMD", sizes.DMDConfiguration),
    "koopman": ("koopman.Koopman", sizes.KoopmanConfiguration),
    "koopman_var": ("koopman_var.KoopmanVar", sizes.KoopmanVarConfiguration),
    "koopman_integrated": ("integrated_phase.IntegratedPhase", sizes.IntegratedPhaseConfiguration),
    "koopman_tension": ("koopman_tension.KoopmanTension", sizes.KoopmanTensionConfiguration),
    "fgru": ("fno.FGRU", sizes.FGRUConfiguration),
    "frnn": ("fno.FRNN", sizes.FRNNConfiguration),
    "lru": ("lru.LRU", sizes.LRUConfiguration),
    "s5": ("s5.S5", sizes.S5Configuration),
}


OF_MANY_STRINGS = frozenset({"koopman_tension"})  # take any resonator

# sizes of earlier versions, and the only value that they ever had in a model that was kept
RETIRED: dict[str, dict[str, Any]] = {
    "koopman_integrated": {
        "multiplier_widths": [],
        "decoder_widths": [],
        "rate_unit": 1e-3,
        "gain_limit_db": 6.0,
        "modulation": True,
        "physical_units": True,
    }
}


def model_class(name: str) -> type[StringModel[Any]]:
    """The class of a model, and torch with it.

    Raises:
        KeyError: no such model.
    """
    module, _, kind = MODELS[name][0].partition(".")
    cls: type[StringModel[Any]] = getattr(importlib.import_module(f"{__name__}.{module}"), kind)
    return cls


def build_model(name: str, configuration: Mapping[str, Any] | None = None) -> StringModel[Any]:
    """The model of a name with its weights not yet set; `configuration` as plain data, None or {} the defaults.

    Raises:
        SchemaError: a field is unknown, of another type, or refused by the configuration.
        KeyError: no such model.
    """
    return model_class(name)(read_model_configuration(name, configuration or {}, "model_configuration"))


def read_model_configuration(name: str, data: object, where: str) -> Any:
    """The configuration of a model from plain data, of this version or an earlier one, its sizes within `bounds`.

    Raises:
        SchemaError, KeyError: as `build_model`.
    """
    return read(MODELS[name][1], without_retired(data, RETIRED.get(name, {}), where), where)


__all__ = ["MODELS", "OF_MANY_STRINGS", "RETIRED", "build_model", "model_class", "read_model_configuration"]

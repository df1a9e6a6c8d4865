"""The learned models, by name. Adding one: its file, and a line in `MODELS`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from engine import bounds
from engine.models._diagonal import DiagonalModel
from engine.models.base import StringModel, count_parameters
from engine.models.dmd import DMD, DMDConfiguration
from engine.models.fno import FGRU, FRNN, FGRUConfiguration, FRNNConfiguration
from engine.models.integrated_phase import IntegratedPhaseConfiguration, KoopmanIntegrated
from engine.models.koopman import Koopman, KoopmanConfiguration
from engine.models.koopman_tension import KoopmanTension, KoopmanTensionConfiguration
from engine.models.koopman_var import KoopmanVar, KoopmanVarConfiguration
from engine.models.lru import LRU, LRUConfiguration
from engine.models.s5 import S5, S5Configuration
from engine.schema import SchemaError, read, without_retired

# name in presets and on the command line -> (class, configuration). Defaults are the paper's sizes, and our own for
# models that the paper does not have: `koopman_integrated`, `koopman_tension`.
MODELS: dict[str, tuple[type[StringModel[Any]], type]] = {
    "dmd": (DMD, DMDConfiguration),
    "koopman": (Koopman, KoopmanConfiguration),
    "koopman_var": (KoopmanVar, KoopmanVarConfiguration),
    "koopman_integrated": (KoopmanIntegrated, IntegratedPhaseConfiguration),
    "koopman_tension": (KoopmanTension, KoopmanTensionConfiguration),
    "fgru": (FGRU, FGRUConfiguration),
    "frnn": (FRNN, FRNNConfiguration),
    "lru": (LRU, LRUConfiguration),
    "s5": (S5, S5Configuration),
}


# sizes of earlier versions, and the only value that they ever had in a model that was kept
RETIRED: dict[str, dict[str, Any]] = {
    "koopman_integrated": {"multiplier_widths": [], "decoder_widths": [], "rate_unit": 1e-3, "gain_limit_db": 6.0}
}


def build_model(name: str, configuration: Mapping[str, Any] | None = None) -> StringModel[Any]:
    """The model of a name with its weights not yet set; `configuration` as plain data, None or {} the defaults.

    Raises:
        SchemaError: a field is unknown, of another type, or refused by the configuration.
        KeyError: no such model.
    """
    return MODELS[name][0](read_model_configuration(name, configuration or {}, "model_configuration"))


def read_model_configuration(name: str, data: object, where: str) -> Any:
    """The configuration of a model from plain data, of this version or an earlier one, its sizes within `bounds`.

    Raises:
        SchemaError, KeyError: as `build_model`.
    """
    configuration: Any = read(MODELS[name][1], without_retired(data, RETIRED.get(name, {}), where), where)
    try:
        bounds.check_sizes(configuration)
    except ValueError as error:
        raise SchemaError(f"{where}: {error}") from error
    return configuration


__all__ = [
    "DMD",
    "FGRU",
    "FRNN",
    "LRU",
    "MODELS",
    "S5",
    "DMDConfiguration",
    "DiagonalModel",
    "FGRUConfiguration",
    "FRNNConfiguration",
    "IntegratedPhaseConfiguration",
    "Koopman",
    "KoopmanConfiguration",
    "KoopmanIntegrated",
    "KoopmanTension",
    "KoopmanTensionConfiguration",
    "KoopmanVar",
    "KoopmanVarConfiguration",
    "LRUConfiguration",
    "S5Configuration",
    "StringModel",
    "build_model",
    "count_parameters",
    "read_model_configuration",
]

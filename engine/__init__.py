"""The engine: string physics, its reference solutions, learned models, metrics and presets.

It needs torch, numpy, scipy, numba, pydantic and safetensors only, and knows no window and no sound device. What a
notebook needs is named here (README, "From Python"), and loaded when it is first asked for: the window imports from
here before torch.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from engine.compare.relative import relative_error as relative_error
    from engine.pluck import Pluck as Pluck
    from engine.presets import find_preset as find_preset
    from engine.presets import load_preset as load_preset
    from engine.resonators import Resonator as Resonator
    from engine.sources import ModelSource as ModelSource
    from engine.sources import TruthSource as TruthSource
    from engine.values.ear import Ear as Ear
    from engine.values.string import StringParameters as StringParameters
    from engine.voices import (
        model_program as model_program,
    )
    from engine.voices import (
        render_voice as render_voice,
    )
    from engine.voices import (
        truth_program as truth_program,
    )

_HOMES = {
    "Ear": "engine.values.ear",
    "ModelSource": "engine.sources",
    "Pluck": "engine.pluck",
    "Resonator": "engine.resonators",
    "StringParameters": "engine.values.string",
    "TruthSource": "engine.sources",
    "find_preset": "engine.presets",
    "load_preset": "engine.presets",
    "model_program": "engine.voices",
    "relative_error": "engine.compare.relative",
    "render_voice": "engine.voices",
    "truth_program": "engine.voices",
}

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)

"""Checkpoints of a run: safetensors with a JSON text, so that no pickle is ever read.

A run's random numbers are functions of its seed and the iteration (see `fit`). Weights, optimiser moments
and the iteration are all that a bit-for-bit continuation needs.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from engine.plain_text import one_line
from engine.presets.file import check_header
from engine.schema import parse_json
from engine.whole_file import whole_file

LARGEST_BYTES = 2 * 2**30  # weights, their mean, the best of them, and the moments of the optimiser


@dataclass(frozen=True)
class Checkpoint:
    """A moment of a run. `facts` holds the configuration, the iteration and the history as plain data."""

    model: Mapping[str, Tensor]
    best_model: Mapping[str, Tensor]
    average: Mapping[str, Tensor]  # a running mean of the weights; empty where the run keeps none
    optimiser: Mapping[str, Mapping[str, Tensor]]  # parameter index -> name of the moment -> value
    facts: Mapping[str, Any]

    def save(self, path: Path) -> None:
        """Write whole or not at all. Raises OSError."""
        parts = {"model": self.model, "best": self.best_model, "average": self.average}
        parts |= {f"optimiser/{index}": moments for index, moments in self.optimiser.items()}
        # clones: safetensors refuses tensors that share memory
        whole = {
            f"{part}/{name}": t.detach().to("cpu", copy=True).contiguous()
            for part, tensors in parts.items()
            for name, t in tensors.items()
        }
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as unfinished:
            try:
                save_file(whole, unfinished, metadata={"facts": json.dumps(self.facts)})
            except SafetensorError as error:  # its words for a full disk
                raise OSError(
                    f"{path}: cannot be written ({error}); free some space, or choose other --runs"
                ) from error

    @classmethod
    def load(cls, path: Path) -> Checkpoint:
        """Raise ValueError, naming the file and the remedy, where it is damaged, or no file of ours."""
        parts: dict[str, dict[str, Tensor]] = {"model": {}, "best": {}, "average": {}}
        optimiser: dict[str, dict[str, Tensor]] = {}
        try:
            if path.exists() and (not path.is_file() or path.stat().st_size > LARGEST_BYTES):
                raise ValueError(f"no file of at most {LARGEST_BYTES // 2**20} MiB")
            check_header(path)
            with safe_open(path, framework="pt") as file:
                facts = parse_json(file.metadata()["facts"], "facts")
                for key in file.keys():  # noqa: SIM118 - not a mapping
                    part, _, name = key.partition("/")
                    if part == "optimiser":
                        index, _, moment = name.partition("/")
                        optimiser.setdefault(index, {})[moment] = file.get_tensor(key)
                    else:
                        parts[part][name] = file.get_tensor(key)
        except (SafetensorError, KeyError, TypeError, ValueError) as error:
            message = one_line(f"{path}: damaged checkpoint ({error}); delete it to start the run again")
            raise ValueError(message) from error
        return cls(parts["model"], parts["best"], parts["average"], optimiser, facts)

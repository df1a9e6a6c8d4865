"""Presets: trained weights with what they were trained on, in one safetensors file. Data, never code.

The metadata of a safetensors file maps strings to strings; ours is one JSON text under `learned_strings`,
read into `PresetInfo`. Everything is checked before anything is used: the file's size, the metadata, then
each tensor's name, type and shape, then that every number is finite.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open

from engine import bounds
from engine.models import build_model, read_model_configuration
from engine.models._tension_law import CURVES, check_resonator, resonator_arrays, shapes_of_arrays
from engine.plain_text import LineError, name_text
from engine.presets.info import PresetInfo
from engine.presets.migrations import UnknownVersion, migrated
from engine.schema import SchemaError, parse_json, read, write
from engine.whole_file import whole_file

if TYPE_CHECKING:
    from engine.models.base import StringModel

METADATA_KEY = "learned_strings"


class PresetError(LineError, ValueError):
    """A preset that cannot be used. The message names the file, what is wrong with it and the remedy, in one line."""


@dataclass(frozen=True)
class Preset:
    """A loaded preset.

    Attributes:
        name: its file's stem.
        weights: of its model, by name.
    """

    name: str
    path: Path
    info: PresetInfo
    weights: Mapping[str, NDArray[Any]]

    @cached_property
    def configuration(self) -> Any:
        """The sizes of its model."""
        return _configuration(self.info)

    @cached_property
    def model(self) -> StringModel[Any]:
        """The model in evaluation mode, made when it is first asked for, and torch with it."""
        import torch

        model = _empty_model(self.path, self.info)
        # copies: NumPy aligns memory less than torch, and sums depend on alignment by a rounding
        weights = {name: torch.from_numpy(array).clone() for name, array in self.weights.items()}
        model.load_state_dict(weights, assign=True)
        for parameter in model.parameters():
            parameter.requires_grad_(True)
        return model.eval()


def save_preset(path: Path, info: PresetInfo, model: StringModel[Any]) -> None:
    """Write a preset whole or not at all.

    Raises:
        PresetError: a weight is not finite.
        OSError: the folder cannot be written or the disk is full.
    """
    from safetensors.torch import save_file

    tensors = {name: t.detach().cpu().contiguous() for name, t in model.state_dict().items()}
    for name, tensor in tensors.items():
        _check_finite(path, name, tensor.numpy())
    text = json.dumps(write(info), allow_nan=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as unfinished:
        try:
            save_file(tensors, unfinished, metadata={METADATA_KEY: text})
        except SafetensorError as error:  # its words for a full disk
            raise OSError(f"{path}: cannot be written ({error}); free some space, or choose another disk") from error
        unfinished.chmod(0o644)


def read_info(path: Path) -> PresetInfo:
    """The metadata alone, checked; no weight is read.

    Raises:
        PresetError: the file is missing, damaged, oversized, of a newer format, or says something impossible.
    """
    with _open(path) as file:
        return _info_of(path, file)


def load_preset(path: Path) -> Preset:
    """A preset with its weights, of which a model can be made.

    Raises:
        PresetError: see `read_info`; also a tensor that is missing, unknown, re-shaped, re-typed or not finite, or of
            another string than the metadata's.
    """
    with _open(path) as file:
        info = _info_of(path, file)
        expected = _forms(path, info)
        present = set(file.keys())
        if missing := sorted(set(expected) - present):
            raise PresetError(f"{path}: tensor {missing[0]!r} is missing; get the preset again or train it again")
        if unknown := sorted(present - set(expected)):
            raise PresetError(f"{path}: tensor {unknown[0]!r} is unknown to a {info.model}; get the preset again")
        for name, form in expected.items():
            _check_form(path, name, form, file.get_slice(name))
        weights = {name: np.array(file.get_tensor(name)) for name in expected}
    for name, array in weights.items():
        _check_finite(path, name, array)
    preset = Preset(name_text(path.stem), path, info, weights)
    if info.of_many_strings:
        _check_resonator(preset)
    return preset


def described_parameters(path: Path, info: PresetInfo) -> int:
    """The number of parameters of the model that `info` describes, without reading or making a weight.

    Raises:
        PresetError: the description is of an impossible model; `path` names it in the message.
    """
    if info.of_many_strings:
        return sum(math.prod(_forms(path, info)[name][0]) for name in CURVES)
    from engine.models.base import count_parameters

    return count_parameters(_empty_model(path, info))


def preset_digest(path: Path) -> str:
    """SHA-256 of a preset's file, in hexadecimal; remembered for as long as the file is the same one.

    Raises:
        PresetError: it cannot be read, is no file, or is larger than a preset may be.
    """
    try:
        state = path.stat()
        _check_kind(path, state)
        return _digest(path, state.st_mtime_ns, state.st_size)
    except OSError as error:
        raise PresetError(f"{path}: the preset cannot be read any more ({error.strerror}); put it back") from error


@functools.lru_cache(maxsize=512)
def _digest(path: Path, changed_ns: int, size_bytes: int) -> str:
    """SHA-256 of a file in hexadecimal, remembered by its path, time of change and size."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def _open(path: Path) -> Iterator[Any]:
    """`safe_open` with the file checked first and every failure in our words."""
    try:
        _check_kind(path, path.stat())
        check_header(path)
        opened = safe_open(path, framework="numpy")
    except FileNotFoundError:
        raise PresetError(f"{path}: no such preset file; check the path") from None
    except (SafetensorError, UnicodeError) as error:
        raise PresetError(f"{path}: not a whole safetensors file ({error}); get the preset again") from error
    except OSError as error:
        raise PresetError(f"{path}: cannot be read ({error.strerror or error})") from error
    with opened as file:
        yield file


def _check_kind(path: Path, state: os.stat_result) -> None:
    """Raise PresetError where it is a folder, a pipe, which would keep a reader waiting, or too large."""
    if not stat.S_ISREG(state.st_mode):
        raise PresetError(f"{path}: not a file; give a .safetensors preset")
    if state.st_size > bounds.LARGEST_PRESET_BYTES:
        most = bounds.LARGEST_PRESET_BYTES
        raise PresetError(
            f"{path}: {state.st_size / 2**20:.0f} MiB is more than the {most // 2**20} MiB that a preset may"
            " have; it is not one of ours"
        )


def check_header(path: Path) -> None:
    """Raise SafetensorError where the header of a safetensors file is longer than any of ours."""
    with path.open("rb") as file:
        length = int.from_bytes(file.read(8), "little")
    if length > bounds.LARGEST_HEADER_BYTES:
        raise SafetensorError(f"a header of {length} bytes")


def _info_of(path: Path, file: Any) -> PresetInfo:
    """The checked metadata of an open safetensors file; `path` names it in messages. Raises PresetError."""
    text = (file.metadata() or {}).get(METADATA_KEY)
    if text is None:
        raise PresetError(f"{path}: has no {METADATA_KEY!r} metadata; it is not a preset of this program")
    try:
        data = parse_json(text, "metadata")
        if not isinstance(data, dict):
            raise SchemaError("metadata is no JSON object")
        info = read(PresetInfo, migrated(data), "metadata")
        configuration = _configuration(info)
    except UnknownVersion as error:
        raise PresetError(f"{path}: {error}") from error
    except SchemaError as error:
        raise PresetError(f"{path}: {error}; get the preset again or train it again") from error
    if configuration.grid_points != info.grid_points:
        raise PresetError(
            f"{path}: metadata.grid_points is {info.grid_points}, the model's grid has {configuration.grid_points}; "
            "get the preset again"
        )
    return info


def _configuration(info: PresetInfo) -> Any:
    return read_model_configuration(info.model, info.model_configuration, "metadata.model_configuration")


def _empty_model(path: Path, info: PresetInfo) -> StringModel[Any]:
    """The model without memory behind it, so that absurd sizes in the metadata cost nothing."""
    import torch

    try:
        with torch.device("meta"):
            model = build_model(info.model, info.model_configuration)
    except (RuntimeError, OverflowError, MemoryError) as error:
        raise PresetError(f"{path}: metadata.model_configuration asks for an impossible model ({error})") from error
    return model


Form = tuple[tuple[int, ...], str]  # shape, and type by its name in safetensors


def _forms(path: Path, info: PresetInfo) -> dict[str, Form]:
    """The shapes and types that a preset's tensors must have, by name."""
    if info.of_many_strings:
        return {name: (shape, "F64") for name, shape in shapes_of_arrays(_configuration(info)).items()}
    import torch

    types = {
        torch.float32: "F32",
        torch.float64: "F64",
        torch.complex64: "C64",
        torch.int64: "I64",
        torch.bool: "BOOL",
    }
    weights = _empty_model(path, info).state_dict()
    return {name: (tuple(tensor.shape), types[tensor.dtype]) for name, tensor in weights.items()}


def _check_form(path: Path, name: str, expected: Form, tensor: Any) -> None:
    """Raise PresetError where a tensor of a file, not yet read, has another shape or type than expected."""
    shape, kind = tuple(tensor.get_shape()), tensor.get_dtype()
    if shape != expected[0]:
        raise PresetError(f"{path}: tensor {name!r} has shape {shape}, expected {expected[0]}; get the preset again")
    if kind != expected[1]:
        raise PresetError(f"{path}: tensor {name!r} is of type {kind}, expected {expected[1]}; get the preset again")


def _check_resonator(preset: Preset) -> None:
    """Sound follows the metadata and pictures the tensors: both must be of one string."""
    try:
        check_resonator(preset.weights, arrays_of(preset.info))
    except (ValueError, OverflowError) as error:
        raise PresetError(f"{preset.path}: metadata.string: {error}; get the preset again") from error


def arrays_of(info: PresetInfo) -> dict[str, NDArray[np.float64]]:
    """The weights that follow from the string, of a preset of many."""
    return resonator_arrays(_configuration(info), info.resonator, info.rate_hz, info.scale_m)


def _check_finite(path: Path, name: str, array: NDArray[Any]) -> None:
    if not np.isfinite(array).all():
        raise PresetError(f"{path}: tensor {name!r} holds values that are not finite; the preset cannot be used")

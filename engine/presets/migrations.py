"""The steps from metadata of earlier versions to those that this one reads, one for each version.

Every preset that was ever shipped loads for ever; weights are never changed on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

Metadata = dict[str, Any]

# What starts of version 1 knew, by their names. Blind ones had the symmetries, an integrated phase a latent a mode.
_BLIND = "that a string may be mirrored and its sign turned"
_COUNTED = ", and how many modes it has"
_LINEAR = "the modes of the string at rest"
_KNOWN_TO_VERSION_1 = {
    "physics": _LINEAR,
    "averaging": f"{_LINEAR}, and how tension couples them",
    "matching pursuit": "the modes of the string and the range of their frequencies",
    "blind matching pursuit": _BLIND,
    "phases of the displacement": _BLIND,
}


def _knows(data: Metadata) -> Metadata:
    """1 → 2: what a training received of the string stands in words of its own."""
    knows = _KNOWN_TO_VERSION_1.get(str(data.get("initialisation")), "")
    if knows == _BLIND and data.get("model") == "koopman_integrated":
        knows += _COUNTED
    return {**data, "knows": knows}


def _displacement_alone(data: Metadata) -> Metadata:
    """3 → 4: every model sets out from the displacement; no other input was ever shipped."""
    sizes = data.get("model_configuration")
    if not isinstance(sizes, dict):
        return data
    kind = sizes.get("input", "displacement")
    if kind != "displacement":
        raise UnknownVersion(
            f"model_configuration.input {kind!r} is no longer read; train the model again on displacement alone"
        )
    return {**data, "model_configuration": {name: value for name, value in sizes.items() if name != "input"}}


def _range_of_training(data: Metadata) -> Metadata:
    """Migrate 4 → 5: widths by shape, and no peak of plucks scaled to a rise of tension, as a family's are."""
    trained, family = data.get("trained_range"), data.get("family")
    if not isinstance(trained, dict):
        return data
    width = trained.get("width")
    if isinstance(family, dict):
        low, high = _pair(family.get("half_width"))
        widths: Any = {"gaussian": [low, high], "raised_cosine": [2 * low, 2 * high]}
        trained = {**trained, "peak_m": None}
    elif width is None:
        widths = None
    else:
        widths = {"gaussian": width} if data.get("initial") == "gaussian" else dict.fromkeys(_WITH_A_WIDTH, width)
    return {**data, "trained_range": {**trained, "width": widths}}


_WITH_A_WIDTH = ("gaussian", "raised_cosine")


def _pair(data: object) -> tuple[float, float]:
    """The two numbers of a pair; of anything else two zeros, for the family itself is refused."""
    if isinstance(data, list) and len(data) == 2 and all(type(number) in (int, float) for number in data):
        return data[0], data[1]
    return 0.0, 0.0


MIGRATIONS: Mapping[int, Callable[[Metadata], Metadata]] = {
    1: _knows,
    2: dict,  # a preset may be of a family of strings; those before are of one
    3: _displacement_alone,
    4: _range_of_training,
}
FORMAT_VERSION = max(MIGRATIONS) + 1


class UnknownVersion(ValueError):
    """A version that this program does not read; the message says what to do."""


def migrated(data: Metadata) -> Metadata:
    """Metadata of any version so far, as this version writes it.

    Raises:
        UnknownVersion: it has none, or a newer one.
    """
    version = data.get("format_version")
    if not isinstance(version, int) or isinstance(version, bool) or version < min(MIGRATIONS):
        raise UnknownVersion(f"format_version {version!r} is not known; get the preset again")
    if version > FORMAT_VERSION:
        raise UnknownVersion(
            f"format_version {version} is newer than this program's {FORMAT_VERSION}; update the program"
        )
    for step in range(version, FORMAT_VERSION):
        data = {**MIGRATIONS[step](data), "format_version": step + 1}
    return data

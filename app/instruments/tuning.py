"""The pitch of each key: twelve equal steps, or a Scala scale and keyboard mapping."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Self

import numpy as np
from pydantic import model_validator

from app.instruments.fields import HIGHEST_KEY, ScalaText, parameter
from app.instruments.scala import EQUAL_STEPS, Keymap, parse_keymap, parse_scale
from app.shared.value import Value
from engine.plain_text import one_line
from engine.schema import explained
from engine.whole_file import UnusableFile, read_bounded

A4_KEY, MIDDLE_KEY = 69, 60
SCALA_FILES = (".scl", ".kbm")
LARGEST_FILE_BYTES = 2**16
PITCHES_HZ = (1e-60, 1e60)  # of any key, so that their squares are numbers; farther ones are set to an end
NOTES = (-128, 255)  # all keys, with any transposition and bend


class TuningChoice(Value):
    """The choice of the pitch of each key.

    Attributes:
        a4_hz: pitch of key 69; a keyboard mapping has a reference pitch of its own.
        scale: the text of a .scl file, "" for twelve equal steps. Without a mapping it begins at key 60.
        keymap: the text of a .kbm file, "" for none.
        transpose: by how many keys everything sounds higher.
    """

    a4_hz: float = parameter("tuning.a4_hz")
    scale: ScalaText = ""
    keymap: ScalaText = ""
    transpose: int = parameter("tuning.transpose")

    @property
    def has_reference(self) -> bool:
        """Return True if a mapping gives all keys their pitch, so that `a4_hz` changes nothing."""
        if not self.keymap.strip():
            return False
        mapping = parse_keymap(self.keymap)
        return (mapping.first, mapping.last) == (0, HIGHEST_KEY)

    @model_validator(mode="after")
    def _gives_pitches(self) -> Self:
        Tuning(self)
        return self


class Tuning:
    """The pitch of each key.

    A mapping names the keys that it retunes. Others keep twelve equal steps, with key 69 at `a4_hz`. Beyond the
    keyboard, where only transposition and bends reach, pitches continue as at its ends.
    """

    def __init__(self, choice: TuningChoice) -> None:
        """Raise ValueError: the scale or the mapping is damaged, or gives no pitch; the message names the field."""
        self._transpose = choice.transpose
        self._a4_hz = choice.a4_hz
        self._table: tuple[np.ndarray, np.ndarray] | None = None  # mapped keys, and log₂ of their pitch in Hz
        if choice.scale.strip() or choice.keymap.strip():
            self._table = _table(choice)

    def hz(self, note: float) -> float:
        """The pitch of a key; between two keys interpolated in log frequency.

        A key that the mapping leaves out has a pitch between those of its neighbours, for slides; whether a key is to
        sound, `mapped` says.
        """
        note += self._transpose
        if self._table is None:
            return float(self._a4_hz * 2 ** ((note - A4_KEY) / 12))
        return float(2 ** np.interp(note, *self._table))

    def mapped(self, key: int) -> bool:
        """Return True if the keyboard mapping gives the key a pitch of its own.

        Keys that are left out stay silent.
        """
        return self._table is None or bool(np.isin(key + self._transpose, self._table[0]))


def read_scala(path: Path) -> str:
    """The text of a .scl or .kbm file, checked, for a `TuningChoice`.

    Raises:
        ValueError: it cannot be read, is too long, or can be no tuning; the message names the file, in one line.
    """
    try:
        raw = read_bounded(path, LARGEST_FILE_BYTES)
    except UnusableFile as error:
        raise ValueError(one_line(f"{path}: {error.strerror}; give a .scl or .kbm file")) from error
    except OSError as error:
        raise ValueError(one_line(f"{path}: cannot be read ({error.strerror}); check the name")) from error
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("cp1252", "replace")  # as Scala and other programs of Windows write
    text = "".join(" " if c.isspace() and c not in "\r\n\t" else c for c in text.rstrip("\x1a"))  # DOS's end of file
    if not text.strip():
        raise ValueError(one_line(f"{path}: is empty; give a .scl or .kbm file"))
    try:
        TuningChoice.model_validate({"keymap" if path.suffix.lower() == ".kbm" else "scale": text})
    except ValueError as error:
        raise ValueError(one_line(f"{path}: {explained(error)}")) from error
    return text


def _table(choice: TuningChoice) -> tuple[np.ndarray, np.ndarray]:
    """The notes, within NOTES, that are not left out, ascending, and log₂ of their pitches in Hz, (notes,) each.

    Raises:
        ValueError: scale or mapping cannot be read; the message names the field.
    """
    remedy = "give the text of a Scala file, or none"
    scale, mapping = EQUAL_STEPS, Keymap(0, HIGHEST_KEY, MIDDLE_KEY, A4_KEY, choice.a4_hz, 0, ())
    try:
        field = "scale"
        if choice.scale.strip():
            scale = parse_scale(choice.scale)
        field = "keymap"
        if choice.keymap.strip():
            mapping = parse_keymap(choice.keymap)
        reference = mapping.degree(mapping.reference, scale)
        if reference is None:
            raise ValueError(f"leaves out key {mapping.reference}, whose frequency it gives; map it, or name another")
    except ValueError as error:
        raise ValueError(f"{field}: {one_line(str(error), 200)}; {remedy}") from error
    base = math.log2(mapping.reference_hz) - scale.octaves_of(reference)  # of degree 0
    pitches: dict[int, float] = {}
    for note in range(NOTES[0], NOTES[1] + 1):
        if mapping.first <= min(max(note, 0), HIGHEST_KEY) <= mapping.last:
            degree = mapping.degree(note, scale)
            if degree is not None:
                pitches[note] = base + scale.octaves_of(degree)
        else:
            pitches[note] = math.log2(choice.a4_hz) + (note - A4_KEY) / 12
    return np.array(list(pitches)), np.clip(list(pitches.values()), *np.log2(PITCHES_HZ))

"""Which pitch each key has: twelve equal steps, or a Scala scale and keyboard mapping, read by `tuning_library`.

Source: the formats .scl and .kbm of Scala (Manuel Op de Coul), as Surge's tuning library understands them: every key
is retuned, whichever first and last one a mapping names. It is loaded only where there is a scale or a mapping.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Self

from pydantic import model_validator

from app.patches.fields import ScalaText, Value, explained, parameter
from engine.bounds import brief
from engine.plain_text import one_line
from engine.read_file import UnusableFile, read_bounded

if TYPE_CHECKING:
    import numpy as np

A4_KEY = 69
SCALA_FILES = (".scl", ".kbm")
LARGEST_FILE_BYTES = 2**16
MOST_NOTES = 1_000  # of a scale
LARGEST_MAPPED = 20_000.0  # of any number in a keyboard mapping: the library loops up to it
PITCHES_HZ = (1e-60, 1e60)  # of any key, so that their squares are numbers; what no string plays is refused there
NOTES = (-128, 255)  # all keys, with any transposition and bend


class TuningChoice(Value):
    """Which pitch each key has.

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

    @model_validator(mode="after")
    def _gives_pitches(self) -> Self:
        if self.scale or self.keymap:  # brings a library that few patches need
            Tuning(self)
        return self


class Tuning:
    """The pitch of each key."""

    def __init__(self, choice: TuningChoice) -> None:
        """Raises ValueError: the scale or the mapping is damaged, or gives no pitch; the message names the field."""
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
        import numpy as np  # patches are read without

        note += self._transpose
        if self._table is None:
            return float(self._a4_hz * 2 ** ((note - A4_KEY) / 12))
        return float(2 ** np.interp(note, *self._table))

    def mapped(self, key: int) -> bool:
        """Whether the keyboard mapping gives the key a pitch of its own; a key that is left out stays silent."""
        import numpy as np

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
        text = raw.decode("latin-1")  # as Scala itself writes
    if not text.strip():
        raise ValueError(one_line(f"{path}: is empty; give a .scl or .kbm file"))
    try:
        TuningChoice.model_validate({"keymap" if path.suffix.lower() == ".kbm" else "scale": text})
    except ValueError as error:
        raise ValueError(one_line(f"{path}: {explained(error)}")) from error
    return text


def _table(choice: TuningChoice) -> tuple[np.ndarray, np.ndarray]:
    import numpy as np
    import tuning_library

    # only comments and descriptions may hold other than ASCII, and they have no effect
    scale, keymap = (text.encode("ascii", "replace").decode() for text in (choice.scale, choice.keymap))
    _check_count(scale)
    field = "scale"
    try:
        if scale.strip():
            tones = tuning_library.parse_scl_data(scale)
            if tones.count > MOST_NOTES:
                raise ValueError(f"has {tones.count} notes, at most {MOST_NOTES} may be given")
        else:
            tones = tuning_library.even_temperament_12_note_scale()
        if keymap.strip():
            field = "keymap"
            _check_numbers(keymap)
            mapping = tuning_library.parse_kbm_data(keymap)
        else:
            mapping = tuning_library.tune_A69_to(choice.a4_hz)
        tuned = tuning_library.Tuning(tones, mapping)
    except (RuntimeError, ValueError, OverflowError, MemoryError) as error:
        remedy = "give the text of a Scala file, or none"
        raise ValueError(f"{field}: {one_line(str(error), 200).rstrip('.')}; {remedy}") from error
    mapped = np.array([note for note in range(NOTES[0], NOTES[1] + 1) if tuned.is_midi_note_mapped(note)])
    pitch_hz = np.array([tuned.frequency_for_midi_note(int(note)) for note in mapped])
    bad = mapped[~((pitch_hz > PITCHES_HZ[0]) & (pitch_hz < PITCHES_HZ[1]))]  # not a number is neither
    if not len(mapped) or len(bad):
        reported = f"key {bad[0]}" if len(bad) else "any key"
        raise ValueError(
            f"{field}: gives no pitch to {reported}; its intervals or its reference pitch are impossible"
        )
    return mapped, np.log2(pitch_hz)


def _check_count(scale: str) -> None:
    """Raises ValueError where a scale lists other than as many notes as it says, with both counts.

    Notes are the lines below the count that begin with a number; a file that has no count is the library's to refuse.
    """
    lines = [line.strip() for line in scale.splitlines() if not line.startswith("!")]
    words = lines[1].split() if len(lines) > 1 else []
    said = words[0].lstrip("0") if words else ""
    if not said.isdecimal():
        return
    listed = sum(line.startswith(tuple("+-.0123456789")) for line in lines[2:])
    if said != str(listed):
        raise ValueError(f"scale: says {said[:20]} notes and lists {listed}; correct its count or its list of notes")


def _check_numbers(keymap: str) -> None:
    """Raises ValueError where a number of a keyboard mapping would keep the library in a loop."""
    for line in keymap.splitlines():
        words = line.split()
        if not words or words[0].startswith("!") or words[0] == "x":
            continue
        try:
            fits = 0 <= float(words[0]) <= LARGEST_MAPPED
        except ValueError:
            fits = False
        if not fits:
            raise ValueError(f"{brief(words[0])} is no number of 0 … {LARGEST_MAPPED:g}")

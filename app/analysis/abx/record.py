"""The result of a test: score and p-value from its trials, and the JSON file that keeps it."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from platformdirs import user_documents_path
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, computed_field

from app.analysis.abx.trials import LEVEL, MOST_TRIALS, Trial, p_value
from app.export.recipe import fields_of
from app.rendering.note_sound import NoteSound
from app.rendering.subject import path_of, string_of
from app.shared.version import program_version
from engine.plain_text import name_text
from engine.presets import preset_digest
from engine.whole_file import WriteError, explain, result_file

MEANING = (
    "The p-value is the probability that guessing alone would give at least this many right answers. "
    f"Below {LEVEL:g}, luck is an unlikely explanation; a larger value does not show that A and B sound the same, "
    "only that this test did not tell them apart."
)


class Candidate(BaseModel):
    """A or B.

    Attributes:
        label: its name for people.
        preset, preset_sha256: the preset that made it; for the truth, the one whose string it is.
        gain_db: its attenuation.
    """

    model_config = ConfigDict(frozen=True)

    label: str
    preset: str
    preset_sha256: str
    gain_db: float = 0.0


class AbxRecord(BaseModel):
    """The result; before the test what is compared, without trials.

    Attributes:
        words: what is compared, for people.
        pluck: fields of `SoundRecipe`.
        through: the sound device, and how it was played.
        trials: those that were answered, in order.
        remark: why the test is not complete, if that is known.
    """

    model_config = ConfigDict(frozen=True)

    kind: Literal["learned-strings-abx"] = "learned-strings-abx"
    program: str = Field(default_factory=program_version)
    date: AwareDatetime = Field(default_factory=lambda: datetime.now().astimezone().replace(microsecond=0))
    a: Candidate
    b: Candidate
    words: str = ""
    pluck: dict[str, object]
    through: dict[str, object]
    planned_trials: Annotated[int, Field(ge=1, le=MOST_TRIALS)]
    seed: int
    trials: Annotated[tuple[Trial, ...], Field(max_length=MOST_TRIALS)] = ()
    remark: str = ""

    @computed_field  # type: ignore[prop-decorator]
    @property
    def correct(self) -> int:
        """The number of right answers."""
        return sum(trial.correct for trial in self.trials)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def p_value(self) -> float | None:
        """The p-value; None unless the test is complete: stopping early would bias it."""
        return p_value(self.correct, self.planned_trials) if self.complete else None

    @property
    def complete(self) -> bool:
        return len(self.trials) == self.planned_trials

    @property
    def verdict(self) -> str:
        """The conclusion from the result, in a sentence."""
        if self.p_value is None:
            return "The test was not completed, so no p-value can be given."
        if self.p_value < LEVEL:
            return "You can tell them apart: luck is an unlikely explanation."
        return "This test did not show that you can tell them apart."


def material_of(sound: NoteSound, words: str, volume_db: float) -> AbxRecord:
    """Model (A) and truth (B) of a note.

    Args:
        words: for people.

    Raises:
        PresetError: its preset's file cannot be read.
    """
    path = path_of(sound.preset)
    name, digest = name_text(path.stem), preset_digest(path)
    a, b = (Candidate(label=label, preset=name, preset_sha256=digest) for label in ("Model", "Truth"))
    pluck = {"string": None if sound.struck else string_of(sound.preset), **fields_of(sound)}
    return AbxRecord(a=a, b=b, words=words, pluck=pluck, through={"volume_db": volume_db}, planned_trials=1, seed=0)


def p_text(p_value: float) -> str:
    """A p-value for people: three decimals, the smallest as a bound."""
    return "p < 0.001" if p_value < 0.001 else f"p = {p_value:.3f}"


def default_folder() -> Path:
    """The folder of results within the user's documents."""
    return user_documents_path() / "Learned Strings" / "Listening tests"


def save_record(folder: Path, record: AbxRecord) -> Path:
    """Write a new file, whole or not at all, and return its path; make the folder, overwrite no earlier result.

    Raises:
        WriteError: the folder or the file cannot be written.
    """
    stem = f"abx_{record.date:%Y-%m-%d_%H-%M-%S}"
    path, again = folder / f"{stem}.json", 2
    while path.exists():
        path, again = folder / f"{stem}_{again}.json", again + 1
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(explain(folder, error)) from error
    with result_file(path) as file:
        file.write(record.model_dump_json(indent=2).encode("utf-8"))
    return path

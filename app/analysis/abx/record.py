"""The record of a test: a JSON file with what was played, what was answered, and the result.

A record is checked when it is read: its numbers must follow from its trials, and its order from its seed, so that a
damaged or edited file is refused.
"""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from platformdirs import user_documents_path
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError, model_validator

from app.analysis.abx.trials import LARGEST_SEED, MOST_TRIALS, Run, Trial, draw_order, p_value
from app.patches.patch import PhysicalString
from app.shared.version import program_version
from app.shared.vocabulary import Pickup
from app.shared.whole_file import WriteError, explain, whole_file
from engine.plain_text import one_line
from engine.pluck import LARGEST_AMPLITUDE_MM, POSITION_RANGE, WIDTH_RANGE, Shape
from engine.read_file import UnusableFile, read_bounded
from engine.schema import SchemaError, parse_json

KIND: Literal["learned-strings-abx"] = "learned-strings-abx"
VERSION: Literal[2] = 2  # 1 did not tell the string
LARGEST_FILE_BYTES = 2**20  # 200 trials are a tenth of that

Finite = Annotated[float, Field(allow_inf_nan=False)]
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
_FROZEN = ConfigDict(frozen=True, extra="forbid")


class RecordError(ValueError):
    """A record cannot be used. The message, one line, names the file, what is wrong with it and the remedy."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class HeardSource(BaseModel):
    """A or B: its name for people, the preset that made it (for the truth, the one whose string it is), its gain."""

    model_config = _FROZEN

    label: str
    preset: str
    preset_sha256: Sha256
    gain_db: Annotated[float, Field(le=0, allow_inf_nan=False)]


class HeardPluck(BaseModel):
    """The pluck, and where and how it was heard; positions and width as fractions of the string's length.

    Attributes:
        string: which one was chosen, of a preset of many; None: the preset's own.
    """

    model_config = _FROZEN

    position: Annotated[float, Field(ge=POSITION_RANGE[0], le=POSITION_RANGE[1])]
    amplitude_mm: Annotated[float, Field(ge=0, le=LARGEST_AMPLITUDE_MM)]
    shape: Shape
    width: Annotated[float, Field(ge=WIDTH_RANGE[0], le=WIDTH_RANGE[1])]
    listen: Annotated[float, Field(ge=0, le=1)]  # the left or only one
    listen_right: Annotated[float, Field(ge=0, le=1)] | None = None
    pickup: Pickup = "displacement"
    solo: Annotated[int, Field(ge=0)] = 0
    seconds: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    string: PhysicalString | None = None


class HeardThrough(BaseModel):
    """The sound device, and how it was played."""

    model_config = _FROZEN

    device: str
    host_api: str
    rate_hz: Annotated[int, Field(gt=0)]
    volume_db: Finite
    restart_at_switch: bool


class AbxRecord(BaseModel):
    """See the module.

    Attributes:
        trials: those that were answered, in order.
        correct: how many of them were answered right.
        p_value: None unless the test is complete: stopping early would bias it.
        remark: why it is not complete, if that is known.
    """

    model_config = _FROZEN

    kind: Literal["learned-strings-abx"]
    version: Literal[1, 2]
    program: str
    date: AwareDatetime
    a: HeardSource
    b: HeardSource
    pluck: HeardPluck
    through: HeardThrough
    planned_trials: Annotated[int, Field(ge=1, le=MOST_TRIALS)]
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)]
    trials: tuple[Trial, ...]
    correct: int
    p_value: Finite | None
    complete: bool
    remark: str = ""

    @model_validator(mode="after")
    def _numbers_follow_from_trials(self) -> AbxRecord:
        if self.version == 1 and self.pluck.string is not None:
            raise ValueError("pluck.string belongs to version 2")
        answered = len(self.trials)
        if self.complete != (answered == self.planned_trials) or answered > self.planned_trials:
            raise ValueError(f"complete does not fit {answered} answers to {self.planned_trials} trials")
        if tuple(trial.x for trial in self.trials) != draw_order(self.seed, self.planned_trials)[:answered]:
            raise ValueError("the trials are not in the order of the seed")
        if self.correct != sum(trial.correct for trial in self.trials):
            raise ValueError("correct is not the number of right answers")
        expected = p_value(self.correct, answered) if self.complete else None
        if expected is None or self.p_value is None:
            if expected is not self.p_value:
                raise ValueError("p_value belongs to a complete test, and to no other")
        elif not math.isclose(expected, self.p_value, rel_tol=1e-6):
            raise ValueError(f"p_value is {self.p_value:g}, but the answers give {expected:g}")
        return self


def default_folder() -> Path:
    """Where records are saved by default: a folder within the user's documents."""
    return user_documents_path() / "Learned Strings" / "Listening tests"


def save_record(folder: Path, record: AbxRecord) -> Path:
    """Writes a new file, whole or not at all, and returns its path; makes the folder, overwrites no earlier record.

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
    with whole_file(path) as file:
        file.write(record.model_dump_json(indent=2).encode("utf-8"))
    return path


def load_record(path: Path) -> AbxRecord:
    """Reads and checks one file.

    Raises:
        RecordError: it is missing, damaged, edited, or of a newer version.
    """
    try:
        data = parse_json(read_bounded(path, LARGEST_FILE_BYTES), "the record")
    except UnusableFile as error:
        raise RecordError(f"{path}: {error.strerror}; choose the record of a listening test") from error
    except OSError as error:
        raise RecordError(f"{path}: cannot be read ({error.strerror}); check the name") from error
    except SchemaError as error:
        told = "not a JSON file, or cut short; choose the record of a listening test"
        raise RecordError(one_line(f"{path}: {told} ({error})")) from error
    try:
        return AbxRecord.model_validate(data)
    except ValidationError as error:
        raise RecordError(_explain(path, error)) from error
    except OverflowError as error:
        raise RecordError(f"{path}: holds a number that is too large ({error}); choose another file") from error


def list_records(folder: Path) -> tuple[list[tuple[Path, AbxRecord]], list[str]]:
    """The records of a folder, the latest first, and a line for each file that cannot be used."""
    found, problems = [], []
    for path in folder.glob("abx_*.json"):
        try:
            found.append((path, load_record(path)))
        except RecordError as error:
            problems.append(str(error))
    return sorted(found, key=lambda entry: entry[1].date, reverse=True), problems


def make_record(
    run: Run, a: HeardSource, b: HeardSource, pluck: HeardPluck, through: HeardThrough, remark: str = ""
) -> AbxRecord:
    """The record of a run as it stands, dated now."""
    correct = sum(trial.correct for trial in run.trials)
    return AbxRecord(
        kind=KIND,
        version=VERSION,
        program=program_version(),
        date=datetime.now().astimezone().replace(microsecond=0),
        a=a,
        b=b,
        pluck=pluck,
        through=through,
        planned_trials=run.planned,
        seed=run.seed,
        trials=run.trials,
        correct=correct,
        p_value=p_value(correct, run.planned) if run.complete else None,
        complete=run.complete,
        remark=remark,
    )


def _explain(path: Path, error: ValidationError) -> str:
    faults = error.errors(include_url=False, include_input=False)
    first, fields = faults[0], {entry["loc"][0] for entry in faults if entry["loc"]}
    if "kind" in fields or (not first["loc"] and first["type"] != "value_error"):
        return f"{path}: not the record of a listening test; choose another file"
    if "version" in fields:
        return f"{path}: of a version that is not known here; read it with a newer Learned Strings"
    field = ".".join(map(str, first["loc"]))
    what = first["msg"].removeprefix("Value error, ")
    return f"{path}: {f'{field}: ' if field else ''}{what}; the file was damaged or edited"

"""The result of a test: its words, and the JSON file that keeps it.

Score and p-value follow from the trials. The file has them for its readers; they are computed again when it is read.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from platformdirs import user_documents_path
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError, computed_field

from app.analysis.abx.trials import LEVEL, MOST_TRIALS, Trial, p_value
from app.presets.library import PresetEntry
from app.session.choices import Choices, PluckedString
from app.session.listener import Listener
from app.shared.version import program_version
from engine.presets import preset_digest
from engine.read_file import read_bounded
from engine.result_file import WriteError, explain, whole_file
from engine.schema import SchemaError, parse_json

KIND: Literal["learned-strings-abx"] = "learned-strings-abx"
LARGEST_FILE_BYTES = 2**20  # 200 trials are a tenth of that
SCORE_FIELDS = {"kind", "trials", "planned_trials", "correct", "complete", "p_value"}
PLUCK_FIELDS = {"seconds", *PluckedString.model_fields, *Listener.model_fields} - {"listen_right", "stereo"}
MEANING = (
    "The p-value is the probability that guessing alone would give at least this many right answers. "
    f"Below {LEVEL:g}, luck is an unlikely explanation; a larger value does not show that A and B sound the same, "
    "only that this test did not tell them apart."
)


class Candidate(BaseModel):
    """A sound that can be A or B.

    Attributes:
        source: its name among the sounds of a pluck.
        label: its name for people.
        preset, preset_sha256: the preset that made it; for the truth, the one whose string it is.
        gain_db: its attenuation.
    """

    model_config = ConfigDict(frozen=True)

    source: str = ""
    label: str
    preset: str
    preset_sha256: str
    gain_db: float = 0.0


@dataclass(frozen=True)
class Material:
    """What is compared.

    Attributes:
        candidates: two or more; the first two are A and B until others are chosen.
        pluck: its fields, and where it is heard, by name.
        volume_db: of the playback, which stays the same during the test.
    """

    candidates: tuple[Candidate, ...]
    pluck: dict[str, object]
    volume_db: float


def material_of(entry: PresetEntry, choices: Choices) -> Material:
    """Model and truth of a preset, plucked and heard as chosen.

    Raises:
        PresetError: its file cannot be read.
    """
    made = {"preset": entry.name, "preset_sha256": preset_digest(entry.path)}
    candidates = tuple(Candidate(source=name, label=name.capitalize(), **made) for name in ("model", "truth"))
    fields = PLUCK_FIELDS | ({"listen_right"} if choices.stereo else set())
    return Material(candidates, choices.model_dump(mode="json", include=fields), choices.volume_db)


class AbxRecord(BaseModel):
    """The result.

    Attributes:
        pluck: see `Material`.
        through: the sound device, and how it was played.
        trials: those that were answered, in order.
        remark: why the test is not complete, if that is known.
    """

    model_config = ConfigDict(frozen=True)

    kind: Literal["learned-strings-abx"] = KIND
    program: str = Field(default_factory=program_version)
    date: AwareDatetime = Field(default_factory=lambda: datetime.now().astimezone().replace(microsecond=0))
    a: Candidate
    b: Candidate
    pluck: dict[str, object]
    through: dict[str, object]
    planned_trials: Annotated[int, Field(ge=1, le=MOST_TRIALS)]
    seed: int
    trials: Annotated[tuple[Trial, ...], Field(max_length=MOST_TRIALS)]
    remark: str = ""

    @computed_field  # type: ignore[prop-decorator]
    @property
    def correct(self) -> int:
        """The number of right answers."""
        return sum(trial.correct for trial in self.trials)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def complete(self) -> bool:
        return len(self.trials) == self.planned_trials

    @computed_field  # type: ignore[prop-decorator]
    @property
    def p_value(self) -> float | None:
        """None unless the test is complete: stopping early would bias it."""
        return p_value(self.correct, self.planned_trials) if self.complete else None

    @property
    def verdict(self) -> str:
        """What follows from the result, in a sentence."""
        if self.p_value is None:
            return "The test was not completed, so no p-value can be given."
        if self.p_value < LEVEL:
            return "You can tell them apart: luck is an unlikely explanation."
        return "This test did not show that you can tell them apart."


def p_text(p_value: float) -> str:
    """A p-value for people: three decimals, the smallest as a bound."""
    return "p < 0.001" if p_value < 0.001 else f"p = {p_value:.3f}"


def as_text(record: AbxRecord) -> str:
    """The result and its circumstances, a line each."""
    p = "incomplete" if record.p_value is None else p_text(record.p_value)
    lines = [f"{record.correct} of {len(record.trials)} right, {record.planned_trials} planned: {p}", record.verdict]
    for name, value in record.model_dump(mode="json", exclude=SCORE_FIELDS).items():
        parts = [f"{key} {each}" for key, each in value.items()] if isinstance(value, dict) else [f"{value}"]
        lines.append(f"{name:<14} {', '.join(parts)}")
    lines += [f"trial {n}: X is {t.x}, answer {t.answer}" for n, t in enumerate(record.trials, 1)]
    return "\n".join(lines) + "\n"


def default_folder() -> Path:
    """The folder of results within the user's documents."""
    return user_documents_path() / "Learned Strings" / "Listening tests"


def save_record(folder: Path, record: AbxRecord) -> Path:
    """Writes a new file, whole or not at all, and returns its path; makes the folder, overwrites no earlier result.

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
    """Reads a result, of this version or an earlier one.

    Raises:
        SchemaError: it is missing, damaged, or no result of a listening test.
    """
    try:
        return AbxRecord.model_validate(parse_json(read_bounded(path, LARGEST_FILE_BYTES), "the result"))
    except OSError as error:
        raise SchemaError(f"{path}: {error.strerror}; choose the result of a listening test") from error
    except (SchemaError, ValidationError, OverflowError) as error:
        raise SchemaError(f"{path}: not the result of a listening test, or damaged ({error})") from error

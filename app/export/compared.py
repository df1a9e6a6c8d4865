"""Several models on one pluck as a folder: of each its model, truth and difference as sound files, and a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from app.export.choices import ExportChoices
from app.export.columns import Columns
from app.export.note import default_file_name, export_sounds
from app.export.wav import WavSettings
from app.rendering.note_sound import NoteSound
from app.shared.vocabulary import Source
from app.shared.worker import Progress
from engine.presets import Preset
from engine.sources import Runaway
from engine.whole_file import WriteError, explain, whole_folder

TABLE = "models.csv"
SOURCES: tuple[Source, ...] = ("model", "truth", "difference")


@dataclass(frozen=True)
class ComparedModels:
    """Several models on one pluck.

    Attributes:
        words: the pluck, for people; `name`: for a folder.
        lines: the sound of each model and its figures.
    """

    words: str
    name: str
    lines: Sequence[tuple[NoteSound, Mapping[str, object]]]


@dataclass(frozen=True)
class ComparedExport:
    """The export of models on one pluck. See `ExportJob`.

    Attributes:
        file: the folder that is made; `ending`: of the sounds in it.
    """

    models: ComparedModels
    file: Path
    settings: WavSettings
    ending: str = ".wav"
    cancelled = "nothing was written."

    @classmethod
    def chosen(cls, models: ComparedModels, folder: Path, choices: ExportChoices) -> ComparedExport:
        """The export as the window's choices have it: each file as long as its pluck."""
        return cls(models, folder, replace(choices.wav, decay_db=None, difference_gain_db=0.0), choices.ending)

    def run(self, progress: Progress) -> str:
        """Write the folder, which must not exist yet; see `ExportJob`. A model that ran away has no files."""
        check_new(self.file)
        table = []
        try:
            with whole_folder(self.file) as made:
                try:
                    for done, (sound, figures) in enumerate(self.models.lines):
                        share, of = done / len(self.models.lines), 1 / len(self.models.lines)
                        report = partial(_part, progress, share, of, f"Model {done + 1} of {len(self.models.lines)}")
                        table.append({**figures, **self._write(made, sound, report)})
                    columns = Columns({name: [line[name] for line in table] for name in table[0]})
                    (made / TABLE).write_text(columns.text, encoding="utf-8", newline="")
                except WriteError as error:  # which names the folder that is not there yet
                    raise WriteError(str(error).replace(str(made), str(self.file))) from error
        except OSError as error:
            raise WriteError(explain(self.file, error)) from error
        failed = [str(line["preset"]) for line in table if not line["model_file"]]
        count = models_word(len(table) - len(failed))
        lines = [f"Saved {self.file}: {count}, each with truth and difference, and {TABLE}."]
        return "\n".join(lines + ([f"Ran away, without files: {', '.join(failed)}."] if failed else []))

    def _write(self, made: Path, sound: NoteSound, progress: Progress) -> dict[str, object]:
        """Write the files of a model; the columns of its names and gains, which are empty where it ran away."""
        preset = sound.load(self.settings.rate_hz)
        paths = {source: _unused(made, sound, preset, self.ending, source) for source in SOURCES}
        try:
            reports = export_sounds(sound, preset, paths, self.settings, progress)
        except Runaway:
            return {f"{source}_file": "" for source in SOURCES} | {"gain_db": None, "clipped": None}
        names = {f"{source}_file": path.name for source, path in paths.items()}
        return names | {"gain_db": reports[0].gain_db, "clipped": sum(report.clipped for report in reports)}


def check_new(out: Path) -> None:
    """Raise WriteError where such a folder or file is there, as nothing is replaced, or where none can be made."""
    if out.exists():
        raise WriteError(f"{out}: is there already; choose another name")
    if not out.parent.is_dir():
        raise WriteError(f"{out.parent}: no such folder; make it first, or choose another")


def models_word(count: int) -> str:
    return f"{count} model{'s' if count != 1 else ''}"


def _part(progress: Progress, before: float, of: float, text: str, share: float, *_: object) -> None:
    """Report the share of a part as one of the whole, in which it begins at `before` and takes `of`."""
    progress(before + of * share, text)


def _unused(folder: Path, sound: NoteSound, preset: Preset, ending: str, source: Source) -> Path:
    """A file's path that no other preset has, for names of files may differ in what cannot be in them."""
    name, rate_hz = preset.name, preset.info.rate_hz
    while (path := folder / default_file_name(name, sound.pluck, rate_hz, source, ending)).exists():
        name = f"_{name}"
    return path

"""Models on one pluck as a folder: levels, differences, recipes and the table; whole, or not at all."""

from __future__ import annotations

import csv
import errno
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
import torch

from app.export import compared
from app.export.compared import TABLE, ComparedExport, ComparedModels
from app.export.recipe import read_recipe
from app.export.wav import WavSettings
from app.rendering.note_sound import NoteSound
from app.shared.worker import Cancelled
from engine.levels import MATCHED_S
from engine.pluck import Pluck
from engine.presets import load_preset, save_preset
from engine.values.ear import Ear
from engine.whole_file import WriteError
from tests.app.sounds import export_sound

PLAIN = WavSettings("32f", fade_out_s=0.0)


@pytest.fixture
def presets(small_preset: Path, tmp_path: Path) -> list[Path]:
    """Three: half as loud, as it is, and one that runs away."""
    paths = [tmp_path / f"{name}.safetensors" for name in ("soft", "small", "wild")]
    for path, factor, offset in zip(paths, (0.5, 1.0, 1.0), (0.0, 0.0, 1e6), strict=True):
        shutil.copy(small_preset, path)
        preset = load_preset(path)
        decoder: Any = preset.model.decoder  # type: ignore[union-attr]
        with torch.no_grad():
            decoder.weight.mul_(factor)
            decoder.bias.add_(offset)
        save_preset(path, preset.info, preset.model)
    return paths


@pytest.fixture
def models(presets: list[Path]) -> ComparedModels:
    sounds = [NoteSound(path, Pluck(0.5, 4.0), 1.5, Ear((0.37, 0.6))) for path in presets]
    return ComparedModels("", "", [(sound, {"preset": "=1+1", "rel_mae": 0.5}) for sound in sounds])


def written(job: ComparedExport, progress: Any = lambda *_: None) -> tuple[str, list[dict[str, str]]]:
    """What it says, and the table."""
    said = job.run(progress)
    with (job.file / TABLE).open(encoding="utf-8", newline="") as file:
        return said, list(csv.DictReader(file))


@pytest.mark.parametrize("match", [False, True])
def test_each_model_has_its_files_and_its_level_is_matched_where_it_is_chosen(
    models: ComparedModels, tmp_path: Path, match: bool
) -> None:
    shares: list[float] = []
    job = ComparedExport(models, tmp_path / "out", replace(PLAIN, level_match=match))
    said, table = written(job, lambda share, *_: shares.append(share))
    assert "2 models" in said and "Ran away" in said and shares == sorted(shares)
    for line, factor in zip(table, (0.5, 1.0), strict=False):
        sounds = [soundfile.read(job.file / line[f"{name}_file"])[0] for name in compared.SOURCES]
        model, truth, difference = sounds
        assert difference == pytest.approx(model - truth, abs=1e-6)
        levels = [np.sqrt(np.square(sound[: round(MATCHED_S * 4000)]).mean()) for sound in sounds[:2]]
        assert levels[0] / levels[1] == pytest.approx(1.0 if match else factor, rel=1e-4 if match else 0.1)
    assert [line["model_file"] for line in table[2:]] == [""], "the one that runs away has a line alone"
    assert {line["preset"] for line in table} == {"'=1+1"}, "no formula for a spreadsheet"
    listed = {line[f"{name}_file"] for line in table[:2] for name in compared.SOURCES}
    assert {path.name for path in job.file.iterdir()} == listed | {TABLE} and len(listed) == 6
    for source in compared.SOURCES:
        first, again = job.file / table[0][f"{source}_file"], tmp_path / "again.wav"
        recipe = read_recipe(first)
        assert recipe.level_match == match
        export_sound(recipe.sound(models.lines[0][0].preset, first), again, recipe.source, recipe.settings)  # type: ignore[arg-type]
        assert first.read_bytes() == again.read_bytes()


def test_a_folder_that_is_there_stays_and_what_is_not_whole_is_not_left(
    models: ComparedModels, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    job = ComparedExport(models, out, PLAIN)

    def cancel(share: float, *_: object) -> None:
        if share > 0.4:
            raise Cancelled

    with pytest.raises(Cancelled):
        job.run(cancel)
    monkeypatch.setattr(compared, "Columns", lambda _: exec("raise OSError(errno.ENOSPC, 'full')", {"errno": errno}))
    with pytest.raises(WriteError, match=r"out: cannot be written \(full\); free some space"):
        job.run(lambda *_: None)
    assert {path.suffix for path in tmp_path.iterdir()} == {".safetensors"}
    with pytest.raises(WriteError, match="none: no such folder"):
        replace(job, file=tmp_path / "none" / "out").run(lambda *_: None)
    out.mkdir()
    (out / "mine.txt").write_text("mine")
    with pytest.raises(WriteError, match="is there already"):
        job.run(lambda *_: None)
    assert [path.name for path in out.iterdir()] == ["mine.txt"]

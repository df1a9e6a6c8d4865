"""batch on the command line, and what it is made of."""

from __future__ import annotations

import csv
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import soundfile

from app.export import batch, sound
from app.export.batch import BatchPlan, run_batch
from app.export.files import export_sound
from app.export.sound import SoundRequest
from app.shared.worker import Cancelled
from engine.pluck import Pluck
from engine.presets import find_string, load_preset
from engine.sources import Runaway


@pytest.fixture
def words(small_preset: Path, tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """A command line for two presets, two positions and one amplitude."""
    shipped = tmp_path / "shipped"
    shipped.mkdir()
    for name in ("a", "b"):
        shutil.copy(small_preset, shipped / f"{name}.safetensors")
    monkeypatch.setattr("engine.presets.finding.SHIPPED", shipped)
    lists = ["--presets", "a,b", "--positions", "0.3, 0.45", "--amplitudes", "2"]
    return ["batch", *lists, "--seconds", 0.15, "--out", folder / "out"]


def index(folder: Path) -> list[dict[str, str]]:
    with (folder / "out" / "index.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def plan(small_preset: Path, folder: Path) -> BatchPlan:
    return BatchPlan((small_preset,), (0.3, 0.4), (1.0, 2.0), ("model", "truth"), folder / "out", 0.15, 0.37)


def test_every_combination_is_a_file_and_a_row(run, words: list[object], folder: Path, small_preset: Path) -> None:
    found = run(*words, "--sources", "model,truth")
    assert (found.status, found.err) == (0, "")
    assert found.out == f"{folder / 'out' / 'index.csv'}: 8 written, 0 kept, 0 failed\n"
    rows = index(folder)
    assert len(rows) == 8
    assert sorted(row["file"] for row in rows) == sorted(p.name for p in (folder / "out").glob("*.wav"))
    one = next(row for row in rows if row["file"] == "b_x0.45_a2.0_4000_model.wav")
    assert (one["status"], one["preset"], one["clipped"], float(one["seconds"])) == ("written", "b", "0", 0.15)
    assert 0 < float(one["rel_mae_trained"]) < 2
    assert all((row["rel_mae"] == "") == (row["source"] == "truth") for row in rows)
    expected = folder / "one.wav"
    request = SoundRequest(load_preset(small_preset), Pluck(0.45, 2.0), 0.37, 0.15)
    report = export_sound(request, expected)
    assert float(one["peak_db"]) == pytest.approx(report.peak_db, abs=0.01)
    assert (soundfile.read(folder / "out" / one["file"])[0] == soundfile.read(expected)[0]).all()


def test_it_goes_on_where_it_was(run, words: list[object], folder: Path) -> None:
    run(*words)
    before = index(folder)
    gone = folder / "out" / "a_x0.30_a2.0_4000_model.wav"
    gone.unlink()
    times = {path: path.stat().st_mtime_ns for path in (folder / "out").glob("*.wav")}
    assert "1 written, 3 kept, 0 failed" in run(*words).out
    assert gone.exists()
    assert {path: path.stat().st_mtime_ns for path in times} == times
    assert {row["file"]: row["rel_mae"] for row in index(folder)} == {row["file"]: row["rel_mae"] for row in before}
    assert "4 written, 0 kept, 0 failed" in run(*words, "--overwrite").out


def test_files_without_their_rows_are_made_again_as_they_were(run, words: list[object], folder: Path) -> None:
    """As a kill between files and index leaves them: a row of a kept file would lack levels and errors."""
    run(*words)
    before = {path.name: path.read_bytes() for path in (folder / "out").iterdir()}
    (folder / "out" / "index.csv").write_text("file,status,preset\nnothing of use")
    assert "4 written, 0 kept" in run(*words).out
    assert {path.name: path.read_bytes() for path in (folder / "out").iterdir()} == before


def test_another_sound_of_the_name_is_reported_and_stays(run, words: list[object], folder: Path) -> None:
    run(*words)
    path = folder / "out" / "a_x0.30_a2.0_4000_model.wav"
    before = path.read_bytes()
    found = run(*words, "--listen", 0.2)
    assert found.status == 1
    assert "there is another sound of this name" in found.err
    assert path.read_bytes() == before
    assert run(*words, "--listen", 0.2, "--overwrite").status == 0
    with soundfile.SoundFile(path) as file:
        assert json.loads(file.comment)["listen"] == 0.2


def test_the_figures_of_a_file_that_stays_stay(run, words: list[object], folder: Path) -> None:
    run(*words)
    before = index(folder)
    assert run(*words, "--listen", 0.2).status == 1
    assert index(folder) == before


def test_a_table_of_another_program_is_not_replaced(run, words: list[object], folder: Path) -> None:
    (folder / "out").mkdir()
    table = folder / "out" / "index.csv"
    table.write_text("song,bpm\nAve Maria,72\n")
    found = run(*words)
    assert found.status == 1
    assert "index.csv: is there already, and no index of a batch; choose another folder" in found.err
    assert table.read_text() == "song,bpm\nAve Maria,72\n"
    assert list((folder / "out").iterdir()) == [table]


def test_two_presets_of_one_name_are_not_one_file(small_preset: Path, folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other" / small_preset.name
    other.parent.mkdir()
    shutil.copy(small_preset, other)
    with pytest.raises(ValueError, match="same file: small"):
        replace(plan(small_preset, folder), presets=(small_preset, other))


def test_a_broken_preset_hinders_no_other(run, words: list[object], folder: Path, tmp_path: Path) -> None:
    (tmp_path / "shipped" / "a.safetensors").write_bytes(b"?")
    found = run(*words)
    assert found.status == 1
    assert "2 written, 0 kept, 2 failed" in found.out
    assert "a.safetensors: not a whole safetensors file" in found.err
    assert "2 of 4 files were not made" in found.err.splitlines()[-1]


def test_a_model_that_runs_away_leaves_the_truth(
    small_preset: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Away(sound.ModelSource):
        def advance(self, *_: object) -> None:
            raise Runaway(0.01)

    monkeypatch.setattr(sound, "ModelSource", Away)
    rows = run_batch(plan(small_preset, folder))
    assert {(row.source, row.status) for row in rows} == {("model", "failed"), ("truth", "written")}
    assert all("diverges" in row.message for row in rows if row.source == "model")
    assert len(list((folder / "out").glob("*.wav"))) == 4


def test_cancelling_keeps_whole_files_and_their_rows(small_preset: Path, folder: Path) -> None:
    seen: list[tuple[float, str]] = []

    def progress(share: float, text: str) -> None:
        seen.append((share, text))
        if share > 0.3:
            raise Cancelled

    with pytest.raises(Cancelled):
        run_batch(plan(small_preset, folder), progress)
    assert 0 < len(index(folder)) < 8
    assert sorted(row["file"] for row in index(folder)) == sorted(p.name for p in (folder / "out").glob("*.wav"))
    assert seen == sorted(seen, key=lambda one: one[0])
    assert "position 0.3, 1 mm" in seen[0][1]
    assert {row.status for row in run_batch(plan(small_preset, folder))} == {"kept", "written"}
    assert list((folder / "out").glob(".*.unfinished")) == []


def test_cancelling_before_the_first_file_leaves_no_index(small_preset: Path, folder: Path) -> None:
    def progress(*_: object) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        run_batch(plan(small_preset, folder), progress)
    assert list((folder / "out").iterdir()) == []


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--positions", "0.2,x"], "--positions: must be numbers"),
        (["--positions", ","], "--positions: give at least one number"),
        (["--positions", "0"], "--position: must lie in 0.02 … 0.98"),
        (["--amplitudes", "1,1"], "amplitudes: one is given twice"),
        (["--sources", "all"], "all is not one of model, truth, difference, both"),
        (["--seconds", "0"], ""),
    ],
)
def test_lists_that_are_no_lists_are_bad_usage(run, words: list[object], more: list[str], message: str) -> None:
    if more[0] == "--seconds":
        assert "seconds must be above 0" in run(*words, *more).err
    else:
        assert message in run(*words, *more).usage.replace("'", "")


def test_an_unwritable_folder_is_reported(run, words: list[object], folder: Path) -> None:
    (folder / "out").write_text("in the way")
    assert "cannot be made" in run(*words).failure
    assert batch.INDEX == "index.csv"


def test_two_batches_into_one_folder_lose_no_row(small_preset: Path, folder: Path) -> None:
    """Each read the index when it began; what the other has added meanwhile stays."""
    from app.export.batch_index import BatchIndex, BatchRow

    (folder / "out").mkdir(parents=True)
    indices = [BatchIndex(folder / "out" / batch.INDEX) for _ in range(2)]
    for number in range(8):
        for which, one in enumerate(indices):
            one.add([BatchRow(f"{which}_{number}.wav", "written", "small", 0.3, 1.0, "model", 4000)])
    assert len(index(folder)) == 16


def test_a_batch_varies_strings(run, folder: Path, tmp_path: Path) -> None:
    """Each file of it is what `render` makes; a string that cannot be is a row that says so, and hinders no other."""
    text = find_string("nylon_b3").read_text(encoding="utf-8")
    for name, line in (("heavy", "d1_kg_m_s = 900.0"), ("bright", "d3_kg_m_s = 6.8e-7")):
        changed = re.sub(rf"{line.split()[0]} = .*", line, text)
        (tmp_path / f"{name}.toml").write_text(changed, encoding="utf-8")
    strings = f"steel_g3,{tmp_path / 'bright.toml'},{tmp_path / 'heavy.toml'}"
    line = ["batch", "--presets", "studio_any_string", "--positions", "0.3", "--amplitudes", "1", "--seconds", 0.1]
    line += ["--out", folder / "out", "--strings", strings, "--rate", 44_100]
    found = run(*line)
    assert found.status == 1
    assert "2 written, 0 kept, 1 failed" in found.out
    rows = {row["string"]: row for row in index(folder)}
    assert {name: row["status"] for name, row in rows.items()} == {
        "steel_g3": "written",
        "bright": "written",
        "heavy": "failed",
    }
    assert "heavy: " in rows["heavy"]["message"] and "overdamped" in rows["heavy"]["message"]
    assert "decay time near 3 kHz" in rows["bright"]["message"] and rows["steel_g3"]["message"] == ""
    assert rows["steel_g3"]["file"] == "studio_any_string_steel_g3_x0.30_a1.0_44100_model.wav"
    one = folder / "one.wav"
    reported = ("--position", 0.3, "--amplitude-mm", 1, "--seconds", 0.1, "--string", "steel_g3", "--rate", 44_100)
    assert run("render", "studio_any_string", one, *reported).status == 0
    assert one.read_bytes() == (folder / "out" / rows["steel_g3"]["file"]).read_bytes()
    assert "0 written, 2 kept, 1 failed" in run(*line).out


def test_a_preset_of_one_string_in_a_batch_of_strings_is_reported(run, words: list[object]) -> None:
    found = run(*words, "--strings", "steel_g3")
    assert found.status == 1
    assert "choose a preset of many strings" in found.err


def test_an_index_from_before_there_were_strings_keeps_its_rows(small_preset: Path, folder: Path) -> None:
    run_batch(plan(small_preset, folder))
    file = folder / "out" / "index.csv"
    file.write_text("\n".join(line.rpartition(",")[0] for line in file.read_text().splitlines()) + "\n")
    before = index(folder)
    assert all("string" not in row for row in before)
    assert {row.status for row in run_batch(plan(small_preset, folder))} == {"kept"}
    assert [{**row, "status": "kept", "string": ""} for row in before] == index(folder)

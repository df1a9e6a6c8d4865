import errno
import threading
from pathlib import Path
from unittest.mock import Mock

import pytest
from filelock import FileLock

from engine.schema import SchemaError
from tests.training.conftest import row
from training.results import COLUMNS, add_rows, read_results
from training.start import BLIND_PURSUIT, LEAST_SQUARES, PHASES, PURSUIT


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "folder" / "results.csv"


def test_a_start_that_knows_the_string_is_no_black_box():
    known = {"koopman": (PURSUIT, "physics"), "koopman_integrated": ("averaging",), "lru": ("physics",)}
    for model, starts in known.items():
        assert all(row(model=model, initialisation=how).structured for how in starts)
    unknowing = ("", "paper", "random", LEAST_SQUARES, BLIND_PURSUIT, PHASES)
    assert not any(row(model="koopman_integrated", initialisation=how).structured for how in unknowing)


def test_rows_come_back_as_they_were_with_all_digits_also_of_an_earlier_version(path):
    rows = [
        row("a", epochs=3, seconds=1.5, rel_mae=1 / 3, rel_mse=1.23456789e-7, rel_mse_q4=1e-12),
        row("b", status="diverged", rel_mae=None, message='the loss is nan, "too big"'),
        row("c", status="failed", rel_mae=None, message="größer, 2 lines\nand a comma"),
    ]
    assert read_results(path) == []
    assert add_rows(path, rows) == rows
    assert read_results(path) == rows
    head, *_ = path.read_text(encoding="utf-8").splitlines()
    assert head == ",".join(COLUMNS)
    path.unlink()
    add_rows(path, [row(rel_mae=None)])
    lines = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    kept = [place for place, name in enumerate(COLUMNS) if name not in ("rel_mae", "hardware")]
    path.write_text("\n".join(",".join(line[place] for place in kept) for line in lines), encoding="utf-8")
    assert read_results(path) == [row(rel_mae=None)]


def test_the_order_of_adding_does_not_matter(tmp_path):
    rows = [row(digest, finished=f"2026-01-0{day}T00:00:00Z") for day, digest in enumerate("abcab", 1)]
    for number, order in enumerate([rows, rows[::-1], rows[2:] + rows[:2]]):
        for each in order:
            add_rows(tmp_path / f"{number}.csv", [each])
    assert len({(tmp_path / f"{number}.csv").read_bytes() for number in range(3)}) == 1
    found = [(each.digest, each.finished[9:10]) for each in read_results(tmp_path / "0.csv")]
    assert found == [("a", "4"), ("b", "5"), ("c", "3")]


DONE, MEASURED_AGAIN = row(), row(rel_mse_se=0.25)
FAILED = row(status="failed", rel_mae=None, message="no memory", finished="2027-01-01T00:00:00Z")


@pytest.mark.parametrize(
    ("added", "left"),
    [
        ([FAILED], FAILED),
        ([FAILED, DONE], DONE),
        ([DONE, FAILED], DONE),  # what is done is replaced by no failure
        ([MEASURED_AGAIN, DONE], MEASURED_AGAIN),  # an older copy, as from another machine, takes nothing from it
        ([DONE, MEASURED_AGAIN], MEASURED_AGAIN),
    ],
)
def test_of_two_rows_of_a_run_the_better_stays_and_adding_it_again_changes_nothing(path, added, left):
    for each in added:
        add_rows(path, [row("b"), each])
    assert read_results(path) == [left, row("b")]
    before = path.read_bytes()
    add_rows(path, [])
    add_rows(path, [left])
    assert path.read_bytes() == before


def test_many_writers_lose_no_row_and_wait_for_another_that_holds_the_file(path):
    def write(part: int) -> None:
        for number in range(5):
            add_rows(path, [row(f"{part}{number}")])

    add_rows(path, [row("a")])
    writers = [threading.Thread(target=write, args=[part]) for part in range(4)]
    with FileLock(f"{path}.lock"):
        for writer in writers:
            writer.start()
        writers[0].join(timeout=0.2)
        assert writers[0].is_alive()
        assert [each.digest for each in read_results(path)] == ["a"]
    for writer in writers:
        writer.join()
    written = {f"{part}{number}" for part in range(4) for number in range(5)}
    assert {each.digest for each in read_results(path)} == {"a", *written}


def test_a_full_disk_leaves_the_file_as_it_was(path, monkeypatch):
    add_rows(path, [row("a")])
    before = path.read_bytes()
    full = Mock(writerows=Mock(side_effect=OSError(errno.ENOSPC, "No space left on device", str(path))))
    with monkeypatch.context() as instrumented:
        instrumented.setattr("engine.table.csv.writer", lambda file, **_: file.write("digest") and full)
        with pytest.raises(OSError, match="No space left"):
            add_rows(path, [row("b")])
    assert path.read_bytes() == before
    assert {file.name for file in path.parent.iterdir()} <= {path.name, f"{path.name}.lock"}
    add_rows(path, [row("b")])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not a results file"),
        ("name,status\nx,done\n", "not a results file"),
        ("digest," + "y" * 200_000, "field larger"),
        ("digest,name,colour\nx,y,red\n", "unknown column 'colour'; it is of a newer version: update"),
        ("digest,name\nx,y\n", "line 2: field 'status' is missing"),
        (b"\xff\xfe\x00", "not a text file"),
        (("0.125", "0.1.25"), "line 3, column rel_mae: '0.1.25' is not a number"),
        (("0.125", "nan"), "line 3.rel_mae: must be a finite number"),
        ((",done,", ",perhaps,"), "line 3.status: must be 'done', 'diverged' or 'failed', found 'perhaps'"),
    ],
)
def test_what_is_no_results_file_is_reported_with_its_place_and_left_alone(path, text, message):
    add_rows(path, [row("a", rel_mae=0.5), row("b")])
    if isinstance(text, tuple):  # a wrong value in the last line
        first, second, third = path.read_text(encoding="utf-8").splitlines()
        text = "\n".join([first, second, third.replace(*text)])
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    before = path.read_bytes()
    for act in (lambda: read_results(path), lambda: add_rows(path, [row()])):
        with pytest.raises(SchemaError) as error:
            act()
        assert str(path) in str(error.value) and message in str(error.value)
    assert path.read_bytes() == before

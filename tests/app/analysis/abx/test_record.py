"""Records: kept whole, read back the same, refused where they cannot be true."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from app.analysis.abx.record import AbxRecord, RecordError, list_records, load_record, save_record
from app.analysis.abx.text import as_text, p_text
from app.patches.patch import PhysicalString
from app.shared.whole_file import WriteError
from engine.resonators.string import StringParameters


def edited(path: Path, **changes: Any) -> Path:
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))
    return path


def test_a_record_comes_back_the_same(record: AbxRecord, tmp_path: Path) -> None:
    path = save_record(tmp_path / "new" / "folder", record)
    assert load_record(path) == record
    assert [p.name for p in path.parent.iterdir()] == [path.name]
    assert record.p_value == pytest.approx(11 / 1024)
    assert record.correct == 9
    assert record.date.tzinfo is not None


def test_no_record_is_overwritten(record: AbxRecord, stopped: AbxRecord, tmp_path: Path) -> None:
    later = stopped.model_copy(update={"date": record.date})
    paths = [save_record(tmp_path, made) for made in (record, later, later)]
    assert len(set(paths)) == 3
    assert load_record(paths[0]) == record


def test_a_test_that_was_stopped_claims_nothing(stopped: AbxRecord, tmp_path: Path) -> None:
    assert (stopped.complete, stopped.p_value, len(stopped.trials)) == (False, None, 4)
    text = as_text(load_record(save_record(tmp_path, stopped)))
    assert "incomplete: 3 right of 4 answered, 10 planned" in text
    assert "p =" not in text
    assert "p-value is" not in text


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"correct": 10}, "correct is not the number of right answers"),
        ({"p_value": 0.001}, "p_value is 0.001, but the answers give 0.0107"),
        ({"p_value": None}, "p_value belongs to a complete test"),
        ({"complete": False}, "complete does not fit 10 answers"),
        ({"planned_trials": 12}, "complete does not fit 10 answers to 12 trials"),
        ({"seed": 6}, "not in the order of the seed"),
        ({"trials": [{"x": "A"}]}, "trials.0.answer: Field required"),
        ({"kind": "something else"}, "not the record of a listening test"),
        ({"version": 3}, "read it with a newer Learned Strings"),
        ({"date": "yesterday"}, "date: "),
        ({"more": 1}, "more: Extra inputs"),
    ],
)
def test_a_record_that_cannot_be_true_is_refused(
    record: AbxRecord, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    path = edited(save_record(tmp_path, record), **changes)
    with pytest.raises(RecordError) as told:
        load_record(path)
    assert str(told.value).startswith(f"{path}: ")
    assert message in str(told.value)


def test_the_string_of_many_is_kept_and_told(record: AbxRecord, tmp_path: Path) -> None:
    assert "\nString " not in as_text(record)
    own = StringParameters()
    string = PhysicalString(**{name: getattr(own, name) for name in PhysicalString.model_fields})
    chosen = record.model_copy(update={"pluck": record.pluck.model_copy(update={"string": string})})
    path = save_record(tmp_path, chosen)
    assert load_record(path) == chosen
    hz = own.undamped_frequency(1) / (2 * math.pi)
    assert f"String    {hz:.1f} Hz: length_m {own.length_m:g}, area_m2 {own.area_m2:g}, " in as_text(chosen)
    with pytest.raises(RecordError, match="string belongs to version 2"):
        load_record(edited(path, version=1))


def test_a_record_of_version_1_is_read(record: AbxRecord, tmp_path: Path) -> None:
    path = save_record(tmp_path, record)
    pluck = json.loads(path.read_text())["pluck"]
    assert pluck.pop("string") is None
    earlier = load_record(edited(path, version=1, pluck=pluck))
    assert earlier == record.model_copy(update={"version": 1})


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a JSON file, or cut short"),
        (b'{"kind": "learned-str', "not a JSON file, or cut short"),
        (b"\xff\xfe\x00", "not a JSON file, or cut short"),
        (b"[1, 2]", "not the record of a listening test"),
        (b"{}", "not the record of a listening test"),
        (b" " * (2**20 + 1), "larger than the 1 MiB"),
    ],
)
def test_a_broken_file_is_refused(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "abx_x.json"
    path.write_bytes(data)
    with pytest.raises(RecordError, match=message):
        load_record(path)
    with pytest.raises(RecordError, match=r"none\.json: cannot be read \(No such file"):
        load_record(tmp_path / "none.json")


def test_a_folder_lists_what_is_good_and_tells_the_rest(record: AbxRecord, tmp_path: Path) -> None:
    good = save_record(tmp_path, record)
    earlier = record.model_copy(update={"date": record.date.replace(year=2020)})
    old = save_record(tmp_path, earlier)
    (tmp_path / "abx_broken.json").write_text("{")
    (tmp_path / "notes.json").write_text("{}")
    found, problems = list_records(tmp_path)
    assert [path for path, _ in found] == [good, old]
    assert len(problems) == 1
    assert "abx_broken.json" in problems[0]
    assert list_records(tmp_path / "nowhere") == ([], [])


def test_a_folder_that_cannot_be_made_is_told(record: AbxRecord, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(WriteError, match=r"file.*cannot be written .*; choose"):
        save_record(tmp_path / "file" / "folder", record)


def test_a_record_is_not_changed(record: AbxRecord) -> None:
    with pytest.raises(ValidationError):
        record.correct = 10  # type: ignore[misc]


def test_the_text_says_everything(record: AbxRecord) -> None:
    text = as_text(record)
    for part in (
        "9 of 10 right, p = 0.011",
        "Model, turned down by 0.50 dB",
        "Preset    nylon\n",
        "SHA-256   0f0f",
        "position 0.35, 4 mm, Gaussian",
        "Headphones (ALSA), 48000 Hz",
        "Seed      5",
        "guessing alone",
    ):
        assert part in text
    assert sum("  yes  " in line for line in text.splitlines()) == 9


def test_the_text_says_where_and_how_it_was_heard(record: AbxRecord) -> None:
    assert "Heard     at 0.37 of the length, 2 s\n" in as_text(record)
    pluck = record.pluck.model_copy(update={"listen_right": 0.63, "pickup": "velocity", "solo": 3})
    text = as_text(record.model_copy(update={"pluck": pluck}))
    assert "Heard     at 0.37 (left) and 0.63 (right) of the length, as velocity, mode 3 alone, 2 s\n" in text


def test_two_presets_are_told_apart(record: AbxRecord) -> None:
    other = record.b.model_copy(update={"preset_sha256": "aa" * 32})
    text = as_text(record.model_copy(update={"b": other}))
    assert "SHA-256 A 0f0f" in text
    assert "SHA-256 B aaaa" in text


def test_the_smallest_p_values_are_a_bound() -> None:
    assert p_text(0.0384) == "p = 0.038"
    assert p_text(2.0**-25) == "p < 0.001"

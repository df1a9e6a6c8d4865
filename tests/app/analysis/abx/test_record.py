"""Results: kept whole, read back the same, with the numbers that follow from the trials."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from app.analysis.abx.record import AbxRecord, load_record, material_of, p_text, save_record
from app.patches.instrument import SingleString
from app.patches.patch import PhysicalString
from app.presets.library import list_presets
from app.session.choices import Choices
from engine.resonators.string import StringParameters
from engine.result_file import WriteError
from engine.schema import SchemaError


def edited(path: Path, **changes: Any) -> Path:
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))
    return path


def test_a_result_comes_back_the_same(record: AbxRecord, tmp_path: Path) -> None:
    path = save_record(tmp_path / "new" / "folder", record)
    assert load_record(path) == record
    assert [p.name for p in path.parent.iterdir()] == [path.name]
    assert record.p_value == pytest.approx(11 / 1024)
    assert record.correct == 9
    assert record.date.tzinfo is not None
    written = json.loads(path.read_text())
    assert (written["correct"], written["p_value"]) == (9, record.p_value)


def test_no_result_is_overwritten(record: AbxRecord, stopped: AbxRecord, tmp_path: Path) -> None:
    later = stopped.model_copy(update={"date": record.date})
    paths = [save_record(tmp_path, made) for made in (record, later, later)]
    assert len(set(paths)) == 3
    assert load_record(paths[0]) == record


def test_a_test_that_was_stopped_claims_nothing(stopped: AbxRecord, tmp_path: Path) -> None:
    assert (stopped.complete, stopped.p_value, len(stopped.trials)) == (False, None, 4)
    assert load_record(save_record(tmp_path, stopped)).verdict.startswith("The test was not completed")


def test_the_numbers_follow_from_the_trials_whatever_the_file_claims(record: AbxRecord, tmp_path: Path) -> None:
    path = edited(save_record(tmp_path, record), correct=10, p_value=0.0, complete=False)
    assert load_record(path) == record
    assert load_record(path).p_value == record.p_value


def test_a_result_of_an_earlier_version_is_read(record: AbxRecord, tmp_path: Path) -> None:
    through = {"device": "Headphones", "host_api": "ALSA", "rate_hz": 48_000, "volume_db": -3.0}
    pluck = {"position": 0.35, "amplitude_mm": 4.0, "listen_right": None, "string": None}
    path = edited(save_record(tmp_path, record), version=2, through=through, pluck=pluck, complete=True)
    assert load_record(path) == record.model_copy(update={"through": through, "pluck": pluck})


@pytest.mark.parametrize(
    "data", [b"", b'{"kind": "learned-str', b"\xff\xfe\x00", b"[1, 2]", b"{}", b" " * (2**20 + 1)]
)
def test_a_broken_file_is_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "abx_x.json"
    path.write_bytes(data)
    with pytest.raises(SchemaError, match=r"abx_x\.json: .*the result of a listening test"):
        load_record(path)
    with pytest.raises(SchemaError, match=r"none\.json: No such file"):
        load_record(tmp_path / "none.json")


def test_a_folder_that_cannot_be_made_is_reported(record: AbxRecord, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(WriteError, match=r"file.*cannot be written .*; choose"):
        save_record(tmp_path / "file" / "folder", record)


def test_a_result_is_not_changed(record: AbxRecord) -> None:
    with pytest.raises(ValidationError):
        record.seed = 6  # type: ignore[misc]


def test_the_smallest_p_values_are_a_bound() -> None:
    assert p_text(0.0384) == "p = 0.038"
    assert p_text(2.0**-25) == "p < 0.001"


def test_the_chosen_pluck_and_string_are_kept(preset_folder: Path) -> None:
    entry = list_presets(preset_folder)[0][0]
    own = StringParameters()
    string = PhysicalString(**{name: getattr(own, name) for name in PhysicalString.model_fields})
    for stereo, chosen in ((False, None), (True, string)):
        choices = Choices(instrument=SingleString(preset=entry.name), position=0.3, string=chosen, stereo=stereo)
        pluck = material_of(entry, choices).pluck
        assert pluck["position"] == 0.3
        assert pluck["string"] == (chosen and chosen.model_dump(mode="json"))
        assert ("listen_right" in pluck) == stereo

"""Results: kept whole, read back the same, with the numbers that follow from the trials."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from app.analysis.abx.record import AbxRecord, material_of, p_text, save_record
from app.presets.library import list_presets
from app.session.choices import Choices
from app.session.slots import sound_of
from engine.values.string import StringParameters


def read(path: Path) -> AbxRecord:
    return AbxRecord.model_validate_json(path.read_bytes())


def test_a_result_comes_back_the_same(record: AbxRecord, tmp_path: Path) -> None:
    path = save_record(tmp_path / "new" / "folder", record)
    assert read(path) == record
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
    assert read(paths[0]) == record


def test_a_test_that_was_stopped_claims_nothing(stopped: AbxRecord, tmp_path: Path) -> None:
    assert (stopped.complete, stopped.p_value, len(stopped.trials)) == (False, None, 4)
    assert read(save_record(tmp_path, stopped)).verdict.startswith("The test was not completed")


def test_the_smallest_p_values_are_a_bound() -> None:
    assert p_text(0.0384) == "p = 0.038"
    assert p_text(2.0**-25) == "p < 0.001"


def test_the_chosen_pluck_and_string_are_kept(preset_folder: Path) -> None:
    entry = list_presets(preset_folder)[0][0]
    string = StringParameters()
    for stereo, chosen in ((False, None), (True, string)):
        choices = Choices(single=entry.name, position=0.3, string=chosen, stereo=stereo)
        pluck = material_of(sound_of(choices, entry.path), "", 0.0).pluck
        assert pluck["position"] == 0.3
        assert pluck["string"] == (chosen and asdict(chosen))
        assert ("listen_right" in pluck) == stereo

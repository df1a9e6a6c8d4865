"""Files of the version that called an instrument a patch: settings, journals and the user's folder."""

import json

import pytest

from app.export.journal import left_journals
from app.instruments import library
from app.player.learned import check_name
from app.window.settings import load_settings
from tests.app.instruments.conftest import make_instrument

INSTRUMENT = make_instrument(name="Old friend")
FACTS = INSTRUMENT.model_dump(mode="json")


@pytest.mark.parametrize("single", [None, "studio_nylon_b3"])
def test_settings_keep_the_instrument_and_the_favourites(single, tmp_path):
    choices = {"patch": FACTS, "single": single, "octave": 1}
    path = tmp_path / "settings.json"
    path.write_text(json.dumps({"version": 1, "choices": choices, "patch_favourites": ["koto", "sitar"]}))
    settings, notice = load_settings(path)
    assert notice == ""
    assert (settings.choices.instrument, settings.choices.single) == (INSTRUMENT, single)
    assert (settings.choices.octave, settings.instrument_favourites) == (1, ("koto", "sitar"))


def test_settings_with_a_fault_under_an_earlier_name_keep_the_rest(tmp_path):
    path = tmp_path / "settings.json"
    path.write_text(json.dumps({"version": 1, "favourites": ["studio_steel_e4"], "patch_favourites": 7}))
    settings, notice = load_settings(path)
    assert "instrument_favourites" in notice
    assert (settings.favourites, settings.instrument_favourites) == (("studio_steel_e4",), ())


def test_an_unsaved_recording_is_played_as_it_was(tmp_path):
    lines = [
        {"version": 1, "recorded": "2026-11-01T10:00:00+00:00"},
        {"t": 0.0, "patch": FACTS},
        {"t": 0.0, "on": {"key": 60, "velocity": 90}},
        {"t": 1.0, "turned": [[["level_db"], -6.0]]},
        {"end": 2.0},
    ]
    (tmp_path / "left.recording").write_text("".join(json.dumps(line) + "\n" for line in lines))
    (journal,) = left_journals(tmp_path)
    played = journal.read()
    assert played is not None and played.instrument == INSTRUMENT
    turned = [entry.event.instrument for entry in played.events if hasattr(entry.event, "instrument")]
    assert [each.level_db for each in turned] == [INSTRUMENT.level_db, -6.0]


def test_instruments_in_the_former_folder_are_listed_and_their_names_are_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path))
    (tmp_path / "patches").mkdir()
    (tmp_path / "patches" / "old_friend.json").write_text(json.dumps(FACTS))
    entry = library.find_instrument("old_friend")
    assert entry.own and entry.instrument == INSTRUMENT
    with pytest.raises(library.InstrumentError, match="exists already"):
        library.save_instrument(INSTRUMENT)
    with pytest.raises(library.InstrumentError, match="exists already"):
        check_name("Old friend")
    renamed = library.rename_instrument(entry, "New friend")
    assert (renamed.path.parent.name, entry.path.exists()) == ("instruments", False)


def test_an_instrument_with_a_fault_is_named_with_it(tmp_path, monkeypatch):
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path))
    (tmp_path / "instruments").mkdir()
    (tmp_path / "instruments" / "broken.json").write_text(json.dumps({**FACTS, "decai": 1}))
    with pytest.raises(library.InstrumentError, match=r"broken\.json: .*decai"):
        library.find_instrument("Broken")

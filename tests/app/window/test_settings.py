"""Settings survive a round trip; a broken file is set aside."""

import json
from pathlib import Path

import pytest

from app.audio.choices import DeviceChoice, SoundChoice
from app.export.choices import ExportChoices
from app.export.sampled.choices import SampledChoices
from app.patches.library import SHIPPED as PATCHES
from app.playing.midi import MidiChoices
from app.session.choices import Choices
from app.views.look import Look
from app.window.settings import Settings, load_settings, save_settings, settings_file


def test_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "settings.json"
    settings = Settings(
        choices=Choices(position=0.7, heard="b", b="difference", loop=True),
        export=ExportChoices(folder="/music", bits="32f", rate_hz=0),
        sampled=SampledChoices(folder="/music", form="sf2", keys=(40, 76), layers=8, dry=True),
        device=DeviceChoice(name="Loud", host_api="ALSA"),
        sound=SoundChoice(rate_hz=44_100, buffer=512),
        look=Look(theme="light", size_percent=125),
        midi=MidiChoices(port="Keys", notes="preset", controllers={"width": 74}),
        window_geometry="AdnQyw==",
    )
    save_settings(path, settings)
    assert load_settings(path) == (settings, "")
    assert [p.name for p in path.parent.iterdir()] == ["settings.json"]


def test_a_first_start_has_defaults_and_no_notice(tmp_path: Path) -> None:
    assert load_settings(tmp_path / "nothing.json") == (Settings(), "")


def test_a_file_of_a_version_without_midi_is_read(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text('{"version": 1, "choices": {"position": 0.6}}')
    settings, notice = load_settings(path)
    assert (settings.choices.position, settings.midi, notice) == (0.6, MidiChoices(), "")


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("", "the file"),
        ("{", "the file"),
        ("[1]", "the file"),
        ('{"choices": {"position": 9}}', "choices.position"),
        ('{"colour": 1}', "colour"),
        ('{"midi": {"controllers": {"colour": 1}}}', "midi.controllers"),
        ('{"sampled": {"layers": 1e30}}', "sampled.layers"),
        ('{"version": 2}', "version"),
    ],
)
def test_a_broken_file_is_set_aside_and_reported(tmp_path: Path, text: str, names: str) -> None:
    path = tmp_path / "settings.json"
    path.write_text(text)
    settings, notice = load_settings(path)
    assert settings == Settings()
    assert names in notice
    assert "settings.broken.json" in notice
    assert (tmp_path / "settings.broken.json").read_text() == text
    assert load_settings(path) == (Settings(), "")


def test_a_wrong_field_does_not_lose_the_others(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text(
        '{"choices": {"position": 9, "listen": 0.2}, "sound": {"buffer": 3, "rate_hz": 96000}, "look": 7,'
        ' "colour": 1, "device": {"name": "Loud"}, "export": {"bits": "32f"}}'
    )
    settings, notice = load_settings(path)
    assert settings == Settings(
        choices=Choices(listen=0.2), sound=SoundChoice(rate_hz=96_000), export=ExportChoices(bits="32f")
    )
    assert "choices.position" in notice
    assert "settings.broken.json" in notice


def test_a_wrong_string_loses_no_more_than_itself(tmp_path: Path) -> None:
    """What is dropped for one fault is not there for the next, and may be necessary where it was."""
    path = tmp_path / "settings.json"
    patch = json.loads((PATCHES / "classical_guitar.json").read_text())
    kept = {"volume_db": -12.0, "patch": patch, "string": {"length_m": 0.65}}
    path.write_text(json.dumps({"choices": kept, "favourites": ["mine"]}))
    settings, notice = load_settings(path)
    assert (settings.choices.volume_db, settings.favourites, settings.choices.string) == (-12.0, ("mine",), None)
    assert settings.choices.patch is not None
    assert "choices.string" in notice
    patch["strings"] |= {"kind": "set", "extra": 1}
    path.write_text(json.dumps({"choices": kept, "favourites": ["mine"]}))
    settings, _ = load_settings(path)
    assert (settings.choices.volume_db, settings.favourites, settings.choices.patch) == (-12.0, ("mine",), None)


def test_a_file_of_the_first_version_still_loads(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text('{"version": 1, "choices": {"loop": true}, "device": null, "window_geometry": ""}')
    assert load_settings(path) == (Settings(choices=Choices(loop=True)), "")


def test_the_place_can_be_given(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_SETTINGS", str(tmp_path / "x.json"))
    assert settings_file() == tmp_path / "x.json"


def test_a_file_from_before_the_slots_loads_without_a_notice(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text('{"choices": {"heard": "truth", "position": 0.4}}')
    settings, notice = load_settings(path)
    assert notice == ""
    assert settings.choices.source_heard == "truth"


def test_a_theme_of_version_0_1_is_read(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text('{"look": {"face": "light"}}', encoding="utf-8")
    settings, notice = load_settings(path)
    assert (settings.look, notice) == (Look(theme="light"), "")
    assert '"theme":"light"' in settings.model_dump_json()

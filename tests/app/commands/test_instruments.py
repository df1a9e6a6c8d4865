"""Commands that list instruments and write them for samplers and as plug-ins."""

import json
import shutil
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
import soundfile

from app.export.plugin.identity import held_in, identifier
from app.export.plugin.image import Image
from app.export.sampled.plan import SampledPlan
from app.instruments.library import SHIPPED, find_instrument, list_instruments
from app.player import offline
from engine.parameters import OF_INSTRUMENTS


def test_a_preset_is_found_by_its_name_the_shipped_one_first(run, installed, small_preset, folder, monkeypatch):
    for name in ("mine", "good"):  # of two of one name, the shipped one counts
        shutil.copy(small_preset, folder / f"{name}.safetensors")
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder))
    found = {entry["name"]: entry["file"] for entry in json.loads(run("presets --json").out)}
    assert found == {"good": str(installed / "good.safetensors"), "mine": str(folder / "mine.safetensors")}
    compare = "compare {} --position 0.5 --amplitude-mm 2 --seconds 0.01"
    assert [run(compare.format(name)).status for name in found] == [0, 0]
    for name, message in {
        "goood": "no preset 'goood'; did you mean good? Give one of your own by its file",
        "other": "`learned-strings presets` lists all",
        "runs/missing.safetensors": "missing.safetensors: no such file",
    }.items():
        assert message in run(compare.format(name)).failure


def test_an_instruments_parameters_are_listed_with_its_values(run):
    own = find_instrument("classical_guitar").instrument
    listed = {each["id"]: each for each in json.loads(run("instruments classical_guitar --json").out)}
    assert set(listed) == {id for id in OF_INSTRUMENTS if own.has(id)}
    for id, each in listed.items():
        parameter = OF_INSTRUMENTS[id]
        assert (each["name"], each["unit"], each["value"]) == (parameter.name, parameter.unit, own.value(id))
        assert (each["lowest"], each["highest"], each["default"]) == (*parameter.limits, parameter.default)
    assert "damping.release_t60_s" in run("instruments classical_guitar").out
    table, every = run("instruments").out, json.loads(run("instruments --json").out)
    assert {each["file"] for each in every} >= {str(path) for path in SHIPPED.glob("*.json")}
    assert all(each["name"] in table and each["title"] in table for each in every)


# Samplers

SAMPLED = "sampled classical_guitar {out}.sfz --keys C4-62 --layers 2 --seconds 0.2"  # 60 to 62


def test_an_sfz_with_its_samples(run, out, monkeypatch):
    render = Mock(wraps=offline.render_note)
    monkeypatch.setattr(offline, "render_note", render)
    instrument, samples = find_instrument("classical_guitar").instrument, out.with_name("out_samples")
    plan = SampledPlan(instrument, (60, 62), layers=2)
    found = run(f"{SAMPLED} --source truth --rate 44100")
    assert found.status == 0 and found.out.startswith(f"{out}.sfz: 6 samples, ")
    assert [each.args[0] for each in render.call_args_list] == [instrument] * 6
    wanted = [(zone.key, zone.velocity, 0.2, 0.2, 44_100, "truth") for zone in plan.zones]
    assert [each.args[2:8] for each in render.call_args_list] == wanted
    assert len(list(samples.glob("*.flac"))) == 6
    dry = run(f"{SAMPLED} --dry --format wav --bits 16")
    assert ["--dry leaves the room" in each.err for each in (found, dry)] == [True, False]
    assert instrument.room.mix > 0 == render.call_args.args[0].room.mix
    for path in samples.iterdir():
        facts = soundfile.info(path)
        assert path.stat().st_size == 44 + 2 * facts.channels * facts.frames
    monkeypatch.setattr("app.commands.sampled.ASKED_ABOVE_BYTES", 1000)  # a large one is asked for
    assert [run(f"{SAMPLED}{more}").status for more in ("", " --yes")] == [1, 0]


def test_a_soundfont_is_one_file(run, folder):
    found = run(SAMPLED.replace(".sfz", ".sf2"), "--every", 3)
    assert found.status == 0
    assert [path.name for path in folder.iterdir()] == ["out.sf2"]
    assert "2 samples (1 key, each for 3 keys, 2 velocity layers)" in found.err


# Plug-ins


def made_at_once(images: list[Image], form: str, target: str, path: Path, *_: Any, replace: bool) -> Path:
    """A plug-in that has the identifiers alone."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"".join(image.id.encode() + b"\0" for image in images))
    return path


@pytest.fixture
def home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The folder below which plug-ins are installed; they are made without a compiler."""
    monkeypatch.setattr("app.export.plugin.formats.Path.home", lambda: tmp_path)
    monkeypatch.setattr("app.export.plugin.build.build_plugin", made_at_once)
    image = "app.export.plugin.image.image_of"
    monkeypatch.setattr(image, lambda instrument, _: Image(identifier(instrument.name), instrument.name, b"", (), ()))
    return tmp_path


def held(home: Path) -> dict[str, int]:
    return {path.name: len(held_in(path)) for path in home.rglob("*.clap") if path.is_file()}


def test_one_bank_does_not_replace_another(run, home):
    many = [entry.name for entry in list_instruments(SHIPPED)[0]][:9]
    assert run("plugin", *many, "--install").status == 0
    (name,) = held(home)
    assert name.endswith(" + 8 others.clap")
    assert run("plugin all --install").status == 0
    assert held(home)[name] == 9 and held(home)["Learned Strings.clap"] > 50
    others = (many[0], *many[2:], "concert_toms", "--install")
    refused = run("plugin", *others).failure
    assert all(words in refused for words in (name, "holds another instrument", "--replace"))
    assert held(home)[name] == 9
    for more in (["--replace"], []):  # the latter: the same again
        assert "replaces the one before" in run("plugin", *others, *more).out


def test_nothing_is_written_where_one_of_several_would_lose_something(run, home, folder):
    (folder / "Concert harp.vst3").write_bytes(b"org.learned-strings.another\0")
    assert run("plugin concert_harp --format all --out {folder}").status == 1
    assert [path.name for path in folder.iterdir()] == ["Concert harp.vst3"]


def test_without_a_compiler_the_extra_is_named(run, monkeypatch, folder):
    monkeypatch.setattr("app.export.plugin.formats.find_spec", lambda name: None)
    assert "learned-strings[plugin]" in run("plugin concert_harp --out {folder}").failure
    assert not list(folder.iterdir())

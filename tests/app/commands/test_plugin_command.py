"""The command `plugin`: bad requests are refused in words, before anything is compiled."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.commands.cli import main
from app.export.plugin.identity import held_in, identifier
from app.export.plugin.image import Image
from app.patches.library import SHIPPED, list_patches


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["No such harp"], "No such harp"),
        (["Concert harp", "--for", "amiga"], "amiga"),
        (["Concert harp", "--install", "--out", "x"], "--install"),
    ],
)
def test_bad_requests_are_refused(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plugin", *words]) != 0
    assert said in capsys.readouterr().err


def test_without_a_compiler_the_extra_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr("app.export.plugin.formats.find_spec", lambda name: None)
    assert main(["plugin", "Concert harp", "--out", str(tmp_path)]) == 1
    assert "learned-strings[plugin]" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def made_at_once(
    images: list[Image], form: str, target: str, path: Path, cache: Path, advanced: object, *, replace: bool
) -> Path:
    """A plug-in that has the identifiers alone."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"".join(image.id.encode() + b"\0" for image in images))
    return path


@pytest.fixture
def home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Where plug-ins are installed; they are made without a compiler."""
    monkeypatch.setattr("app.export.plugin.formats.Path.home", lambda: tmp_path)
    monkeypatch.setattr("app.export.plugin.build.build_plugin", made_at_once)
    monkeypatch.setattr(
        "app.export.plugin.image.image_of", lambda patch, _: Image(identifier(patch.name), patch.name, b"", (), ())
    )
    return tmp_path


def held(home: Path) -> dict[str, int]:
    return {path.name: len(held_in(path)) for path in home.rglob("*") if path.is_file()}


def test_one_bank_does_not_replace_another(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ending = ".clap"
    assert main(["plugin", "all", "--install"]) == 0
    whole = held(home)["Learned Strings" + ending]
    assert whole > 50
    assert main(["plugin", "concert_harp", "electric_bass", "--install"]) == 0
    assert held(home) == {f"Learned Strings{ending}": whole, f"Concert harp + Electric bass{ending}": 2}
    many = [entry.name for entry in list_patches(SHIPPED)[0]][:9]
    assert main(["plugin", *many, "--install"]) == 0
    (name,) = (name for name, count in held(home).items() if count == 9)
    assert name.endswith(f" + 8 others{ending}")
    before = capsys.readouterr().out
    assert "replaces" not in before
    assert main(["plugin", *reversed(many[1:]), many[0], "--install"]) == 0  # another first one, another name
    assert main(["plugin", many[0], *many[2:], "concert_toms", "--install"]) == 1
    said = capsys.readouterr().err
    assert name in said and "holds another instrument" in said and "--replace" in said
    assert said.count("\n") == 1
    assert held(home)[name] == 9
    assert main(["plugin", many[0], *many[2:], "concert_toms", "--install", "--replace"]) == 0
    assert "replaces the one before" in capsys.readouterr().out
    assert main(["plugin", "all", "--install"]) == 0  # the same again
    assert "replaces the one before" in capsys.readouterr().out


def test_nothing_is_written_where_one_of_several_would_lose_something(home: Path) -> None:
    harp = home / "out" / "Concert harp.vst3"
    harp.parent.mkdir()
    harp.write_bytes(b"org.learned-strings.another\0")
    assert main(["plugin", "concert_harp", "--format", "all", "--out", str(harp.parent)]) == 1
    assert [path.name for path in harp.parent.iterdir()] == [harp.name]


def test_names_that_differ_in_marks_and_case_are_three_instruments(home: Path, tmp_path: Path) -> None:
    harp = json.loads((SHIPPED / "concert_harp.json").read_text(encoding="utf-8"))
    for stem, name in (("one", "My bass!"), ("two", "my bass-"), ("three", "My bass")):
        (tmp_path / f"{stem}.json").write_text(json.dumps({**harp, "name": name}), encoding="utf-8")
    files = [str(tmp_path / f"{stem}.json") for stem in ("one", "two", "three")]
    assert main(["plugin", *files, "--out", str(tmp_path / "out")]) == 0
    (path,) = (tmp_path / "out").iterdir()
    assert len(held_in(path)) == 3

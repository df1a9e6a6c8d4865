"""Requests that are refused: in one line or as bad usage, before any work that would not end, and no file is made."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import typer

from app.commands import cli
from engine.presets import load_preset, save_preset

BASES: list[str] = []  # command lines to which options can be added; of one that is given twice the last counts
TABLE: list[tuple[int, str, str]] = []  # status, words, and what the message says
for line in Path(__file__).with_name("refusals.txt").read_text(encoding="utf-8").splitlines():
    if line.startswith("["):
        BASES.append(line.strip("[]"))
    elif not line.startswith("#"):
        words, _, message = line.partition(" | ")
        TABLE.append((int(words[0]), BASES[-1] + words[1:], message.replace("'", "")))


@pytest.fixture(autouse=True)
def no_file_is_made(folder: Path) -> Iterator[None]:
    yield
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(("status", "words", "message"), TABLE)
def test_a_request_that_cannot_be_carried_out_is_refused(run, folder, monkeypatch, status, words, message):
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder))
    done = run(words)
    assert message in (done.usage if status == 2 else done.failure.replace("'", ""))


def options(group: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Options of all commands, each with a command line of its command."""
    for each, command in getattr(group, "commands", {}).items():
        yield from options(command, f"{name} {each}".strip())
    if not hasattr(group, "commands"):
        base = max((line for line in BASES if line.startswith(f"{name} ")), key=len, default=name)
        yield from ((base, option) for option in group.params)


OPTIONS = list(options(typer.main.get_command(cli.cli)))
NUMBERS = [(base, each.opts[0], each.nargs) for base, each in OPTIONS if "float" in str(each.bare_type())]
WHOLE = [(base, each) for base, each in OPTIONS if each.bare_type() == "int"]
CHECKED_WITH_THEIR_VALUE = [(base, each.opts[0]) for base, each in WHOLE if None in (each.min, each.max)]


@pytest.mark.parametrize(("base", "option"), CHECKED_WITH_THEIR_VALUE)
def test_whole_numbers_out_of_range_are_refused(run, base, option):
    for value in (-1, 0, 10**12, 10**30):
        assert "must lie in" in run(base, option, value).usage


@pytest.mark.parametrize("value", ["nan", "inf", "-1e300"])
def test_numbers_that_are_none_or_endless_are_refused(run, value):
    for base, option, values in NUMBERS:
        done = run(base, option, *[value] * values)
        assert done.status == 2, (base, option, done)
        assert option.strip("-") in done.err or "seconds" in done.err, (base, option, done.err)


@pytest.mark.parametrize(
    "words",
    [
        "render {small_preset} {out}.wav --position 0.4 --amplitude-mm 3 --seconds 5",
        "play {made:song.mid} --instrument mandolin --out {out}.wav --seconds 0.5",
        "play {made:song.mid} --out {out}.flac --seconds 0.5",
        "drums render thin_bars {out}.wav --key 72 --seconds 0.5",
        "sampled mandolin {out}.sfz --keys 60-60 --layers 1 --seconds 1 --format wav",
        "sampled mandolin {out}.sf2 --keys 60-60 --layers 1 --seconds 1",
        "simulate {u0} {out}.npy --string linear --steps 3000",
        "predict {small_preset} {u0} {out}.npy --steps 3000",
    ],
)
def test_a_full_disk_leaves_nothing(run, words, made, u0, folder):
    """No file can be larger than some bytes: the system fails the write that would make it so."""
    resource = pytest.importorskip("resource", reason="needs POSIX limits")
    assert f"{made:song.mid}"  # which may have its place
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for bytes_left in (10, 3_000, 30_000):
        resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_left, before[1]))
        try:
            done = run(words)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert done.status == 1
        assert "cannot be written (File too large); choose another disk, or a shorter result" in done.err
        assert "Traceback" not in done.err and "Exception" not in done.err
        assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 10_000_000}, "GiB of data; ask for less"),
        ({"rate_hz": 8000}, "metadata.training.data.rate_hz is 8000, the model's is 4000"),
        ({"grid_points": 51}, "grid_points is 101, the data's are 51"),
    ],
)
def test_other_data_is_reported(run, tiny, tmp_path, changes, message):
    preset = load_preset(tiny)
    training = {**preset.info.training, "data": {**preset.info.training["data"], **changes}}
    save_preset(tmp_path / "other.safetensors", replace(preset.info, training=training), preset.model)
    assert message in run("evaluate", tmp_path / "other.safetensors").failure

"""Requests that are refused: in one line or as bad usage, before any work that would not end, and no file is made."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from app.commands import cli
from engine.presets import load_preset, save_preset
from tests.app.commands.conftest import FullDisk, Run

ROOT = Path(__file__).parents[3]


def table() -> Iterator[tuple[int, str, str]]:
    """Status, words and message of each line of `refusals.txt`."""
    base = ""
    for line in Path(__file__).with_name("refusals.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            base = line.strip("[]")
        elif not line.startswith("#"):
            words, _, message = line.partition(" | ")
            status, _, more = words.partition(" ")
            yield int(status), f"{base} {more}", message.replace("'", "")


@pytest.mark.parametrize(("status", "words", "message"), list(table()))
def test_a_request_that_cannot_be_carried_out_is_refused(
    run: Run, places: dict[str, Any], monkeypatch: pytest.MonkeyPatch, status: int, words: str, message: str
) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(places["folder"]))
    done = run(*(word.format_map(places) for word in words.split()))
    assert message in (done.usage if status == 2 else done.failure.replace("'", ""))
    assert list(places["folder"].iterdir()) == []


PLUCK = ("--position", 0.4, "--amplitude-mm", 3, "--seconds", 0.1)
# Command lines to which any option can be added; of an option that is given twice the last counts.
BASES: dict[str, tuple[Any, ...]] = {
    "render": ("render", "{preset}", "{out}.wav", *PLUCK),
    "play": ("play", "{made:song.mid}", "--instrument", "mandolin", "--out", "{out}.wav"),
    "sampled": ("sampled", "mandolin", "{out}.sfz"),
    "predict": ("predict", "studio_any_string", "{u0}", "{out}.npy", "--steps", 5),
    "compare": ("compare", "studio_any_string", *PLUCK),
    "evaluate": ("evaluate", "studio_any_string"),
    "simulate": ("simulate", "{u0}", "{out}.npy", "--string", "linear", "--steps", 5),
    "learn": ("learn", "{made:note.wav}", "--name", "unused"),
    "sweep": ("sweep", "tiny", "--runs", "{out}"),
    "drums simulate": ("drums", "simulate", "thin_bars", "{out}.npy", "--key", 72, "--steps", 5),
    "drums predict": ("drums", "predict", "thin_bars", "{out}.npy", "--key", 72, "--steps", 5),
    "drums render": ("drums", "render", "thin_bars", "{out}.wav", "--key", 72),
    "drums compare": ("drums", "compare", "thin_bars", "--key", 72),
}
# Their ranges are those of values that are checked before the work.
CHECKED_WITH_THEIR_VALUE = {
    ("render", "--rate"),
    ("play", "--rate"),
    *(("sampled", option) for option in ("--every", "--layers", "--rate")),
    *((name, "--rate") for name in ("predict", "compare", "evaluate")),
}


def options(group: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Options of all commands, each with the command's name."""
    for each, command in getattr(group, "commands", {}).items():
        yield from options(command, f"{name} {each}".strip())
    if not hasattr(group, "commands"):
        yield from ((name, option) for option in group.params)


OPTIONS = list(options(typer.main.get_command(cli.cli)))
NUMBERS = [(name, each.opts[0], each.nargs) for name, each in OPTIONS if "float" in str(each.bare_type())]


def test_every_whole_number_has_a_least_and_a_most_value() -> None:
    whole = [(name, option) for name, option in OPTIONS if option.bare_type() == "int"]
    unbounded = {(name, option.opts[0]) for name, option in whole if option.min is None or option.max is None}
    assert unbounded == CHECKED_WITH_THEIR_VALUE


@pytest.mark.parametrize(("name", "option"), sorted(CHECKED_WITH_THEIR_VALUE))
def test_whole_numbers_out_of_range_are_refused_before_the_work(
    run: Run, places: dict[str, Any], name: str, option: str
) -> None:
    words = [str(word).format_map(places) for word in BASES[name]]
    for value in (-1, 0, 10**12, 10**30):
        assert "must lie in" in run(*words, option, value).usage
    assert list(places["folder"].iterdir()) == []


@pytest.mark.parametrize("value", ["nan", "inf", "-1e300"])
def test_numbers_that_are_none_or_endless_are_refused(run: Run, places: dict[str, Any], value: str) -> None:
    for name, option, values in NUMBERS:
        done = run(*(str(word).format_map(places) for word in BASES[name]), option, *[value] * values)
        assert done.status == 2, (name, option, done)
        assert option.strip("-") in done.err or "seconds" in done.err, (name, option, done.err)
    assert list(places["folder"].iterdir()) == []


SAMPLED = ("--keys", "60-60", "--layers", 1, "--seconds", 1)


@pytest.mark.parametrize(
    "words",
    [
        ("render", "{preset}", "{out}.wav", "--position", 0.4, "--amplitude-mm", 3, "--seconds", 5),
        ("play", "{made:song.mid}", "--instrument", "mandolin", "--out", "{out}.wav", "--seconds", 0.5),
        ("play", "{made:song.mid}", "--out", "{out}.flac", "--seconds", 0.5),
        ("drums", "render", "thin_bars", "{out}.wav", "--key", 72, "--seconds", 0.5),
        ("sampled", "mandolin", "{out}.sfz", *SAMPLED, "--format", "wav"),
        ("sampled", "mandolin", "{out}.sf2", *SAMPLED),
        ("simulate", "{u0}", "{out}.npy", "--string", "linear", "--steps", 3000),
        ("predict", "{preset}", "{u0}", "{out}.npy", "--steps", 3000),
    ],
    ids=lambda words: " ".join(map(str, words[:3])),
)
def test_a_full_disk_is_one_line_and_leaves_nothing(
    run: Run, words: tuple[Any, ...], places: dict[str, Any], full_disk: FullDisk
) -> None:
    line = [str(word).format_map(places) for word in words]
    for bytes_left in (10, 3_000, 30_000):
        with full_disk(bytes_left):
            done = run(*line)
        assert done.status == 1
        assert "cannot be written (File too large); choose another disk, or a shorter result" in done.err
        assert "Traceback" not in done.err and "Exception" not in done.err
        assert list(places["folder"].iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 10_000_000}, "GiB of data; ask for less"),
        ({"rate_hz": 8000}, "metadata.training.data.rate_hz is 8000, the model's is 4000"),
        ({"grid_points": 51}, "grid_points is 101, the data's are 51"),
    ],
)
def test_a_data_set_that_is_not_the_models_is_reported(
    run: Run, tiny: Path, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    preset = load_preset(tiny)
    training = {**preset.info.training, "data": {**preset.info.training["data"], **changes}}
    save_preset(tmp_path / "other.safetensors", replace(preset.info, training=training), preset.model)
    assert message in run("evaluate", tmp_path / "other.safetensors").failure


def test_shapes_of_a_drum_that_would_not_fit_are_refused(run: Run, folder: Path) -> None:
    key = run("drums", "modes", "concert_toms").usage.split("its drums have ")[1].split(",")[0]
    words = ("drums", "simulate", "concert_toms", folder / "tom.npy", "--key", key, "--steps", 3, "--points", 513)
    assert "MiB allowed; lower --points" in run(*words).failure
    assert list(folder.iterdir()) == []


PEAK_MEMORY = """
import sys, resource
import app.commands.cli as cli, engine.truth, app.rendering.blow, app.commands.drums
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
status = cli.main(sys.argv[1:])
print(status, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss is in KiB on Linux alone")
def test_a_drum_on_a_fine_grid_takes_little_memory(tmp_path: Path) -> None:
    words = ["drums", "simulate", "thin_bars", tmp_path / "bar.npy", "--key", 72, "--steps", 300, "--points", 513]
    command = [sys.executable, "-c", PEAK_MEMORY, *map(str, words)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    status, peak_kib = map(int, done.stdout.split())
    assert status == 0, done.stderr
    assert np.load(tmp_path / "bar.npy", mmap_mode="r").nbytes > 190e6
    assert peak_kib < 200 * 1024

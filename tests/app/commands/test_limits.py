"""Numbers and disks that do not suffice: refused in one line, before any work that would not end."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mido
import numpy as np
import pytest
import soundfile
import typer

from app.commands import cli

ROOT = Path(__file__).parents[3]
TOO_MUCH = 10**12
# Options whose ranges are those of values that are checked before the work; `test_..._before_the_work` tries them.
CHECKED_WITH_THEIR_VALUE = {
    "render --rate": ("render", "{preset}", "{out}.wav", "--position", 0.4, "--amplitude-mm", 3, "--seconds", 0.1),
    "play --rate": ("play", "{song}", "--instrument", "mandolin", "--out", "{out}.wav"),
    "sampled --every": ("sampled", "mandolin", "{out}.sfz"),
    "sampled --layers": ("sampled", "mandolin", "{out}.sfz"),
    "sampled --rate": ("sampled", "mandolin", "{out}.sfz"),
    "predict --rate": ("predict", "studio_any_string", "{u0}", "{out}.npy", "--steps", 5),
    "compare --rate": (
        *("compare", "studio_any_string", "--position", 0.4, "--amplitude-mm", 3),
        *("--seconds", 0.1),
    ),
    "evaluate --rate": ("evaluate", "studio_any_string"),
}


def commands(group: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    for each, command in getattr(group, "commands", {}).items():
        yield from commands(command, f"{name} {each}".strip())
    if not hasattr(group, "commands"):
        yield name, group


def whole_numbers() -> Iterator[tuple[str, Any]]:
    for name, command in commands(typer.main.get_command(cli.cli)):
        for option in command.params:
            if option.bare_type() == "int":
                yield f"{name} {option.opts[0]}", option


def test_every_whole_number_has_a_least_and_a_most_value() -> None:
    unbounded = {name for name, option in whole_numbers() if option.min is None or option.max is None}
    assert unbounded == set(CHECKED_WITH_THEIR_VALUE)


@pytest.fixture
def song(tmp_path: Path) -> Path:
    path = tmp_path / "song.mid"
    on, off = (mido.Message(kind, note=62, velocity=90, time=240) for kind in ("note_on", "note_off"))
    mido.MidiFile(tracks=[mido.MidiTrack([on, off])]).save(path)
    return path


@pytest.mark.parametrize("name", CHECKED_WITH_THEIR_VALUE)
@pytest.mark.parametrize("value", [-1, 0, TOO_MUCH, 10**30])
def test_numbers_out_of_range_are_refused_before_the_work(
    run, name: str, value: int, small_preset: Path, u0: Path, song: Path, folder: Path
) -> None:
    places = {"preset": small_preset, "u0": u0, "song": song, "out": folder / "out"}
    words = [str(word).format_map(places) for word in CHECKED_WITH_THEIR_VALUE[name]]
    done = run(*words, name.rpartition(" ")[2], value)
    assert done.status == 2
    assert "must lie in" in done.err
    assert list(folder.iterdir()) == []


def test_threads_and_substeps_have_bounds(run, u0: Path, folder: Path) -> None:
    files = (u0, folder / "out.npy")
    for words in (
        ("train", "nylon_linear_noise_4k_dmd", "--threads", 100_000),
        ("simulate", *files, "--string", "nonlinear", "--steps", 5, "--substeps", 2_000_000_000),
    ):
        assert "should be less than or equal to 1024" in run(*words).usage
    assert list(folder.iterdir()) == []


PEAK_MEMORY = """
import sys, resource
import app.commands.cli as cli, engine.truth, engine.truth._splitting_kernel, app.rendering.blow, app.commands.drums
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
status = cli.main(sys.argv[1:])
print(status, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss is in KiB on Linux alone")
def test_a_drum_on_a_fine_grid_takes_little_memory(tmp_path: Path) -> None:
    words = ["drums", "simulate", "thin_bars", tmp_path / "bar.npy", "--key", 72, "--steps", 300, "--points", 513]
    done = subprocess.run(
        [sys.executable, "-c", PEAK_MEMORY, *map(str, words)],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    status, peak_kib = map(int, done.stdout.split())
    assert status == 0, done.stderr
    assert np.load(tmp_path / "bar.npy", mmap_mode="r").nbytes > 190e6
    assert peak_kib < 200 * 1024


def test_shapes_of_a_drum_that_would_not_fit_are_refused(run, folder: Path) -> None:
    words = ("drums", "simulate", "concert_toms", folder / "tom.npy", "--key", "{key}", "--steps", 3, "--points", 513)
    key = run("drums", "modes", "concert_toms").usage.split("its drums have ")[1].split(",")[0]
    failure = run(*(word.format(key=key) if word == "{key}" else word for word in words)).failure
    assert "MiB allowed; lower --points" in failure
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("bytes_left", [10, 3_000, 30_000])
@pytest.mark.parametrize(
    "words",
    [
        ("render", "{preset}", "{out}.wav", "--position", 0.4, "--amplitude-mm", 3, "--seconds", 5),
        ("play", "{song}", "--instrument", "mandolin", "--out", "{out}.wav"),
        ("drums", "render", "thin_bars", "{out}.wav", "--key", 72),
        ("sampled", "mandolin", "{out}.sfz", "--keys", "60-60", "--layers", 1, "--seconds", 1, "--format", "wav"),
        ("sampled", "mandolin", "{out}.sf2", "--keys", "60-60", "--layers", 1, "--seconds", 1),
        ("simulate", "{u0}", "{out}.npy", "--string", "linear", "--steps", 3000),
        ("predict", "{preset}", "{u0}", "{out}.npy", "--steps", 3000),
    ],
    ids=lambda words: " ".join(map(str, words[:3])),
)
def test_a_full_disk_is_one_line_and_leaves_nothing(
    run, words: tuple[Any, ...], bytes_left: int, small_preset: Path, u0: Path, song: Path, folder: Path, full_disk
) -> None:
    places = {"preset": small_preset, "u0": u0, "song": song, "out": folder / "out"}
    with full_disk(bytes_left):
        done = run(*(str(word).format_map(places) for word in words))
    assert done.status == 1
    assert "cannot be written (File too large); choose another disk, or a shorter result" in done.err
    assert "Traceback" not in done.err
    assert "Exception" not in done.err
    assert list(folder.iterdir()) == []


# A command line for each command with numbers that are no whole ones; options given twice take the last value.
BASES = {
    "render": CHECKED_WITH_THEIR_VALUE["render --rate"],
    "simulate": ("simulate", "{u0}", "{out}.npy", "--string", "linear", "--steps", 5),
    "compare": CHECKED_WITH_THEIR_VALUE["compare --rate"],
    "learn": ("learn", "{recording}", "--name", "unused"),
    "play": CHECKED_WITH_THEIR_VALUE["play --rate"],
    "sampled": CHECKED_WITH_THEIR_VALUE["sampled --rate"],
    "evaluate": CHECKED_WITH_THEIR_VALUE["evaluate --rate"],
    "sweep": ("sweep", "tiny", "--runs", "{out}"),
    "drums simulate": ("drums", "simulate", "thin_bars", "{out}.npy", "--key", 72, "--steps", 5),
    "drums predict": ("drums", "predict", "thin_bars", "{out}.npy", "--key", 72, "--steps", 5),
    "drums render": ("drums", "render", "thin_bars", "{out}.wav", "--key", 72),
    "drums compare": ("drums", "compare", "thin_bars", "--key", 72),
}


def real_numbers() -> Iterator[tuple[str, str, int]]:
    for name, command in commands(typer.main.get_command(cli.cli)):
        for option in command.params:
            if "float" in str(option.bare_type()):
                yield name, option.opts[0], option.nargs


@pytest.mark.parametrize("value", ["nan", "inf", "-1e300"])
def test_numbers_that_are_none_or_endless_are_refused(
    run, value: str, small_preset: Path, u0: Path, song: Path, folder: Path, tmp_path: Path
) -> None:
    recording = tmp_path / "note.wav"
    soundfile.write(recording, 0.5 * np.sin(np.arange(48_000) / 20) * np.exp(-np.arange(48_000) / 9e3), 48_000)
    places = {"preset": small_preset, "u0": u0, "song": song, "out": folder / "out", "recording": recording}
    for name, option, values in real_numbers():
        words = [str(word).format_map(places) for word in BASES[name]]
        done = run(*words, option, *[value] * values)
        assert done.status == 2, (name, option, done)
        assert option.strip("-") in done.err or "seconds" in done.err, (name, option, done.err)
        assert list(folder.iterdir()) == []

"""The command that renders a patch for samplers."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import soundfile

from app.commands.sampled import _keys
from app.export.sampled.plan import SampledPlan
from app.export.sampled.words import pitch_words
from app.patches.library import find_patch

PATCH = "Classical guitar"
SMALL = ("--keys", "60-62", "--layers", 2, "--seconds", 0.2)


@pytest.fixture
def notes(monkeypatch: pytest.MonkeyPatch) -> list[tuple]:
    """What is rendered: decaying sines, in place of the instrument."""
    rendered: list[tuple] = []

    def render_note(patch, preset, key, velocity, held_s, seconds, rate_hz, source, advanced):
        rendered.append((patch.name, preset.name, key, velocity, held_s, seconds, rate_hz, source))
        time_s = np.arange(round(seconds * rate_hz)) / rate_hz
        sound = velocity / 127 * np.exp(-30 * time_s) * np.sin(2 * np.pi * 440 * 2 ** ((key - 69) / 12) * time_s)
        return np.stack([sound] * len(patch.pickup.points), axis=1).astype(np.float32)

    monkeypatch.setitem(sys.modules, "app.instrument.offline", SimpleNamespace(render_note=render_note))
    return rendered


def test_an_sfz_with_its_samples(run, notes: list[tuple], folder: Path) -> None:
    found = run("sampled", PATCH, folder / "a.sfz", *SMALL, "--source", "truth", "--rate", 44_100)
    assert found.status == 0
    assert found.out.startswith(f"{folder / 'a.sfz'}: 6 samples, ")
    assert "6 samples (3 keys, 2 velocity layers), at most 0.3 MB" in found.err
    preset = find_patch(PATCH).patch.preset
    plan = SampledPlan(find_patch(PATCH).patch, (60, 62), layers=2)
    assert notes == [(PATCH, preset, zone.key, zone.velocity, 0.2, 0.2, 44_100, "truth") for zone in plan.zones]
    pitch = f"; note starts within {plan.pitch_error_cents:.1f} cents of the instrument\n"
    assert found.out.endswith(pitch) and pitch in found.err
    assert len(list((folder / "a_samples").glob("*.flac"))) == 6


def test_a_soundfont_is_one_file(run, notes: list[tuple], folder: Path) -> None:
    found = run("sampled", PATCH, folder / "a.sf2", *SMALL, "--every", 3)
    assert found.status == 0
    assert [path.name for path in folder.iterdir()] == ["a.sf2"]
    assert {key for _, _, key, *_ in notes} == {61}
    assert "2 samples (1 key, each for 3 keys, 2 velocity layers)" in found.err


def test_format_and_bits(run, notes: list[tuple], folder: Path) -> None:
    run("sampled", PATCH, folder / "a.sfz", *SMALL, "--format", "wav", "--bits", "16")
    for path in (folder / "a_samples").iterdir():
        facts = soundfile.info(path)
        assert path.stat().st_size == 44 + 2 * facts.channels * facts.frames


def test_a_dry_one_has_no_room(run, notes: list[tuple], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rooms = []
    whole = sys.modules["app.instrument.offline"].render_note
    monkeypatch.setattr(
        sys.modules["app.instrument.offline"],
        "render_note",
        lambda patch, *words: rooms.append(patch.room.mix) or whole(patch, *words),
    )
    reported = "a released key ends the room's tail as well; --dry leaves the room to the sampler"
    assert reported in run("sampled", PATCH, folder / "a.sfz", *SMALL).err
    assert reported not in run("sampled", PATCH, folder / "a.sfz", *SMALL, "--dry").err
    assert rooms == [find_patch(PATCH).patch.room.mix] * 6 + [0.0] * 6
    assert rooms[0] > 0


def test_the_size_alone(run, notes: list[tuple], folder: Path) -> None:
    found = run("sampled", PATCH, folder / "a.sfz", *SMALL, "--size-only")
    assert (found.status, found.err) == (0, "")
    size = "6 samples (3 keys, 2 velocity layers), at most 0.3 MB, before FLAC compression"
    pitch = pitch_words(SampledPlan(find_patch(PATCH).patch, (60, 62), layers=2).pitch_error_cents)
    assert found.out == f"{folder / 'a.sfz'}: {size}; {pitch}\n"
    assert notes == [] and list(folder.iterdir()) == []


def test_a_large_one_is_asked_for(run, notes: list[tuple], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reported = run("sampled", PATCH, folder / "a.sfz", "--layers", 32, "--seconds", 30).failure
    assert "MB, before FLAC compression; take fewer --keys, --layers or --seconds, or say --yes" in reported
    monkeypatch.setattr("app.commands.sampled.ASKED_ABOVE_BYTES", 1000)
    assert run("sampled", PATCH, folder / "a.sfz", *SMALL).status == 1
    assert notes == [] and list(folder.iterdir()) == []
    assert run("sampled", PATCH, folder / "a.sfz", *SMALL, "--yes").status == 0


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        (("a.wav",), "must end with .sfz or .sf2"),
        (("a.sf2", "--bits", "16"), "a SoundFont holds 16 bits"),
        (("a.sf2", "--rate", 96_000), "a SoundFont's rate must lie in"),
        (("a.sfz", "--keys", "low-high"), "must be two keys as in E2-E5 or 40-76"),
        (("a.sfz", "--keys", "0-127"), "keys must be a range within the instrument's own"),
        (("a.sfz", "--layers", 0), "layers must lie in 1 … 32"),
        (("a.sfz", "--every", 99), "every must lie in 1 … 12"),
        (("a.sfz", "--seconds", "inf"), "seconds must lie in"),
    ],
)
def test_bad_usage(run, notes: list[tuple], folder: Path, words: tuple, reported: str) -> None:
    name, *options = words
    assert reported in " ".join(run("sampled", PATCH, folder / name, *options).usage.replace("│", " ").split())
    assert notes == []


def test_no_such_patch(run, folder: Path) -> None:
    assert "no-such-patch" in run("sampled", "no-such-patch", folder / "a.sfz").failure


@pytest.mark.parametrize(
    ("text", "keys"),
    [("40-76", (40, 76)), (" 40 - 76 ", (40, 76)), ("60", (60, 60)), ("E2-E5", (40, 76)), ("C-1-C0", (0, 12))],
)
def test_keys_are_numbers_or_notes(text: str, keys: tuple[int, int]) -> None:
    assert _keys(text) == keys

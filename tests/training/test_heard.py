"""Listening to a preset, and the table beside presets that keeps what was heard: also a table from strangers."""

import math
import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from engine.presets import load_preset, preset_digest
from engine.sources import Runaway
from training.heard import AMPLITUDES_MM, listen_to, standard_plucks
from training.heard_file import COLUMNS, LARGEST_BYTES, METHOD, MOST_REPORTED, NAME, Heard, add_heard, read_heard

GOOD = Heard("good", "a" * 64, 4.0, 0.25, -0.5, 0.0, 13.0, 22.0, 3.2, METHOD, -66.0)
HEAD = ",".join(COLUMNS)


def line(**changes: object) -> str:
    values = {name: getattr(GOOD, name) for name in COLUMNS} | changes
    return ",".join("" if v is None else str(v) for v in values.values())


def table(folder: Path, *lines: str) -> Path:
    (folder / NAME).write_text("\n".join([HEAD, *lines, ""]), encoding="utf-8")
    return folder


def test_a_model_is_heard_as_it_is_tuned_and_each_time_alike(small_preset):
    """Its multiplier is untrained: the fundamental is right, the glide of a hard pluck is not."""
    shares: list[float] = []
    right = listen_to(load_preset(small_preset), shares.append)
    assert (right.name, right.sha256) == ("small", preset_digest(small_preset))
    assert right.seconds == pytest.approx(4.0)
    assert right.runs_away_s is None and right.hum_db is None
    assert right.pitch_cents == pytest.approx(0, abs=1)
    assert shares == sorted(shares) and shares[-1] == pytest.approx(1)
    detuned = load_preset(small_preset)
    with torch.no_grad():
        detuned.model.theta_log.add_(13.0 / 1200 * math.log(2))
    heard, again = listen_to(detuned), listen_to(detuned)
    assert heard == again
    assert heard.pitch_cents is not None and right.pitch_cents is not None
    assert heard.pitch_cents - right.pitch_cents == pytest.approx(13, abs=0.2)
    assert heard.distance_db > right.distance_db > 0


def test_a_model_that_runs_away_is_heard_with_its_earliest_time(small_preset, monkeypatch):
    import training.heard as module

    render, calls = module.render_voice, []

    def away(program, source, *rest, **options):
        if source is not None:
            calls.append(None)
            if len(calls) > 1:
                raise Runaway(4.0 - len(calls))
        return render(program, source, *rest, **options)

    monkeypatch.setattr(module, "render_voice", away)
    heard = listen_to(load_preset(small_preset))
    assert heard.runs_away_s == 1.0
    assert heard.distance_db > 2 / 3 * 60


def test_a_model_that_hums_on_is_heard_to(small_preset, monkeypatch):
    """Where its voice is made to end; one of a string without losses is not waited for."""
    preset = load_preset(small_preset)
    with torch.no_grad():
        preset.model.nu_log.sub_(40)  # hardly any decay
    heard = listen_to(preset)
    assert heard.hum_db is not None and -40 < heard.hum_db < 0
    monkeypatch.setattr("training.heard.LONGEST_HUM_S", 1.0)
    assert listen_to(preset).hum_db is None


def test_a_table_of_before_hums_were_measured_is_read(tmp_path):
    head, before = ",".join(COLUMNS[:-1]), line().rpartition(",")[0]
    (tmp_path / NAME).write_text(f"{head}\n{before}\n", encoding="utf-8")
    old = replace(GOOD, hum_db=None)
    assert read_heard(tmp_path) == ({GOOD.sha256: old}, [])
    add_heard(tmp_path, [replace(GOOD, name="new", sha256="d" * 64)])
    assert [row.count(",") for row in (tmp_path / NAME).read_text().splitlines()] == [len(COLUMNS) - 1] * 3


def test_plucks_stay_within_what_was_trained(small_preset):
    info = load_preset(small_preset).info
    assert [pluck.amplitude_mm for pluck in standard_plucks(info)] == list(AMPLITUDES_MM)
    narrow = replace(info, trained_range=replace(info.trained_range, peak_m=(2e-3, 5e-3)))
    assert [pluck.amplitude_mm for pluck in standard_plucks(narrow)] == [2.0, 4.0, 5.0]
    tense = replace(info, trained_range=replace(info.trained_range, tension_rise=0.001))
    softened = [pluck.amplitude_mm for pluck in standard_plucks(tense)]
    assert softened[0] <= softened[1] == pytest.approx(softened[2])
    absurd = replace(info, trained_range=replace(info.trained_range, peak_m=(1e3, 1e6)))
    assert standard_plucks(absurd)[0].amplitude_mm == 20.0


def test_what_is_added_is_read_again_and_replaces_the_line_of_its_name(tmp_path):
    assert read_heard(tmp_path) == ({}, [])
    other = Heard("other", "b" * 64, 4.0, 1.0, 0.0, 0.0)
    again = replace(GOOD, sha256="c" * 64, level_db=-0.0001)
    for added, known in ((GOOD, [GOOD]), (other, [GOOD, other]), (again, [replace(again, level_db=0.0), other])):
        add_heard(tmp_path, [added])
        assert read_heard(tmp_path) == ({each.sha256: each for each in known}, [])
    text = (tmp_path / NAME).read_text()
    assert [row.split(",")[0] for row in text.splitlines()] == ["name", "good", "other"]
    assert "-0.0" not in text.splitlines()[1]


@pytest.mark.parametrize(
    ("bad", "reported"),
    [
        (line(distance_db="nan"), "finite"),
        (line(distance_db="1e300"), "distance_db must lie in"),
        (line(distance_db=""), "'distance_db' is missing"),
        (line(pitch_cents="<b>sharp</b>"), "is not a number"),
        (line(split_cents="-3"), "split_cents must lie in"),
        (line(method="9" * 5000), "is not a number"),
        (line(sha256="../../etc/passwd"), "64 hexadecimal digits"),
        (line(name="a\x1b[31m"), "name must be"),
        (line(name=""), "name must be"),
        ("a,b", "holds 2 values"),
        ("x" * 200_000, "field larger"),
        ("\0" * 10, "values"),
        ('"' + line(), "values"),
    ],
)
def test_a_bad_line_is_reported_and_hides_no_other(tmp_path, bad, reported):
    known, (problem,) = read_heard(table(tmp_path, bad, line()))
    assert known == {GOOD.sha256: GOOD}
    assert problem.startswith(f"{tmp_path / NAME}: line 2")
    assert reported in problem
    assert len(problem) < len(str(tmp_path)) + 300


def test_markup_in_a_name_stays_text_and_lines_of_another_method_say_nothing(tmp_path):
    known, problems = read_heard(table(tmp_path, line(name="<img src=x>"), line(sha256="e" * 64, method=METHOD + 1)))
    assert problems == []
    assert {digest: each.name for digest, each in known.items()} == {GOOD.sha256: "<img src=x>"}


@pytest.mark.parametrize(
    ("content", "reported"),
    [
        (b"", "first line must name"),
        (b"some text\n", "first line must name"),
        (b"\xff\xfe\x00", "not a text file"),
        (HEAD.encode() + b"\n" + b"a,b\n" * 1_000_000, "larger than"),
        (b" " * (LARGEST_BYTES + 1), "larger than"),
    ],
)
def test_a_file_that_is_no_table_is_reported_in_one_line(tmp_path, content, reported):
    (tmp_path / NAME).write_bytes(content)
    known, (problem,) = read_heard(tmp_path)
    assert known == {}
    assert reported in problem


def test_many_bad_lines_are_reported_in_few(tmp_path):
    known, problems = read_heard(table(tmp_path, *["a,b"] * 100, line()))
    assert known == {GOOD.sha256: GOOD}
    assert len(problems) == MOST_REPORTED + 1
    assert "97 more lines" in problems[-1]


def test_a_folder_or_a_link_to_nowhere_in_its_place_is_no_table(tmp_path):
    if os.name != "nt":  # links need rights there
        (tmp_path / NAME).symlink_to(tmp_path / "gone")
        assert read_heard(tmp_path) == ({}, [])
        (tmp_path / NAME).unlink()
    (tmp_path / NAME).mkdir()
    known, (reported,) = read_heard(tmp_path)
    assert known == {} and "not an ordinary file; remove it" in reported
    with pytest.raises(OSError, match=NAME):
        add_heard(tmp_path, [GOOD])


def test_the_shipped_table_knows_every_shipped_preset():
    """After a change of a preset: `learned-strings evaluate NAME --heard --write`."""
    from engine.presets import SHIPPED, preset_files

    known, problems = read_heard(SHIPPED)
    assert problems == []
    assert [path.stem for path in preset_files() if preset_digest(path) not in known] == []


def test_a_copy_keeps_what_was_heard_and_a_changed_file_does_not(small_preset, tmp_path):
    copy = Path(shutil.copy(small_preset, tmp_path / "copy.safetensors"))
    add_heard(tmp_path, [replace(GOOD, sha256=preset_digest(small_preset))])
    known, _ = read_heard(tmp_path)
    assert preset_digest(copy) in known
    copy.write_bytes(copy.read_bytes().replace(b"A small string", b"Another string"))
    assert preset_digest(copy) not in known

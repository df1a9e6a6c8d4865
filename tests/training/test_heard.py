"""Listening to a preset, the words for its faults, and the table of what was heard: also one from strangers."""

import math
from dataclasses import replace
from pathlib import Path
from unittest.mock import DEFAULT, Mock

import pytest
import torch

from engine.presets import SHIPPED, load_preset, preset_digest, preset_files
from engine.sources import Runaway
from training import heard as module
from training.heard import AMPLITUDES_MM, listen_to, standard_plucks
from training.heard_file import COLUMNS, LARGEST_BYTES, METHOD, MOST_REPORTED, NAME, Heard, add_heard, read_heard
from training.heard_words import faults, heard_sentence, heard_word

GOOD = Heard("good", "a" * 64, 4.0, 0.25, -0.5, 0.0, 1.0, hum_db=-90.0)
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
    assert heard.pitch_cents - right.pitch_cents == pytest.approx(13, abs=0.2)
    assert heard.distance_db > right.distance_db > 0


def test_a_model_that_runs_away_is_heard_with_its_earliest_time(small_preset, monkeypatch):
    render = module.render_voice
    of_model = Mock(side_effect=[DEFAULT, Runaway(2.0), Runaway(1.0)], wraps=render)
    monkeypatch.setattr(
        module, "render_voice", lambda *of, **how: (render if of[1] is None else of_model)(*of, **how)
    )
    heard = listen_to(load_preset(small_preset))
    assert heard.runs_away_s == 1.0
    assert heard.distance_db > 2 / 3 * 60


def test_a_model_that_hums_on_is_heard_to_where_its_voice_ends_unless_that_is_late(small_preset, monkeypatch):
    preset = load_preset(small_preset)
    with torch.no_grad():
        preset.model.nu_log.sub_(40)  # hardly any decay
    heard = listen_to(preset)
    assert heard.hum_db is not None and -40 < heard.hum_db < 0
    monkeypatch.setattr(module, "LONGEST_HUM_S", 1.0)
    assert listen_to(preset).hum_db is None


def test_plucks_stay_within_what_was_trained(small_preset):
    info = load_preset(small_preset).info

    def plucked_mm(**ranges: object) -> list[float]:
        trained = replace(info, trained_range=replace(info.trained_range, **ranges))
        return [pluck.amplitude_mm for pluck in standard_plucks(trained)]

    assert plucked_mm() == list(AMPLITUDES_MM)
    assert plucked_mm(peak_m=(2e-3, 5e-3)) == [2.0, 4.0, 5.0]
    softened = plucked_mm(tension_rise=0.001)
    assert softened[0] <= softened[1] == pytest.approx(softened[2])
    assert plucked_mm(peak_m=(1e3, 1e6))[0] == 20.0


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({}, []),
        ({"level_db": 1.9, "rise_db": 5.0, "pitch_cents": -2.9}, []),  # a beat alone does not grow
        ({"level_db": 5.2, "rise_db": 3.0}, ["grows, +5 dB"]),
        ({"pitch_cents": None}, []),
        ({"split_cents": 22.2, "pitch_cents": -7.0}, ["two pitches, 22 cents apart", "pitch 7 cents too low"]),
        ({"pitch_cents": 12.0, "level_db": -7.6}, ["pitch 12 cents too high", "decays too fast, −8 dB"]),
        ({"hum_db": -66.0, "level_db": 3.0}, ["residual hum at −66 dB", "fades too slowly, +3 dB"]),
        ({"runs_away_s": 3.21, "pitch_cents": 400.0}, ["diverges after 3.2 s", "pitch 400 cents too high"]),
    ],
)
def test_faults_are_named_the_worst_first(changes, named):
    heard = replace(GOOD, **changes)
    assert faults(heard) == named
    word = heard_word(heard)
    assert word.startswith(named[0] if named else "true")
    assert word.endswith("…") == (len(named) > 1)
    assert all(fault in heard_sentence(heard, "x") for fault in named)


def test_what_is_added_is_read_again_and_replaces_the_line_of_its_name(tmp_path):
    assert read_heard(tmp_path) == ({}, [])
    other = Heard("other", "b" * 64, 4.0, 1.0, 0.0, 0.0)
    again = replace(GOOD, sha256="c" * 64, level_db=-0.0001)
    for added, known in ((GOOD, [GOOD]), (other, [GOOD, other]), (again, [replace(again, level_db=0.0), other])):
        add_heard(tmp_path, [added])
        assert read_heard(tmp_path) == ({each.sha256: each for each in known}, [])
    names, values = zip(*(row.split(",", 1) for row in (tmp_path / NAME).read_text().splitlines()), strict=True)
    assert names == ("name", "good", "other") and "-0.0" not in values[1]
    # from a time without hums
    (tmp_path / NAME).unlink()
    without = "\n".join(row.rpartition(",")[0] for row in (HEAD, line()))
    (tmp_path / NAME).write_text(f"{without}\n", encoding="utf-8")
    assert read_heard(tmp_path) == ({GOOD.sha256: replace(GOOD, hum_db=None)}, [])
    add_heard(tmp_path, [replace(GOOD, name="new", sha256="d" * 64)])
    assert [row.count(",") for row in (tmp_path / NAME).read_text().splitlines()] == [len(COLUMNS) - 1] * 3


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
        ("a,b", "holds 2 values"),
        ("x" * 200_000, "field larger"),
        ('"' + line(), "values"),
    ],
)
def test_a_bad_line_is_reported_and_hides_no_other(tmp_path, bad, reported):
    known, (problem,) = read_heard(table(tmp_path, bad, line()))
    assert known == {GOOD.sha256: GOOD}
    assert problem.startswith(f"{tmp_path / NAME}: line 2") and reported in problem
    assert len(problem) < len(str(tmp_path)) + 300


def test_many_bad_lines_are_few_problems_markup_stays_text_and_another_method_says_nothing(tmp_path):
    others = line(name="<img src=x>"), line(sha256="e" * 64, method=METHOD + 1)
    known, problems = read_heard(table(tmp_path, *["a,b"] * 100, *others))
    assert {digest: each.name for digest, each in known.items()} == {GOOD.sha256: "<img src=x>"}
    assert len(problems) == MOST_REPORTED + 1 and "97 more lines" in problems[-1]


@pytest.mark.parametrize(
    ("content", "reported"),
    [
        (b"", "first line must name"),
        (b"some text\n", "first line must name"),
        (b"\xff\xfe\x00", "not a text file"),
        (b" " * (LARGEST_BYTES + 1), "larger than"),
        (None, "not an ordinary file; remove it"),
    ],
)
def test_a_file_that_is_no_table_is_reported_in_one_line(tmp_path, content, reported):
    (tmp_path / NAME).mkdir() if content is None else (tmp_path / NAME).write_bytes(content)
    known, (problem,) = read_heard(tmp_path)
    assert known == {} and reported in problem
    if content is None:
        with pytest.raises(OSError, match=NAME):
            add_heard(tmp_path, [GOOD])


def test_the_shipped_table_knows_every_shipped_preset():
    """After a change of a preset: `learned-strings evaluate NAME --heard --write`."""
    known, problems = read_heard(SHIPPED)
    assert problems == []
    assert [path.stem for path in preset_files() if preset_digest(path) not in known] == []

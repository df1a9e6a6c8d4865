from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from typing import Any

import pytest

from app.patches.instrument import Instrument, SingleString
from app.patches.patch import Patch
from engine.presets import SHIPPED
from tests.bench.printing import show, target
from training.cli.console import Failure


def test_bench_solver_reports_cost_and_error(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.bench.solver.AUDIO_S", 0.005)
    found = json.loads(run("solver", "--json", "--batch", 2, "--steps", 20).out)
    assert [(case["initial"], case["rate_hz"]) for case in found["protocol"]] == [
        ("gaussian", 16_000),
        ("noise", 16_000),
        ("gaussian", 4000),
        ("noise", 4000),
    ]
    assert all(case["relative_l2"] < 1e-7 for case in found["protocol"])
    assert all(case["loose_relative_l2"] < 1e-6 for case in found["protocol"])
    assert found["audio"][0]["rate_hz"] == 48_000
    assert found["machine"]["torch"]


def test_bench_render_measures_every_model(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.bench.render.AUDIO_S", 0.02)
    monkeypatch.setattr("tests.bench.render.PLUCKS", 2)
    found = json.loads(run("render", "--json").out)
    assert {(case["model"], case["rate_hz"]) for case in found["models"]} >= {
        ("koopman_var", 4000),
        ("koopman_var", 16_000),
    }
    assert found["machine"]["threads"] == 1
    assert all(case["worst_first_block_s"] >= case["first_block_s"] > 0 for case in found["models"])
    assert "first block, s" in run("render").out


def test_bench_take_measures_the_studio_strings(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.bench.take.SECONDS", 0.1)
    monkeypatch.setattr("tests.bench.take.PRESETS", ("studio_nylon_b3",))
    (found,) = json.loads(run("take", "--json").out)["takes"]
    assert (found["preset"], found["picture_hz"]) == ("studio_nylon_b3", 6000)
    # 601 pictures, 13 flashes of 101 points and 4,801 samples of one point, four bytes each
    assert found["megabytes"] == pytest.approx(4 * (614 * 101 + 4_801) / 1e6)
    assert found["rendered_s"] > found["moved_s"] > 0
    assert "megabytes" in run("take").out


def test_bench_train_measures_a_step(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.bench.train.BATCH", 2)
    monkeypatch.setattr("tests.bench.train.FRAMES", 5)
    monkeypatch.setattr("tests.bench.train.FEWER_FRAMES", {"fgru": 3})
    cases = {case["model"]: case for case in json.loads(run("train", "--json").out)["models"]}
    assert {(case["batch"], case["frames"]) for name, case in cases.items() if name != "fgru"} == {(2, 5)}
    assert cases["fgru"]["frames"] == 3
    assert all(case["step_s"] > 0 for case in cases.values())
    # a rollout of 5 steps, not of a whole horizon
    assert 50 < cases["koopman"]["launches"] < cases["lru"]["launches"]


STAND_IN = """
import sys
parameters = {"koopman_var": 134885, "koopman": 191077, "s5": 307879, "lru": 636221}
for number, _ in enumerate(sys.stdin):
    print(parameters[sys.argv[2]] if number == 0 else "0.5 1.0", flush=True)
"""


@pytest.fixture
def stand_in(tmp_path, monkeypatch: pytest.MonkeyPatch):
    """Another code in the place of the authors'."""
    monkeypatch.setattr("tests.bench.train.BATCH", 2)
    monkeypatch.setattr("tests.bench.train.FRAMES", 5)
    monkeypatch.setattr("tests.bench.authors.TURNS", 2)

    def write(text: str) -> None:
        driver = tmp_path / "driver.py"
        driver.write_text(text, encoding="utf-8")
        monkeypatch.setattr("tests.bench.authors.DRIVER", driver)

    return write


def test_bench_train_compares_a_step_with_the_authors(run, stand_in) -> None:
    stand_in(STAND_IN)
    cases = json.loads(run("train", "--json", "--against", sys.executable, "--source", "clone").out)["models"]
    assert [case["model"] for case in cases] == ["koopman_var", "koopman", "s5", "lru"]
    for case in cases:
        assert case["authors_s"] == 0.5
        assert case["ratio"] == pytest.approx(case["step_s"] / 0.5)
        assert case["processor_ratio"] > 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("raise SystemExit('no module named jax')", "no module named jax"),
        (STAND_IN.replace("134885", "134886"), "134886 in"),
    ],
)
def test_bench_train_says_why_the_authors_code_cannot_be_compared(run, stand_in, text: str, said: str) -> None:
    stand_in(text)
    done = run("train", "--against", sys.executable, "--source", "clone")
    assert done.status == 1
    assert said in done.err
    assert run("train", "--against", "/nowhere/python", "--source", "clone").status == 1
    assert run("train", "--source", "clone").status == 2


def test_bench_notes_says_what_is_missing(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.bench.play.children.shutil.which", lambda name: None)
    by_midi, by_keys = run("notes"), run("notes", "--by", "keys")
    assert (by_midi.status, by_keys.status) == (1, 1)
    assert "jackd2" in by_midi.err and "apt install" in by_midi.err
    assert "jackd" not in by_keys.err and "xvfb" in by_keys.err
    rings = run("notes", "--instrument", "concert_harp")
    assert rings.status == 1 and "ring on" in rings.err
    assert run("notes", "--buffer", "huge").status == 2


def test_bench_play_plays_an_instrument_or_a_single_string(run, monkeypatch: pytest.MonkeyPatch) -> None:
    played: list[Instrument] = []

    def measure(*options: Any) -> None:
        played.append(options[5])
        raise Failure("enough")

    monkeypatch.setattr("tests.bench.play.measure.measure", measure)
    assert run("play").status == run("play", "--preset", "studio_nylon_b3").status == 1
    assert [each.name if isinstance(each, Patch) else each for each in played] == [
        "Concert harp",
        SingleString(preset="studio_nylon_b3"),
    ]
    nobody = run("play", "--preset", "studio_nylon_b4")
    assert nobody.status == 1 and "did you mean studio_nylon_b3" in nobody.err
    assert run("play", "--preset", str(SHIPPED / "studio_nylon_b3.safetensors")).status == 1
    assert run("play", "--preset", str(SHIPPED)).status == 2
    assert len(played) == 3


@pytest.mark.parametrize("words", [[], ["solver"], ["train"], ["play"], ["tour"], ["soak"]])
def test_every_benchmark_has_help(run, words: list[str]) -> None:
    done = run(*words, "--help")
    assert done.status == 0
    assert "Usage: run.py bench" in done.out


def test_an_unknown_benchmark_is_bad_usage(run) -> None:
    assert run("nothing").status == 2


@dataclass(frozen=True)
class Part:
    latency_ms: float
    count: int = field(metadata=target(0))


@dataclass(frozen=True)
class Wide:
    name: str
    parts: tuple[float, ...]
    spread: Part

    @property
    def twice(self) -> int:
        return 2 * self.spread.count


@dataclass(frozen=True)
class Found:
    machine: Part
    wide: tuple[Wide, ...]


def test_nested_figures_properties_and_targets_are_printed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = Found(Part(1.0, 2), (Wide("first", (0.5, 2.0), Part(3.0, 7)), Wide("second", (), Part(4.0, 8))))
    show(found, as_json=False)
    columns = capsys.readouterr().out
    assert "latency, ms 1.0, count 2" in columns
    assert "spread, latency, ms" in columns and "0.5, 2" in columns and "14" in columns
    monkeypatch.setattr("tests.bench.printing.MOST_COLUMNS", 2)
    show(found, as_json=False)
    rows = capsys.readouterr().out.splitlines()
    (count,) = (row.split() for row in rows if row.strip().startswith("spread, count"))
    assert count == ["spread,", "count", "7", "8", "0"]
    show(found, as_json=True)
    assert json.loads(capsys.readouterr().out)["wide"][1]["twice"] == 16

from __future__ import annotations

import json

import pytest


def test_bench_solver_tells_cost_and_error(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.commands.benchmarks.solver.AUDIO_S", 0.005)
    found = json.loads(run("bench", "solver", "--json", "--batch", 2, "--steps", 20).out)
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
    monkeypatch.setattr("app.commands.benchmarks.render.AUDIO_S", 0.02)
    monkeypatch.setattr("app.commands.benchmarks.render.PLUCKS", 2)
    found = json.loads(run("bench", "render", "--json").out)
    assert {(case["model"], case["rate_hz"]) for case in found["models"]} >= {
        ("koopman_var", 4000),
        ("koopman_var", 16_000),
    }
    assert found["machine"]["threads"] == 1
    assert all(case["worst_first_block_s"] >= case["first_block_s"] > 0 for case in found["models"])
    assert "first block ms" in run("bench", "render").out


def test_bench_take_measures_the_studio_strings(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.commands.benchmarks.take.SECONDS", 0.1)
    monkeypatch.setattr("app.commands.benchmarks.take.PRESETS", ("studio_nylon_b3",))
    (found,) = json.loads(run("bench", "take", "--json").out)["takes"]
    assert (found["preset"], found["picture_hz"]) == ("studio_nylon_b3", 6000)
    # 601 pictures, 13 flashes of 101 points and 4,801 samples of one point, four bytes each
    assert found["megabytes"] == pytest.approx(4 * (614 * 101 + 4_801) / 1e6)
    assert found["rendered_s"] > found["moved_s"] > 0
    assert "MB a source" in run("bench", "take").out


def test_bench_train_measures_a_step(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.commands.benchmarks.train.BATCH", 2)
    monkeypatch.setattr("app.commands.benchmarks.train.FRAMES", 5)
    monkeypatch.setattr("app.commands.benchmarks.train.FEWER_FRAMES", {"fgru": 3})
    cases = {case["model"]: case for case in json.loads(run("bench", "train", "--json").out)["models"]}
    assert {(case["batch"], case["frames"]) for name, case in cases.items() if name != "fgru"} == {(2, 5)}
    assert cases["fgru"]["frames"] == 3
    assert all(case["step_s"] > 0 for case in cases.values())


def test_bench_notes_says_what_is_missing(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.commands.benchmarks.play.children.shutil.which", lambda name: None)
    by_midi, by_keys = run("bench", "notes"), run("bench", "notes", "--by", "keys")
    assert (by_midi.status, by_keys.status) == (1, 1)
    assert "jackd2" in by_midi.err and "apt install" in by_midi.err
    assert "jackd" not in by_keys.err and "xvfb" in by_keys.err
    rings = run("bench", "notes", "--patch", "concert_harp")
    assert rings.status == 1 and "ring on" in rings.err
    assert run("bench", "notes", "--buffer", "huge").status == 2

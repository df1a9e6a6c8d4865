"""Presets on one pluck: figures against the plain definition, one truth a string, and rows of presets that fail."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from app.analysis.comparison import Audible, compare
from app.export.wav import WavSettings
from app.presets.library import PresetEntry, list_presets
from app.rendering.note_sound import NoteSound
from engine.compare.audible import audible_errors
from engine.pluck import Pluck
from engine.presets import load_preset, save_preset
from engine.resonators.sine_transform import listening_weights, project
from engine.sources import ModelSource, TruthSource
from engine.values.ear import Ear
from tests.app.sounds import render_sound
from training.heard import GLIDE_S, RATE_HZ

PLUCK, LISTEN = Pluck(0.35, 4.0), 0.37


def plucked(entry: PresetEntry) -> tuple[PresetEntry, NoteSound]:
    return entry, NoteSound(entry.path, PLUCK, 0.3, Ear((LISTEN,)))


@pytest.fixture
def entries(small_preset: Path, tmp_path: Path) -> list[PresetEntry]:
    for name in ("first", "second"):
        shutil.copy(small_preset, tmp_path / f"{name}.safetensors")
    return list_presets(tmp_path)[0]


def test_figures_are_those_of_the_definition(entries: list[PresetEntry], job: Any) -> None:
    compare([plucked(entries[0])], job)
    (row,) = job.results
    preset, initial = load_preset(entries[0].path), project(PLUCK.displacement(101), 10)[None]
    model, truth = (
        source.advance(source.start(initial), 1200)[0][0]
        for source in (ModelSource(preset), TruthSource(preset.info))
    )
    error, ear = model - truth, listening_weights(np.array([LISTEN]), 101)
    for part, mae, mse in ((slice(400), row.mae, row.mse), (slice(400, None), row.past_mae, row.past_mse)):
        assert mae == pytest.approx(float(np.abs(error[part]).sum() / np.abs(truth[part]).sum()), rel=1e-3)
        assert mse == pytest.approx(float((error[part] ** 2).sum() / (truth[part] ** 2).sum()), rel=1e-3)
    heard = ((error @ ear) ** 2).sum() / ((truth @ ear) ** 2).sum()
    assert row.null_db == pytest.approx(10 * math.log10(heard), abs=0.01)
    assert (row.real_time > 0, row.note, job.shares[-1]) == (True, "", 1)


def test_the_ear_finds_what_it_finds_in_the_exported_sound(entries: list[PresetEntry], job: Any) -> None:
    """Through the pick-up, unless it is too short for a spectrum."""
    sound = NoteSound(entries[0].path, PLUCK, 1.0, Ear((LISTEN,), "bridge"))
    compare([(entries[0], sound), (entries[0], replace(sound, seconds=0.1))], job)
    row, short = job.results
    model, truth = (render_sound(sound, source, WavSettings(rate_hz=RATE_HZ)) for source in ("model", "truth"))
    modes_hz = entries[0].info.resonator.omega / (2 * math.pi)
    expected = audible_errors(model, truth, RATE_HZ, modes_hz.tolist(), GLIDE_S).distance_db
    assert row.heard.distance_db == pytest.approx(expected, rel=0.01) and expected > 0.01
    assert str(row.heard) == row.figures["heard"] and "spectra" in row.heard.sentence
    assert short.heard is None and short.mae is not None
    near, far = Audible(0.2, "true", ""), Audible(9.0, "9.0 dB off", "")
    assert sorted([far, near]) == [near, far], "in order of the distance"


def test_a_bad_preset_is_a_row_and_the_next_runs_away_and_says_when(entries: list[PresetEntry], job: Any) -> None:
    entries[0].path.write_bytes(b"damaged")
    preset = load_preset(entries[1].path)
    with torch.no_grad():
        preset.model.decoder.bias.fill_(1e6)  # type: ignore[operator,union-attr]
    save_preset(entries[1].path, preset.info, preset.model)
    compare([plucked(entry) for entry in entries], job)
    bad, run_away = job.results
    assert "first.safetensors" in bad.note and bad.mae is None
    assert "diverges" in run_away.note and run_away.mae == run_away.past_mae == math.inf

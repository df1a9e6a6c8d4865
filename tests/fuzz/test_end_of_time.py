"""Shipped presets fall silent, but for three that are known: what is left in the end, above the lowest that is heard.

Below 20 Hz nothing counts, as in `engine.audible`: a model may rest beside its place. `run.py test --fuzz` has all
presets and prints where they rest; a part of them, whose any moment costs nothing, is in the suite.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import torch
from torch import Tensor

from engine.audible import LOWEST_HZ
from engine.pluck import FULL_SCALE_M, Pluck
from engine.presets import SHIPPED, load_preset, read_info
from engine.sources import ModelSource, project
from tests.fuzz.conftest import LONG

END_S = 600.0
SILENT_DB = -100.0  # below full scale, where a voice is over
WINDOW_S = 0.5
STEPPED_S = 10.0  # between two looks at a model that must step
AT_ANY_TIME = ("dmd", "koopman", "koopman_var")
# Trained on 400 frames, these settle to a hum of their own, at so many dB of full scale.
HUMS = {
    "nylon_linear_gaussian_16k_frnn_400": -60.0,
    "nylon_nonlinear_gaussian_16k_frnn_400": -55.0,
    "nylon_nonlinear_gaussian_16k_lru_400": -70.0,
}
MOST_STEPPED_S = {"lru": 150.0, "s5": 150.0, "fgru": 30.0, "frnn": 30.0}  # then it is a hum or silence

PRESETS = sorted(SHIPPED.glob("*.safetensors"))


def levels_db(frames_m: Tensor, rate_hz: int) -> tuple[float, float]:
    """Of displacement (frames, grid_points): what is heard of it, and where it rests, below full scale."""
    window = torch.hann_window(len(frames_m), periodic=False, dtype=torch.float64)[:, None]
    rests = frames_m.double().mean(0)
    spectrum = torch.fft.rfft((frames_m.double() - rests) * window, dim=0).abs() * 2 / window.sum()
    hz = torch.fft.rfftfreq(len(frames_m), 1 / rate_hz)
    heard = spectrum[hz >= LOWEST_HZ].square().sum(0).max().sqrt()
    return _db(float(heard)), _db(float(rests.abs().max()))


def _db(displacement_m: float) -> float:
    return 20 * math.log10(max(displacement_m / FULL_SCALE_M, 1e-20))


@torch.inference_mode()
def ending(path: Path) -> tuple[float, float, float]:
    """When a preset was looked at last: silent, or as late as can be had; and its levels then."""
    preset = load_preset(path)
    info, source = preset.info, ModelSource(preset)
    state = source.start(project(Pluck().displacement(info.grid_points), info.modes)[None])
    frames = round(WINDOW_S * info.rate_hz)
    if source.any_frame:
        steps = round(END_S * info.rate_hz)
        found, _ = source.sample(state, torch.arange(steps - frames + 1, steps + 1), steps)
        return END_S, *levels_db(found[0], info.rate_hz)
    seconds = 0.0
    while True:
        for _ in range(round(STEPPED_S / WINDOW_S)):
            found, state = source.advance(state, frames)
            seconds += WINDOW_S
        heard_db, rests_db = levels_db(found[0], info.rate_hz)
        if heard_db < SILENT_DB or seconds >= MOST_STEPPED_S.get(info.model, END_S):
            return seconds, heard_db, rests_db


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
def test_a_shipped_preset_is_silent_in_the_end(path: Path) -> None:
    info = read_info(path)
    if not LONG and not (info.model in AT_ANY_TIME or (info.rate_hz == 4000 and info.model == "koopman_integrated")):
        pytest.skip("run.py test --fuzz has it")
    seconds, heard_db, rests_db = ending(path)
    print(f"\n{path.stem}: {heard_db:.0f} dB at {seconds:.0f} s, rests at {rests_db:.0f} dB")
    assert heard_db < HUMS.get(path.stem, SILENT_DB)

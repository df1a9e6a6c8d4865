"""Baselines: what they begin as, the units that they work in, and a training that continues where it was."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from engine.resonators.string import resonator_of
from tests.bench.baselines import fit as fitting
from tests.bench.baselines.fit import BaselineProgress, checkpoint_file, fit_baseline, trained_baseline
from tests.bench.baselines.models import BASELINES, ModalSynthesis, baseline_player, in_own_units, units
from training.cli.console import number
from training.family.preset import FamilyConfiguration
from training.family.strings import PluckedString, draw_string
from training.family.untrained import linear_string
from training.fitting.checkpoint import Checkpoint

RATE_HZ = 48_000
SMALL = FamilyConfiguration("Two", "", 25, strings=2, validation_strings=1, rate_hz=8_000)


@pytest.mark.parametrize("name", BASELINES)
def test_a_baseline_begins_as_the_linear_string(name: str) -> None:
    torch.manual_seed(0)
    play = baseline_player(BASELINES[name]())
    plucked = draw_string("inside", "train", 0)
    with torch.no_grad():
        found, linear = play(plucked, RATE_HZ, 4_000), linear_string(plucked, RATE_HZ, 4_000)
    assert found.shape == linear.shape == (4_000, plucked.resonator.modes)
    assert float((found - linear).square().sum() / linear.square().sum()) < 1e-3


def test_strings_with_the_same_three_numbers_are_one_to_a_baseline() -> None:
    """Twice the length and four times the mass by length: an octave and a half lower, and nothing else."""
    plucked = draw_string("inside", "train", 1)
    one = plucked.string
    slower = 2 * math.sqrt(4)
    other = replace(
        one,
        length_m=2 * one.length_m,
        density_kg_m3=4 * one.density_kg_m3,
        second_moment_m4=4 * one.second_moment_m4,
        damping_d1_kg_m_s=4 * one.damping_d1_kg_m_s / slower,
        damping_d3_kg_m_s=16 * one.damping_d3_kg_m_s / slower,
    )
    resonator = resonator_of(other, plucked.resonator.modes)
    amplitudes = plucked.amplitudes_m * (units(other)[1] / units(one)[1])
    rise = float(resonator.relative_tension_rise(amplitudes.numpy()))
    assert rise == pytest.approx(plucked.tension_rise, rel=1e-9)
    lower = PluckedString(other, resonator, amplitudes, plucked.pitch_hz / slower, plucked.inharmonicity, rise)
    assert units(one)[0] / units(other)[0] == pytest.approx(slower)
    found, wanted = in_own_units([lower]), in_own_units([plucked])
    for name in ("start", "present", "parameters", "rise", "sigma", "omega"):
        torch.testing.assert_close(getattr(found, name), getattr(wanted, name), rtol=1e-5, atol=1e-7)


def test_modal_synthesis_integrates_the_frequencies_that_its_network_bends() -> None:
    """Where frequencies are higher by one share at all times, each mode is a cosine of that frequency."""
    model = ModalSynthesis()
    with torch.no_grad():
        for block, share in ((model.frequency_block, 0.3), (model.amplitude_block, 0.0)):
            block.out.weight.zero_()
            block.out.bias.fill_(30.0)  # opens the gated linear unit
            block.out.bias[: len(block.out.bias) // 2] = share
    strings = in_own_units([draw_string("inside", "train", number) for number in (0, 3)])
    times = torch.rand(2, 50, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * strings.longest
    with torch.no_grad():
        found = model(strings, times)
        omega = strings.omega * (1 + 0.3 * torch.tanh(strings.rise.double()))
    swing = (times[..., None] * omega[:, None]).cos() * (-times[..., None] * strings.sigma[:, None]).exp()
    torch.testing.assert_close(
        found.double(), swing * strings.start[:, None], rtol=0, atol=2e-3 * float(found.abs().max())
    )


class Clock:
    """A second of processor time whenever somebody looks: what is trained hangs on no load."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def process_time(self) -> float:
        self.now_s += 1
        return self.now_s

    def monotonic(self) -> float:
        return self.now_s


class Stopped(Exception):
    pass


def stop(progress: BaselineProgress) -> None:
    raise Stopped


@pytest.mark.parametrize("name", BASELINES)
def test_a_stopped_training_goes_on_as_if_it_had_not_been(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fitting, "time", Clock())
    monkeypatch.setattr(fitting, "SAVE_EVERY_S", 3.0)
    path, minutes = checkpoint_file(tmp_path, name), 12 / 60
    with pytest.raises(Stopped):
        fit_baseline(name, SMALL, path, minutes, report=stop)
    reported: list[BaselineProgress] = []
    fitted = fit_baseline(name, SMALL, path, minutes, report=reported.append)
    assert reported[-1].share == 1
    assert (fitted.steps, fitted.train, fitted.validation) == (
        reported[-1].steps,
        reported[-1].train,
        reported[-1].validation,
    )
    model = fitted.model.state_dict()
    other = checkpoint_file(tmp_path / "other", name)
    whole: list[BaselineProgress] = []
    uninterrupted = fit_baseline(name, SMALL, other, minutes, report=whole.append).model.state_dict()
    assert [progress.steps for progress in reported] == [progress.steps for progress in whole[1:]]
    kept, ended = trained_baseline(path), fit_baseline(name, SMALL, path, minutes, report=stop)
    for again in (kept, ended):
        assert (again.steps, again.train, again.validation) == (fitted.steps, fitted.train, fitted.validation)
    for key, value in model.items():
        assert all(
            torch.equal(value, f[key]) for f in (uninterrupted, kept.model.state_dict(), ended.model.state_dict())
        )
    with pytest.raises(ValueError, match="of another run"):
        fit_baseline(name, SMALL, path, 2 * minutes)
    checkpoint = Checkpoint.load(path)
    fewer = dict(list(checkpoint.model.items())[1:])
    for damaged in (
        replace(checkpoint, model=fewer, best_model=fewer),
        replace(checkpoint, facts={key: value for key, value in checkpoint.facts.items() if key != "steps"}),
        replace(checkpoint, facts={**checkpoint.facts, "best": None}),
    ):
        damaged.save(path)
        for read in (trained_baseline, lambda path: fit_baseline(name, SMALL, path, minutes)):
            with pytest.raises(ValueError, match=f"{path}: .*; delete it to start the run again"):
                read(path)
    path.write_bytes(b"?")
    with pytest.raises(ValueError, match="damaged checkpoint"):
        trained_baseline(path)


def test_training_lowers_the_error_within_its_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the string that it learns from, over its first tenth of a second."""
    monkeypatch.setattr(fitting, "ROWS", 2)
    configuration = replace(SMALL, strings=1)
    motions = fitting._motions("train", 1, 2_000, configuration, lambda share: None)
    torch.manual_seed(0)
    model = BASELINES["dmsp"]()
    optimiser = torch.optim.AdamW(model.parameters(), lr=1e-3)
    batch = fitting._draw(motions, 0.3, torch.Generator().manual_seed(0))
    start = float(fitting._error(model, *batch).detach().mean())
    for _ in range(40):
        optimiser.zero_grad()
        loss = fitting._error(model, *batch).log().mean()
        loss.backward()
        optimiser.step()
    assert float(fitting._error(model, *batch).detach().mean()) < start / 3


def test_a_baseline_is_trained_and_measured(run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting, "FRAMES_VALIDATED", 8)
    few = ("--strings", 1, "--rate", 8_000, "--json")
    words = ("baseline", "koopman_var", "--minutes", 0.01, "--train-strings", 1, "--runs", tmp_path)
    facts = json.loads(run(*words, *few).out)
    assert (facts["baseline"], facts["minutes"]) == ("koopman_var", 0.01)
    assert facts["parameters"] == 156_259
    assert all(facts[name] > 0 for name in ("steps", "train", "validation"))
    reported = run(*words, *few[:-1]).out  # the training is at its end
    assert reported.startswith(f"koopman_var: 156,259 numbers, {facts['steps']:,} steps of 16 strings and 48 frames")
    assert f"{number(facts['train'])} in training, {number(facts['validation'])} in validation" in reported
    checkpoint = tmp_path / "family_koopman_var" / "checkpoint.safetensors"
    checkpoint.write_bytes(checkpoint.read_bytes()[:1000])
    failure = run(*words, *few).err
    assert f"{checkpoint}: damaged checkpoint" in failure
    assert "delete it to start the run again" in failure
    assert "is not one of koopman_var, dmsp" in run("baseline", "lru").err

"""A shipped patch, rendered by its model and played by samplers: pitch and level beside the note itself."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.export.sampled.job import export_sampled, note_renderer
from app.export.sampled.plan import SampledPlan
from app.instrument.offline import render_note
from app.patches.library import find_patch
from app.patches.patch import Body, Patch
from engine.presets import find_preset, load_preset
from engine.values.effects import Amp, Room
from tests.bench.tune import pitch_hz

RATE_HZ = 48_000
KEYS = (52, 53)


@pytest.fixture
def harp() -> Patch:
    """Without its room: a string alone."""
    return find_patch("Concert harp").patch.with_value("room.mix", 0.0)


@pytest.fixture
def note(harp: Patch) -> Callable[..., NDArray[np.float32]]:
    preset = load_preset(find_preset(harp.preset))

    def rendered(patch: Patch, *words: float, **_: object) -> NDArray[np.float32]:
        return render_note(patch, preset, *words)  # type: ignore[arg-type]

    return rendered


@pytest.mark.parametrize("kind", ["sfz", "sf2"])
def test_it_sounds_as_the_note_itself(
    kind: str, harp: Patch, note: Callable, play: Callable, sfizz: Callable, tmp_path: Path, level_db: Callable
) -> None:
    out = tmp_path / f"harp.{kind}"
    seconds = 0.17 if kind == "sfz" else 1.0
    plan = SampledPlan(harp, KEYS, layers=3, seconds=seconds)
    gain_db = export_sampled(plan, out, note).gain_db
    rendered = [zone.velocity for zone in plan.zones if zone.key == 52]
    offsets, cents = [], []
    for key, velocity in [(52, rendered[0]), (52, rendered[2]), (53, rendered[1]), (53, 20), (53, 127)]:
        direct = note(harp, key, velocity, seconds, seconds, RATE_HZ).T
        part = slice(480, round(0.12 * RATE_HZ))
        if kind == "sfz":
            player = sfizz(out)
            player.press(key, velocity)
            heard = player.play(0.12)
        else:
            heard = play(out, [(0, key, velocity)], 1.0)
            part = slice(2_400, 40_000)
        offsets += [level_db(a[part]) - level_db(b[part]) - gain_db for a, b in zip(heard, direct, strict=True)]
        if velocity in rendered:  # between them, a pluck glides as the one that was rendered
            cents.append(drift_cents(heard[0][part], direct[0][part]))
    assert np.ptp(offsets) < 1.0  # half a dB to either side
    assert np.abs(cents).max() < 0.05


@pytest.mark.parametrize(("key", "layers"), [(28, 2), (28, 4), (33, 4)])
def test_a_note_starts_within_the_reported_error(key: int, layers: int, play: Callable, tmp_path: Path) -> None:
    """Rendered at the hardest velocity of its layer, a note would start about twice as far off."""
    bass = find_patch("Electric bass").patch.model_copy(update={"amp": Amp(), "body": Body(), "room": Room()})
    render, part = note_renderer(load_preset(find_preset(bass.preset)), "model"), slice(480, 12_000)
    plan = SampledPlan(bass, (key, key), layers=layers, seconds=0.5)
    export_sampled(plan, tmp_path / "a.sf2", render)

    @cache
    def live_hz(velocity: int) -> float:
        sound = render(bass, key, velocity, 0.5, 0.5, RATE_HZ, advanced=lambda seconds: None)
        return pitch_hz(sound[part, 0], near_hz)

    near_hz = 440 * 2 ** ((key - 69) / 12)
    errors, at_hardest = [], []
    softest, hardest = plan.zones[-1].velocities
    for velocity in (softest, 100, hardest):
        heard_hz = pitch_hz(play(tmp_path / "a.sf2", [(0, key, velocity)], 0.5)[0][part], near_hz)
        errors.append(abs(1200 * np.log2(heard_hz / live_hz(velocity))))
        at_hardest.append(abs(1200 * np.log2(live_hz(hardest) / live_hz(velocity))))
    print(f"key {key}, {layers} layers: cents {np.round(errors, 1)}, at the hardest {np.round(at_hardest, 1)}")
    assert max(errors) < plan.pitch_error_cents
    assert max(at_hardest) > 1.6 * max(errors) > 3


def drift_cents(heard: NDArray, direct: NDArray) -> float:
    """How much higher one sound is than another that is nearly the same, by their strongest partials."""

    def hz(sound: NDArray) -> float:
        spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound)), 2**19))
        peak = int(spectrum[1:-1].argmax()) + 1
        below, top, above = np.log(spectrum[peak - 1 : peak + 2])
        return float(peak + 0.5 * (below - above) / (below - 2 * top + above))

    return float(1200 * np.log2(hz(heard) / hz(direct)))

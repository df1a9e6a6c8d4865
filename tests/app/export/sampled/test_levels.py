from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.export.sampled.levels import by_key, velocity_levels
from app.export.sampled.plan import SampledPlan, Zone
from app.export.sampled.store import StoredSample
from app.patches.patch import Patch

PatchOf = Callable[..., Patch]
NONE = "0" * 64


def stored(level_db: float) -> StoredSample:
    return StoredSample(made_from=NONE, sha256=NONE, frames=64, channels=1, gain_db=0.0, level_db=level_db)


def levels(patch: Patch, measured_db: list[float]) -> np.ndarray:
    layers = list(SampledPlan(patch, (60, 60), layers=len(measured_db)).zones)
    return velocity_levels(patch, layers, [stored(level) for level in measured_db])


def amplitudes_db(patch: Patch) -> np.ndarray:
    return 20 * np.log10([patch.pluck.pluck(velocity).amplitude_mm for velocity in range(128)])


@pytest.mark.parametrize("curve", [-0.5, 0.0, 0.5])
def test_a_string_that_follows_its_plucks_does_so_at_every_velocity(curve: float, patch_of: PatchOf) -> None:
    patch = patch_of(pluck={"curve": curve})
    wanted = amplitudes_db(patch)
    for rendered in ([127], [63, 127], [42, 84, 127]):
        np.testing.assert_allclose(levels(patch, list(wanted[rendered])), wanted, atol=1e-9)


def test_what_was_measured_holds_where_it_was(patch: Patch) -> None:
    found = levels(patch, [-40.0, -25.0, -22.0])
    assert list(found[[42, 84, 127]]) == pytest.approx([-40, -25, -22])
    assert (np.diff(found[1:]) > 0).all()
    assert found[42] - found[1] == pytest.approx(15 * 41 / 42)  # as steep as to the next layer


def test_plucks_of_one_strength_differ_in_width_alone(patch_of: PatchOf) -> None:
    patch = patch_of(pluck={"softest_mm": 2.0, "hardest_mm": 2.0})
    assert levels(patch, [-30.0, -26.0])[95] == pytest.approx(-28)


def test_a_silent_layer_says_nothing(patch: Patch) -> None:
    np.testing.assert_allclose(levels(patch, [-120.0, -20.0]), amplitudes_db(patch) - amplitudes_db(patch)[-1] - 20)


def test_layers_come_by_key_from_soft_to_hard(patch: Patch) -> None:
    zones = SampledPlan(patch, (50, 51), layers=3).zones
    samples: dict[Zone, StoredSample] = {zone: stored(-zone.key) for zone in reversed(zones)}
    found = list(by_key(samples))
    assert [[zone.velocity for zone in layers] for layers, _ in found] == [[42, 84, 127]] * 2
    assert [[each.level_db for each in own] for _, own in found] == [[-51] * 3, [-50] * 3]

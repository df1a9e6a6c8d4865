"""The laws of velocity."""

from __future__ import annotations

import pytest

from engine.kernels.velocities import between, contact_s, share, velocity


def test_a_contact_is_a_ratio_for_each_step_of_velocity() -> None:
    lasts_ms = [1000 * contact_s(4.0, 1.0, share(each, 0.0)) for each in (0, 1, 64, 127, 200)]
    assert lasts_ms == pytest.approx([4.0, 4.0, 2.0, 1.0, 1.0])
    assert contact_s(0.0, 1.0, 0.5) == contact_s(4.0, 0.0, 0.5) == 0.0


@pytest.mark.parametrize("curve", [-0.7, 0.0, 0.4])
def test_every_velocity_follows_from_its_value(curve: float) -> None:
    for each in range(1, 128):
        assert velocity(0.2, 8.0, between(0.2, 8.0, share(each, curve)), curve) == each
    assert [velocity(0.2, 8.0, value, curve) for value in (0.0, 0.1, 9.0)] == [1, 1, 127]
    assert velocity(3.0, 3.0, 3.0, curve) == 1

"""Plucks that were struck before they were rendered: they sound at once, once, and not after they were forgotten."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.audio import Player, Track
from app.rendering import Take
from app.strikes import Strikes, motion_key
from engine.pluck import Pluck
from engine.preset import read_info


@pytest.fixture
def player() -> Iterator[Player]:
    with Player() as made:
        yield made


@pytest.fixture
def take(small_preset: Path) -> Take:
    return Take("small", read_info(small_preset), Pluck(), 0.5)


def track_of(player: Player, rate_hz: int = 0, sources: tuple[str, ...] = ("model", "truth")) -> Track:
    rate_hz = rate_hz or player.rate_hz
    track = Track(rate_hz, rate_hz, sources)
    track.append({source: np.full(rate_hz, 0.1, np.float32) for source in sources})
    return track


def test_what_is_expected_sounds_once(player: Player, take: Take) -> None:
    strikes, track = Strikes(player, lambda: "truth"), track_of(player)
    assert not strikes.begin(take, track)
    assert player.track is None
    strikes.expect(motion_key(take))
    assert strikes.begin(take, track)
    assert player.track is track
    assert not strikes.awaited
    assert not strikes.begin(take, track)


def test_what_is_forgotten_does_not_sound(player: Player, take: Take) -> None:
    strikes = Strikes(player, lambda: "model")
    strikes.expect(motion_key(take))
    strikes.forget()
    assert not strikes.begin(take, track_of(player))
    assert player.track is None


def test_while_the_player_is_lent_nothing_begins(player: Player, take: Take) -> None:
    strikes = Strikes(player, lambda: "model")
    strikes.expect(motion_key(take))
    strikes.held = True
    assert not strikes.begin(take, track_of(player))
    assert player.track is None


def test_a_track_of_another_rate_or_without_the_source_is_no_fault(player: Player, take: Take) -> None:
    strikes = Strikes(player, lambda: "preset:other")
    strikes.expect(motion_key(take))
    assert not strikes.begin(take, track_of(player, rate_hz=8_000))
    strikes.expect(motion_key(take))
    assert strikes.begin(take, track_of(player))

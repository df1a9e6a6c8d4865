"""Sound devices made of nothing."""

from __future__ import annotations

import pytest

from app.audio.devices import AudioDevice

HEADPHONES = AudioDevice("Headphones", "Test API", 48_000)
SPEAKERS = AudioDevice("Speakers", "Test API", 44_100)


@pytest.fixture
def headphones() -> AudioDevice:
    return HEADPHONES


@pytest.fixture
def speakers() -> AudioDevice:
    """Of another rate."""
    return SPEAKERS

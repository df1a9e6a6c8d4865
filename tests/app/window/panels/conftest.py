from __future__ import annotations

import pytest

from app.shared.vocabulary import Face


@pytest.fixture
def face() -> Face:
    """The panels are the Lab's."""
    return "lab"

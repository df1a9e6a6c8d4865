"""A patch as a file would give it, with text that is no markup."""

from __future__ import annotations

import pytest

from app.patches.library import SHIPPED, read_patch
from app.patches.patch import Patch


@pytest.fixture(scope="session")
def guitar() -> Patch:
    """The shipped classical guitar: six strings, stereo, five macros, a body."""
    return read_patch(SHIPPED / "classical_guitar.json")

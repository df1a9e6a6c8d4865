"""How long the attack lasts: a moment in the suite, thousands of files with `run.py test --fuzz`."""

import os

import pytest
from hypothesis import HealthCheck, settings

LONG = os.environ.get("LEARNED_STRINGS_FUZZ") == "long"
settings.register_profile(
    "attack",
    max_examples=2_000 if LONG else 25,
    deadline=None,  # no timing in an assertion
    derandomize=not LONG,  # the suite attacks in the same way each time
    database=None,
    suppress_health_check=list(HealthCheck),
)
settings.load_profile("attack")


@pytest.fixture(scope="session")
def rounds() -> int:
    """Damaged files of each kind."""
    return int(os.environ.get("LEARNED_STRINGS_FUZZ_FILES", 5_000)) if LONG else 150


@pytest.fixture(scope="session")
def seed() -> int:
    return int(os.environ.get("LEARNED_STRINGS_FUZZ_SEED", "0"))

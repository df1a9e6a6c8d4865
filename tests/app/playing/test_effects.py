"""Body and room of a patch: as long as it is played, and not where models are compared."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from app.instrument.events import MOD_WHEEL, Controller
from app.patches.instrument import SingleString
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.patches.patch import Body, Patch
from app.playing.notes import Notes
from app.playing.sources import Sources
from engine.effects import Effects
from engine.values.ear import Ear
from tests.app.monitors import find_shipped

Wait = Callable[[Callable[[], bool]], None]
EAR = Ear((0.37,))


@pytest.fixture
def patch() -> Patch:
    patch = read_patch(PATCHES / "steel_string_acoustic.json")
    return patch.model_copy(update={"body": Body(name="guitar", mix=0.4)})


class Stage:
    """A player's effects and reports, and the sound that they would go to."""

    def __init__(self, sound: Any) -> None:
        self.effects: list[Effects | None] = []
        self.reports: list[str] = []
        report = lambda message, detail: self.reports.append(message)  # noqa: E731
        self.notes = Notes(sound, Sources(), find_shipped, report, self.effects.append)

    @property
    def ready(self) -> bool:
        return self.notes.keys.player is not None

    def settle(self, wait: Wait) -> None:
        """Until all that was asked for is done."""
        done: list[None] = []
        self.notes.in_background(lambda: done.append(None))
        wait(lambda: bool(done))


@pytest.fixture
def stage(sound: Any) -> Iterator[Stage]:
    made = Stage(sound)
    yield made
    made.notes.close()


def test_they_are_set_once_and_go_with_the_patch(stage: Stage, patch: Patch, wait: Wait) -> None:
    for _ in range(2):
        stage.notes.set_instrument(patch, EAR)
        stage.settle(wait)
    (effects,) = stage.effects
    assert effects is not None and effects.body is not None
    assert (effects.body.name, effects.body.mix) == ("guitar", 0.4)
    stage.notes.set_instrument(SingleString(), EAR)
    stage.settle(wait)
    assert stage.effects[1:] == [None]


def test_they_are_off_while_models_are_compared(stage: Stage, patch: Patch, wait: Wait) -> None:
    stage.notes.set_instrument(patch, EAR)
    wait(lambda: stage.ready)
    stage.settle(wait)
    for dry in (True, False):
        stage.notes.hear_dry(dry)
        stage.settle(wait)
        assert (stage.effects[-1] is None) == dry


def test_the_modulation_wheel_brings_the_room(stage: Stage, patch: Patch, wait: Wait) -> None:
    stage.notes.set_instrument(patch.model_copy(update={"mod_wheel": "room.mix"}), EAR)
    wait(lambda: stage.ready)
    stage.settle(wait)
    for value, mix in ((127, 1.0), (0, patch.room.mix)):
        stage.notes.handle(Controller(MOD_WHEEL, value))
        stage.settle(wait)
        effects = stage.effects[-1]
        assert effects is not None
        assert (effects.room.mix if effects.room is not None else 0.0) == pytest.approx(mix)


def test_a_body_that_is_not_here_is_reported_once_however_its_knobs_are_turned(
    stage: Stage, patch: Patch, wait: Wait
) -> None:
    for mix in (0.2, 0.3, 0.4):
        stage.notes.set_instrument(patch.model_copy(update={"body": Body(name="a cello", mix=mix)}), EAR)
        stage.settle(wait)
    (reported,) = stage.reports
    assert "is played without its body: the body a cello is not here" in reported
    assert all(effects is None or effects.body is None for effects in stage.effects)


def test_a_single_string_has_none_even_where_a_patch_is_kept_beside_it(
    stage: Stage, patch: Patch, wait: Wait
) -> None:
    stage.notes.set_instrument(patch, EAR)
    stage.settle(wait)
    assert stage.effects[-1] is not None
    stage.notes.set_instrument(SingleString(), EAR, patch)
    stage.settle(wait)
    assert stage.effects[-1] is None
    stage.notes.set_instrument(patch, EAR)
    stage.settle(wait)
    assert stage.effects[-1] is not None

"""The LV2 plug-in in a host: it plays what the CLAP plug-in plays, and its ports say how it sounds."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.export.plugin.build import build_plugin
from app.export.plugin.formats import this_target
from app.export.plugin.image import Image
from app.instrument.events import Bend, Controller, NoteOff, NoteOn
from tests.app.export.plugin import host
from tests.app.export.plugin.lv2_host import Instance
from tests.app.export.plugin.pieces import SECONDS, difference_db, patch_of, piece, played

RATE_HZ = 48_000

pytestmark = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang, the extra [plugin]")


@pytest.fixture(scope="module")
def bundle(images: list[Image], objects: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plugin(images, "lv2", this_target(), tmp_path_factory.mktemp("lv2") / "a bank", objects)


def instance_of(bundle: Path, images: list[Image], name: str) -> Instance:
    (image,) = (each for each in images if each.name == patch_of(name).name)
    return Instance(bundle, image.id, image.parameters, RATE_HZ)


def bytes_of(event: NoteOn | NoteOff | Bend | Controller) -> bytes:
    if isinstance(event, NoteOn):
        return bytes((0x90 | event.channel, event.key, event.velocity))
    if isinstance(event, NoteOff):
        return bytes((0x80 | event.channel, event.key, 0))
    if isinstance(event, Bend):
        wheel = 8192 + round(event.value * (8191 if event.value > 0 else 8192))
        return bytes((0xE0 | event.channel, wheel & 127, wheel >> 7))
    return bytes((0xB0 | event.channel, event.number, event.value))


def sound_of(instance: Instance, name: str, block: int = 512) -> NDArray[np.float32]:
    messages = [(round(time_s * RATE_HZ), bytes_of(event)) for time_s, event in piece(patch_of(name))]
    return instance.render(round(SECONDS * RATE_HZ), messages, block)


@pytest.mark.parametrize("name", ("classical_guitar", "sitar", "timpani"))
def test_it_plays_as_the_clap_plug_in(bundle: Path, images: list[Image], bank: host.Library, name: str) -> None:
    other = bank.create(next(id for id, shown in bank.plugins.items() if shown == patch_of(name).name))
    other.activate(RATE_HZ)
    wanted = played(other, patch_of(name), RATE_HZ)
    for block in (17, 1_000, 4_096):
        instance = instance_of(bundle, images, name)
        assert np.array_equal(sound_of(instance, name, block), wanted)
        instance.destroy()


def test_ports_that_return_to_their_defaults_while_it_is_inactive_count(bundle: Path, images: list[Image]) -> None:
    name = "electric_bass"
    plain, instance = instance_of(bundle, images, name), instance_of(bundle, images, name)
    wanted, standard = sound_of(plain, name), instance.values.copy()
    (volume,) = (
        n
        for image in images
        if image.name == patch_of(name).name
        for n, each in enumerate(image.parameters)
        if each.id == "volume_db"
    )
    instance.values[volume] = -24.0
    instance.activate_again()
    assert difference_db(sound_of(instance, name), wanted) > -10
    instance.values[:] = standard
    instance.activate_again()
    assert np.array_equal(sound_of(instance, name), wanted)
    for each in (plain, instance):
        each.destroy()

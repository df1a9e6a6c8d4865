"""Voices of a plug-in and of the app, in turns: how many times faster than real time each plays the same notes.

Costs are processor time of this thread. Of many rounds the fastest counts, on which other processes have no effect.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.export.plugin.build import build_plugin
from app.export.plugin.formats import this_target
from app.export.plugin.image import image_of
from app.instruments.instrument import Instrument
from app.instruments.library import find_instrument
from app.player.events import NoteOn
from app.player.offline import OfflinePlayer
from app.player.strings import Strings
from bench.machine import RATE_HZ
from engine.kernels import cache
from engine.presets import SHIPPED, Preset, load_preset
from tests.app.export.plugin.host import Instance, Library, note_on
from training.cli.console import ProgressReport

INSTRUMENTS = ("electric_bass", "classical_guitar", "concert_harp", "sitar")
NOTES, VELOCITY = 36, 102
BLOCK_FRAMES, BLOCKS, ROUNDS = 512, 4, 40


@dataclass(frozen=True)
class PluginCost:
    """Notes of an instrument, all struck at once, with its body, room and amplifier.

    Attributes:
        modes: of the lowest note.
        app_faster, plugin_faster: than real time, at 48 kHz in blocks of 512.
        ratio: of the plug-in to the app.
        busiest_block: share of a core of the plug-in's slowest block in two seconds from the strokes on.
    """

    instrument: str
    notes: int
    modes: int
    app_faster: float
    plugin_faster: float
    ratio: float
    busiest_block: float


def measure(report: ProgressReport) -> dict[str, Any]:
    """Build a plug-in of all INSTRUMENTS, and play each."""
    instruments = [find_instrument(name).instrument for name in INSTRUMENTS]
    presets = [load_preset(SHIPPED / f"{instrument.preset}.safetensors") for instrument in instruments]
    images = [image_of(instrument, preset) for instrument, preset in zip(instruments, presets, strict=True)]
    with tempfile.TemporaryDirectory() as folder:
        path, kept = Path(folder) / "plugin", cache.folder() or Path(folder)
        library = Library(
            build_plugin(images, "clap", this_target(), path, kept, lambda step, share: report(share, step))
        )
        parts = zip(INSTRUMENTS, instruments, presets, images, strict=True)
        costs = tuple(
            _cost(name, instrument, preset, Instance(library, image.id)) for name, instrument, preset, image in parts
        )
    return {"plugins": costs}


def _cost(name: str, instrument: Instrument, preset: Preset, instance: Instance) -> PluginCost:
    low, high = instrument.range
    keys = range(low, min(low + NOTES, high + 1))
    player = OfflinePlayer(instrument, preset, RATE_HZ, {"model": 1.0}, limited=True, varied=True, dry=False)
    instance.activate(RATE_HZ)
    for key in keys:
        player.handle(NoteOn(key, VELOCITY), 0)
    player.mixer.render(BLOCK_FRAMES)
    instance.render(BLOCK_FRAMES, [note_on(0, key, VELOCITY) for key in keys])
    next_block = instance.repeated(np.zeros((2, BLOCK_FRAMES), np.float32))
    busiest_s = max(_taken_s(next_block, 1) for _ in range(2 * RATE_HZ // BLOCK_FRAMES))
    rounds = [(_taken_s(lambda: player.mixer.render(BLOCK_FRAMES)), _taken_s(next_block)) for _ in range(ROUNDS)]
    instance.destroy()
    app_s, plugin_s = (min(times) for times in zip(*rounds, strict=True))
    string, sound_s = Strings(instrument).of_key(low), BLOCK_FRAMES * BLOCKS / RATE_HZ
    modes = string.modes if string is not None else 0
    busiest = busiest_s * RATE_HZ / BLOCK_FRAMES
    return PluginCost(name, len(keys), modes, sound_s / app_s, sound_s / plugin_s, app_s / plugin_s, busiest)


def _taken_s(render: Callable[[], object], blocks: int = BLOCKS) -> float:
    began_s = time.thread_time()
    for _ in range(blocks):
        render()
    return time.thread_time() - began_s

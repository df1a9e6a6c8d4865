"""Drums: frequencies and pitch drops compared with published ones; costs of voices, kit, picture and choosing one.

Costs are processor time of this thread at 48 kHz, less that of an empty mixer, as shares of a core. The least of some
repeats counts: other processes only add.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QPixmap

from app.instrument.compiled import InstrumentPlayer
from app.instrument.events import Event, NoteOn
from app.patches.drums import Drums
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.patches.patch import Patch
from engine.presets import SHIPPED, load_preset
from engine.values.drum import Mallet
from engine.voices import Mixer
from tests.bench.machine import Machine, one_thread

RATE_HZ = 48_000
EDGES_S = (0.0, 0.05, 1.0)  # of the ages of voices that are measured apart
REPEATS = 5
STEP_FRAMES = 480
VELOCITY = 110
PICTURES = (("concert_toms", 36), ("concert_toms", 47), ("timpani", 50), ("soft_plate", 60), ("thin_bars", 72))
INSTRUMENTS = ("concert_toms", "tuned_toms", "frame_drum", "conga", "timpani", "soft_plate", "thin_bars")
T = TypeVar("T")
# A tom: Rossing, Science of Percussion Instruments (2000), 26, as J. Hsu's code quotes it (percussionSynthesis,
# tomtoms.m): 142 Hz and ratios; which mode is which is our reading. Its size is not quoted; (1,1) sets the tension.
# A timpani head: Christian et al., JASA 76 (1984), 1336, from memory.
MEASURED_HZ: dict[str, dict[tuple[int, int], float]] = {
    "tom_12": {
        mode: 142 * ratio
        for mode, ratio in zip(
            [(1, 1), (0, 1), (2, 1), (0, 2), (3, 1), (1, 2), (4, 1)],
            [2.15, 1, 3.17, 3.42, 4.09, 4.80, 4.94],
            strict=True,
        )
    },
    "timpani_head_26": {(0, 1): 82, (1, 1): 155, (2, 1): 229, (3, 1): 297, (4, 1): 366, (5, 1): 431},
}
DRUM_FILES, MODES_COMPARED = Path(__file__).parents[2] / "presets" / "drums", 40
# Drops of hard blows in percent. Toms: "almost 8 %" of one of 14 inches (Gärder, Chalmers thesis 2005:23, C.4.3), 160
# cents of one of 32 cm (Bork, PTB 1983, by Fletcher and Rossing, 18.4), both as CWBudde/algo-drum quotes them
# (docs/paper/references.bib). A kick drum: "around 10 percent" (Reid, Sound on Sound, January 2002).
PUBLISHED_DROPS = {"Tom": (8.0, 9.7), "Floor tom": (8.0, 9.7), "Bass drum": (9.0, 11.0)}
SIZES = (400, 800, 1500)  # modes
HARD = Mallet(mass_kg=0.015, radius_m=0.002, contact_s=0.0005)  # so that all modes move
STRINGS, STRING_PATCH = (40, 45, 50, 55, 59, 64, 67, 71), "classical_guitar"


@dataclass(frozen=True)
class DrumCost:
    """Of notes that begin together.

    Attributes:
        onset, first_second: shares of a core over the first 50 ms, and the first second.
    """

    what: str
    voices: int
    modes: int
    onset: float
    first_second: float


@dataclass(frozen=True)
class PictureCost:
    """Of the picture of a drum in the window.

    Attributes:
        modes, shown: of the drum, and in its picture.
        shapes_s: to prepare the shapes on the grid, once for each drum.
        second_s: to render motion, sound and errors of model and truth, for each second.
        picture_ms: to compute a picture of one source.
        painted_ms: to paint it, 1240 by 300 pixels.
    """

    drum: str
    modes: int
    shown: int
    shapes_s: float
    second_s: float
    picture_ms: float
    painted_ms: float


@dataclass(frozen=True)
class ChoiceCost:
    """Of an instrument that is chosen for the first time: modes, radiation and gains of all its keys."""

    instrument: str
    keys: int
    seconds: float


@dataclass(frozen=True)
class MeasuredMode:
    """A frequency of a drum in air, and a published measurement."""

    drum: str
    mode: str
    measured_hz: float
    computed_hz: float

    @property
    def error_percent(self) -> float:
        return 100 * (self.computed_hz / self.measured_hz - 1)


@dataclass(frozen=True)
class PitchDrop:
    """Of the hardest blow on a drum of the kit, from its first half-period on, and the published range."""

    drum: str
    drop_percent: float
    lowest_percent: float
    highest_percent: float


@dataclass(frozen=True)
class DrumsBenchmark:
    machine: Machine
    rate_hz: int
    modes: tuple[MeasuredMode, ...]
    drops: tuple[PitchDrop, ...]
    drums: tuple[DrumCost, ...]
    pictures: tuple[PictureCost, ...]
    choices: tuple[ChoiceCost, ...]


def measure(report: Callable[[float, str], None]) -> DrumsBenchmark:
    """Drums of so many modes, struck by something small and hard and by a stick; a kit, and a kit with strings."""
    found: list[DrumCost] = []
    kit, guitar = (read_patch(PATCHES / f"{name}.json") for name in ("concert_toms", STRING_PATCH))
    pads = [drum.note for drum in _drums(kit).drums]
    with one_thread():
        for number, size in enumerate(SIZES):
            report(number / (len(SIZES) + 2), f"{size} modes")
            patch = _of_size(size)
            found.append(_cost("one drum, a stick", size, (patch, (47,))))
            found.append(_cost("one drum, small and hard", size, (_with_mallet(patch), (47,))))
        report(len(SIZES) / (len(SIZES) + 2), "kit")
        found.append(_cost("kit", 0, (kit, pads)))
        found.append(_cost("kit and strings", 0, (kit, pads), (guitar, STRINGS)))
        report((len(SIZES) + 1) / (len(SIZES) + 2), "pictures")
        pictures = tuple(_picture(*drum) for drum in PICTURES)
        choices = tuple(_choice(name) for name in INSTRUMENTS)
        return DrumsBenchmark(Machine.here(), RATE_HZ, measured_modes(), _drops(kit), tuple(found), pictures, choices)


def measured_modes() -> tuple[MeasuredMode, ...]:
    """Modes of drums whose frequencies are published."""
    from app.commands.drums import drum_of, mode_rows

    found = []
    for name, measured in MEASURED_HZ.items():
        modes = drum_of(str(DRUM_FILES / f"{name}.toml"), None)[1].modes
        computed = {(m, n): hz for m, n, hz, *_ in reversed(mode_rows(modes, MODES_COMPARED))}  # of a pair the lower
        found += [MeasuredMode(name, f"({m},{n})", hz, computed[m, n]) for (m, n), hz in measured.items()]
    return tuple(found)


def _drops(kit: Patch) -> tuple[PitchDrop, ...]:
    from app.instrument.drum_keys import DrumKeys
    from engine.values.ear import Ear

    keys, found = DrumKeys(kit, Ear((0.5,))), []
    for drum in _drums(kit).drums:
        key = keys.of_key(drum.note)
        published = next((drops for name, drops in PUBLISHED_DROPS.items() if drum.name.startswith(name)), None)
        if key is not None and published is not None:
            cents = key.drop_cents(127, kit.pluck.curve)
            found.append(PitchDrop(drum.name, 100 * (2 ** (cents / 1200) - 1), *published))
    return tuple(found)


def _choice(name: str) -> ChoiceCost:
    from app.instrument.drum_keys import DrumKeys, tuned
    from engine.resonators import surface
    from engine.values.ear import Ear

    patch = read_patch(PATCHES / f"{name}.json")
    low, high = patch.range

    def choose() -> int:
        tuned.cache_clear()
        surface.modes_below.cache_clear()
        surface.air_below.cache_clear()
        keys = DrumKeys(patch, Ear((0.4, 0.6)))
        return sum(keys.of_key(key) is not None for key in range(low, high + 1))

    seconds, count = _timed(choose, 3)
    return ChoiceCost(name, count, seconds)


def _picture(patch: str, key: int) -> PictureCost:
    from PySide6.QtWidgets import QApplication

    from app.instrument.drum_keys import DrumKeys
    from app.rendering import BlowRequest, BlowTake
    from app.rendering.blow import Head
    from app.rendering.blow_job import BlowJob
    from app.rendering.loaded import Loaded
    from app.session.shown import DEFAULT_SOURCES
    from app.views.drum.ink import HeadFrame
    from app.views.drum.view import DrumView
    from engine.values.ear import Ear

    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    application = QApplication.instance() or QApplication([])
    found = DrumKeys(read_patch(PATCHES / f"{patch}.json"), Ear((0.5,))).of_key(key)
    assert found is not None
    drum, surface = found.modes.drum, found.modes.surface
    shapes_s, _ = _timed(lambda: Head.of(surface, (drum.length_m, drum.width_m)), 1)
    path = SHIPPED / "studio_any_string.safetensors"
    loaded = Loaded(load_preset(path))
    request = BlowRequest(path, found.modes, found.strike(VELOCITY), 1.0, Ear((0.5,)))

    class Silent:
        def take_started(self, take: object) -> None: ...

        def take_finished(self, take: object) -> None: ...

        def other_failed(self, preset: str, message: str) -> None: ...

        def render_failed(self, message: str, detail: str) -> None: ...

    def render() -> BlowTake:
        with ThreadPoolExecutor(1) as helper:
            job = BlowJob(request, lambda _: loaded, Silent(), helper)
            while not job.idle:
                job.advance()
        assert job.take is not None
        return job.take

    render()  # loads the shapes
    second_s, take = _timed(render, REPEATS)

    def picture() -> NDArray[np.float32]:
        amplitudes = take.modal_m("model", 0.1, 0.02)
        assert amplitudes is not None
        return take.head.picture(amplitudes)

    picture_s, pixels = _timed(picture, 50 * REPEATS)
    view = DrumView()
    view.resize(1240, 300)
    view.set_drum(patch, drum.shape, (drum.length_m, drum.width_m))
    view.set_sources(DEFAULT_SOURCES[:1])
    view.show_frame(HeadFrame({"model": pixels}))
    target = QPixmap(view.size())
    painted_s, _ = _timed(lambda: view.render(target), 50 * REPEATS)
    view.close()
    application.processEvents()
    shown = len(take.head.shapes)
    return PictureCost(
        f"{patch} {key}", len(found.modes), shown, shapes_s, second_s, 1e3 * picture_s, 1e3 * painted_s
    )


def _timed(work: Callable[[], T], repeats: int) -> tuple[float, T]:
    """The least of the process's processor times in s, and the result."""
    times = []
    for _ in range(repeats):
        began_s = time.process_time()
        found = work()
        times.append(time.process_time() - began_s)
    return min(times), found


def _drums(patch: Patch) -> Drums:
    assert isinstance(patch.strings, Drums)
    return patch.strings


def _of_size(modes: int) -> Patch:
    """The tom whose modes below a frequency are so many, about."""
    from app.instrument.drum_keys import DrumKeys
    from engine.values.ear import Ear

    patch = read_patch(PATCHES / "tuned_toms.json")
    low, high = 1_000.0, 19_000.0
    for _ in range(8):
        middle = (low + high) / 2
        found = DrumKeys(_below(patch, middle), Ear((0.5,))).of_key(47)
        assert found is not None
        low, high = (middle, high) if len(found.modes) < modes else (low, middle)
    return _below(patch, high)


def _below(patch: Patch, highest_hz: float) -> Patch:
    return patch.model_copy(update={"strings": _drums(patch).model_copy(update={"highest_hz": highest_hz})})


def _with_mallet(patch: Patch) -> Patch:
    drum = _drums(patch).drums[0].model_copy(update={"mallet": HARD})
    return patch.model_copy(update={"strings": _drums(patch).model_copy(update={"drums": (drum,)})})


def _cost(what: str, modes: int, *played: tuple[Patch, object]) -> DrumCost:
    runs, empty = [], []
    count = 0
    for _ in range(REPEATS):
        times, count = _times_s(played)
        runs.append(times)
        empty.append(sum(_times_s(())[0]))
    empty_share = min(empty) / EDGES_S[-1]
    onset_s, rest_s = (min(times) for times in zip(*runs, strict=True))
    return DrumCost(
        what, count, modes, onset_s / EDGES_S[1] - empty_share, (onset_s + rest_s) / EDGES_S[2] - empty_share
    )


def _times_s(played: tuple[tuple[Patch, object], ...]) -> tuple[list[float], int]:
    """Processor time for each age, of a mixer for each instrument; and how many notes began."""
    stages, began = [], 0
    for patch, keys in played or ((None, ()),):
        mixer = Mixer(RATE_HZ)
        if patch is not None:
            player = InstrumentPlayer(
                patch, load_preset(SHIPPED / f"{patch.preset}.safetensors"), RATE_HZ, {"model": 1.0}
            )
            mixer.set_player(player.compiled)
            events: list[Event] = [NoteOn(key, VELOCITY) for key in keys]  # type: ignore[attr-defined]
            for event in events:
                player.handle(event)
            began += len(events)
        stages.append(mixer)
    found = []
    for begin_s, end_s in pairwise(EDGES_S):
        began_s = time.thread_time()
        for _ in range(round((end_s - begin_s) * RATE_HZ) // STEP_FRAMES):
            for mixer in stages:
                mixer.render(STEP_FRAMES)
        found.append(time.thread_time() - began_s)
    return found, began

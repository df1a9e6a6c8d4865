"""Cost of a pluck's pictures and signals: processor time, memory, and the time after a listening point has moved.

Processor times are of all threads of this process; other processes have little effect on them.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.playing.sources import Sources
from app.rendering import NoteSound, Take
from app.rendering.job import RenderJob
from engine.pluck import DEFAULT_LISTEN, Pluck
from engine.presets import SHIPPED
from engine.values.ear import Ear
from training.cli.console import ProgressReport

PRESETS = ("studio_any_string", "studio_nylon_b3", "studio_nylon_g3", "studio_steel_ds3", "studio_steel_e4")
SECONDS = 10.0
SPEED = 0.004  # of slow motion, as at the first start
EARS = tuple(Ear((point,)) for point in (DEFAULT_LISTEN, 0.2, 0.55, 0.8))
MEGABYTE = 1e6


@dataclass(frozen=True)
class TakeCost:
    """Model and truth of one pluck.

    Attributes:
        picture_hz: pictures per second.
        rendered_s: processor time for all pictures and signals of both.
        megabytes: memory of one source.
        moved_s, moved_wall_s: processor and wall-clock time from a moved listening point to both signals there; the
            shortest of a few.
    """

    preset: str
    seconds: float
    picture_hz: float
    rendered_s: float
    megabytes: float
    moved_s: float
    moved_wall_s: float


def _say_nothing(*_: object) -> None:
    """Ignore the signals of a job."""


def measure(report: ProgressReport) -> dict[str, Any]:
    """Measure PRESETS."""
    found = []
    with ThreadPoolExecutor(1) as helper:
        for number, name in enumerate(PRESETS):
            report(number / len(PRESETS), name)
            found.append(_measure(SHIPPED / f"{name}.safetensors", helper))
    return {"takes": tuple(found)}


def _measure(path: Path, helper: ThreadPoolExecutor) -> TakeCost:
    sources = Sources()
    request = NoteSound(path, Pluck(), SECONDS, EARS[0], SPEED)
    _finish(RenderJob(replace(request, seconds=0.1), sources.load, _say_nothing, helper))  # loads and compiles
    job = RenderJob(request, sources.load, _say_nothing, helper)
    rendered_s, _ = _finish(job)
    take = job.take
    assert isinstance(take, Take)
    moved = []
    for ear in EARS[1:]:
        job.ask_again(replace(request, ear=ear))
        moved.append(_finish(job))
    moved_s, moved_wall_s = map(min, zip(*moved, strict=True))
    series = (take.motions["model"], take.listened.signals["model"])
    megabytes = sum(part.read().nbytes for part in series) / MEGABYTE
    return TakeCost(path.stem, SECONDS, take.frames_hz, rendered_s, megabytes, moved_s, moved_wall_s)


def _finish(job: RenderJob) -> tuple[float, float]:
    """Finish the job; return processor time and wall-clock time in s."""
    began_s, began_wall_s = time.process_time(), time.perf_counter()
    while not job.idle:
        job.advance()
    return time.process_time() - began_s, time.perf_counter() - began_wall_s

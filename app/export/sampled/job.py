"""The export of a patch as SFZ or SoundFont 2: samples rendered or kept, then the file that plays them.

A stopped export continues with the same call: whole samples are kept, unless what they sound of has changed.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import soundfile

from app.export.sampled.levels import headroom_db
from app.export.sampled.plan import NoteRenderer, SampledPlan, SampledSource
from app.export.sampled.sf2 import check_sf2, write_sf2
from app.export.sampled.sfz import sfz_gain_db, sfz_text
from app.export.sampled.store import INDEX, SampleStore, read_index
from app.shared.worker import Cancelled, Progress
from engine.result_file import WriteError, explain, whole_file

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from app.patches.patch import Patch
    from engine.presets import Preset

SUFFIXES = (".sfz", ".sf2")
LONGEST_STEM = 60


@dataclass(frozen=True)
class SampledReport:
    """What was written.

    Attributes:
        samples: how many the instrument has; rendered: how many of them were not there yet.
        size_bytes: of the instrument with all its samples.
        cut: samples that still rang at their end, and were faded out.
        gain_db: by how much the whole is louder than the patch: an SFZ is softer where a note would clip, a SoundFont
            is raised to full level.
        peak_db: of its loudest note as a sampler plays it, relative to full scale.
    """

    path: Path
    samples: int
    rendered: int
    size_bytes: int
    cut: int
    gain_db: float
    peak_db: float


def plain_stem(text: str) -> str:
    """`text` with ASCII letters, digits and `_.+-` alone, which every SFZ player accepts on every system."""
    return re.sub(r"[^A-Za-z0-9_.+-]+", "_", text[:LONGEST_STEM]).strip("._-") or "patch"


def sample_folder(out: Path) -> Path:
    """Where the samples of an instrument's file lie; a SoundFont's only until it is whole."""
    kind = "samples" if out.suffix.lower() == ".sfz" else "sf2_samples"
    return out.with_name(f"{plain_stem(out.stem)}_{kind}")


def planned(plan: SampledPlan, out: Path) -> SampledPlan:
    """The plan as it is carried out for a file of this kind.

    Raises:
        ValueError: the file's kind is not known, or a SoundFont cannot hold it.
    """
    if out.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{out}: must end with {' or '.join(SUFFIXES)}")
    if out.suffix.lower() == ".sfz":
        return plan
    check_sf2(replace(plan, format="wav", bits="16"))
    return replace(plan, format="flac", bits="24")  # stored so, until all of them are one file of 16 bits


def export_sampled(
    plan: SampledPlan, out: Path, render: NoteRenderer, *, progress: Progress = lambda *_: None
) -> SampledReport:
    """Renders the samples of a plan and writes OUT.sfz beside their folder, or OUT.sf2 with all of them in it.

    Raises:
        ValueError: see `planned`.
        Cancelled: `progress` raised it; whole samples stay for the next time, without any no folder stays.
        WriteError: a file cannot be written, or a note not rendered.
    """
    plan = planned(plan, out)
    store = SampleStore(sample_folder(out), out.name)
    with store.locked():
        try:
            samples, rendered = store.fill(plan, render, progress)
        except Cancelled:
            if store.empty:
                store.remove()
            raise
        try:
            with whole_file(out) as file:
                if out.suffix.lower() == ".sfz":
                    file.write(sfz_text(plan, samples, store.folder.name).encode())
                    gain_db = sfz_gain_db(plan.patch, samples)
                else:
                    gain_db = write_sf2(file, plan, samples, store.folder, progress)
            size = out.stat().st_size
            if out.suffix.lower() == ".sfz":
                size += sum(store.path(plan.file_name(zone)).stat().st_size for zone in samples)
        except OSError as error:
            raise WriteError(explain(out, error)) from error
        except soundfile.LibsndfileError as error:
            raise WriteError(f"{store.folder}: a sample cannot be read ({error.error_string}); try again") from error
    if out.suffix.lower() == ".sf2":
        store.remove()
    cut = sum(sample.cut for sample in samples.values())
    headrooms_db = headroom_db(plan.patch, samples)
    loudest_db = max(sample.peak_db + headrooms_db[zone] for zone, sample in samples.items())
    return SampledReport(out, len(samples), rendered, size, cut, gain_db, loudest_db + gain_db)


def note_renderer(preset: Preset, source: SampledSource) -> NoteRenderer:
    """Renders notes of a patch by its model, or by the solved string of the same keys."""
    from app.instrument.offline import render_note  # compiled code, and torch

    def rendered(
        patch: Patch,
        key: int,
        velocity: int,
        held_s: float,
        seconds: float,
        rate_hz: int,
        *,
        advanced: Callable[[float], None],
    ) -> NDArray[np.float32]:
        return render_note(patch, preset, key, velocity, held_s, seconds, rate_hz, source, advanced)

    return rendered


def kept_samples(plan: SampledPlan, out: Path) -> int:
    """How many samples of a plan are there already from an export that was stopped, by its index.

    Raises:
        ValueError: see `planned`.
        WriteError: there is an index that cannot be read.
    """
    plan = planned(plan, out)
    index = read_index(sample_folder(out) / INDEX)
    if index is None or index.instrument != out.name:
        return 0
    found = ((zone, index.samples.get(plan.file_name(zone))) for zone in plan.zones)
    return sum(sample is not None and sample.made_from == plan.digest(zone) for zone, sample in found)

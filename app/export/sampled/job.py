"""The export of an instrument as SFZ or SoundFont 2: samples, then the file that plays them."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from app.audio.sound_file import UnreadableSound
from app.export.sampled.levels import headroom_db
from app.export.sampled.plan import SampledPlan, SampledSource, Zone
from app.export.sampled.sample import StoredSample, encoded, sample_of
from app.export.sampled.sf2 import check_sf2, write_sf2
from app.export.sampled.sfz import sfz_gain_db, sfz_text
from app.export.sampled.words import SMALLEST_REPORTED_DB, SampledReport, megabytes, notes, number_of, pitch_words
from app.shared.key_names import note_name
from app.shared.worker import Progress
from engine.presets import Preset, load_preset
from engine.whole_file import WriteError, explain, replaceable, result_file, working_folder

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

NoteRenderer = Callable[..., "NDArray[np.float32]"]

SUFFIXES = (".sfz", ".sf2")
LONGEST_STEM = 60
_OURS = re.compile(r"key\d{3}_vel\d{3}\.(flac|wav)|\.?index\.(json|lock)")  # an index: of earlier versions


def plain_stem(text: str) -> str:
    """The text with ASCII letters, digits and `_.+-` alone, which every SFZ player accepts on every system."""
    return re.sub(r"[^A-Za-z0-9_.+-]+", "_", text[:LONGEST_STEM]).strip("._-") or "instrument"


def sample_folder(out: Path) -> Path:
    """The folder of the samples of an SFZ."""
    return out.with_name(f"{plain_stem(out.stem)}_samples")


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
    """Render the samples of a plan and write OUT.sfz beside their folder, or OUT.sf2 with all of them in it.

    Until all samples are rendered, nothing else is changed.

    Args:
        render: is called with instrument, key, velocity, the time held, duration and rate, and `advanced`, which gets
            the seconds rendered and may raise. Returns float32 (frames, channels), ±1 being full scale.

    Raises:
        ValueError: see `planned`.
        Cancelled: `progress` raised it; nothing is written.
        WriteError: a file cannot be written, or a note not rendered.
    """
    plan, soundfont = planned(plan, out), out.suffix.lower() == ".sf2"
    folder = sample_folder(out)
    if not soundfont:
        _check_replaceable(folder, out)
    try:
        replaceable(out)
        with working_folder(out.parent, folder.name) as unfinished:
            samples_folder = unfinished / folder.name
            samples_folder.mkdir()
            samples = _write_samples(plan, samples_folder, render, progress)
            if soundfont:
                with result_file(out) as file:
                    gain_db = write_sf2(file, plan, samples, samples_folder, progress)
                size = out.stat().st_size
            else:
                size = sum(path.stat().st_size for path in samples_folder.iterdir())
                with result_file(out) as file:
                    size += file.write(sfz_text(plan, samples, folder.name).encode())
                    file.flush()
                    if folder.exists():
                        shutil.rmtree(folder)
                    samples_folder.replace(folder)
                gain_db = sfz_gain_db(plan.instrument, samples)
    except OSError as error:
        raise WriteError(explain(out, error)) from error
    except UnreadableSound as error:
        raise WriteError(f"{out}: a sample cannot be read ({error}); try again") from error
    cut = sum(sample.cut for sample in samples.values())
    headrooms_db = headroom_db(plan.instrument, samples)
    loudest_db = max(sample.peak_db + headrooms_db[zone] for zone, sample in samples.items())
    return SampledReport(out, len(samples), size, cut, gain_db, loudest_db + gain_db)


def _check_replaceable(folder: Path, out: Path) -> None:
    """Raise WriteError where a folder of samples is not of this instrument, or holds anything else."""
    try:
        others = [path for path in folder.iterdir() if not _OURS.fullmatch(path.name)]
    except FileNotFoundError:
        return
    except OSError as error:
        raise WriteError(explain(folder, error)) from error
    if others or not out.exists():
        raise WriteError(f"{folder}: holds other files; remove it, or choose another name for {out.name}")


def _write_samples(
    plan: SampledPlan, folder: Path, render: NoteRenderer, progress: Progress
) -> dict[Zone, StoredSample]:
    """Write the sample of each zone into a folder."""
    stored_samples = {}
    started = time.monotonic()
    for done, zone in enumerate(plan.zones):
        share, text = done / len(plan.zones), f"{note_name(zone.key)}, velocity {zone.velocity}"
        if done == 1:
            started = time.monotonic()  # the first note also loads and compiles
        left_s = (time.monotonic() - started) * (len(plan.zones) - done) / (done - 1) if done > 1 else None
        report = partial(progress, share, text, left_s)
        report()
        path = folder / plan.file_name(zone)
        note = (plan.instrument, zone.key, zone.velocity, plan.seconds, plan.seconds, plan.rate_hz)
        try:
            sound, stored = sample_of(render(*note, advanced=lambda _, report=report: report()), plan.rate_hz)
        except ValueError as error:
            raise WriteError(f"{path.name}: {error}") from error
        path.write_bytes(encoded(sound, plan.rate_hz, plan.format, plan.bits))
        stored_samples[zone] = replace(stored, level_db=round(stored.level_db, 3))
    return stored_samples


def note_renderer(preset: Preset, source: SampledSource) -> NoteRenderer:
    """Render notes of an instrument by its model, or by the solved string of the same keys."""
    from app.player.offline import render_note  # compiled code, and torch

    return lambda instrument, key, velocity, held_s, seconds, rate_hz, *, advanced: render_note(
        instrument, preset, key, velocity, held_s, seconds, rate_hz, source, advanced
    )


@dataclass(frozen=True)
class SampledExport:
    """The export of an instrument for samplers. See `ExportJob`.

    Attributes:
        preset: the file of the preset that plays the instrument.
    """

    plan: SampledPlan
    out: Path
    preset: Path
    cancelled = "nothing was written."

    @property
    def file(self) -> Path:
        return self.out

    def run(self, progress: Progress) -> str:
        """Render the samples and write the instrument; see `ExportJob`."""
        progress(0.0, "Loading the model")
        plan = self.plan
        report = export_sampled(
            plan, self.out, note_renderer(load_preset(self.preset), plan.source), progress=progress
        )
        samples = f"{number_of(report.samples, 'sample')}, {megabytes(report.size_bytes)}"
        alike = ", as loud as the instrument" if abs(report.gain_db) < SMALLEST_REPORTED_DB else ""
        level = f"peak {report.peak_db:.1f} dBFS{alike}"
        lines = [f"Saved {report.path} ({samples}, {level}, {pitch_words(plan.pitch_error_cents)})."]
        lines += [f"{note[0].upper()}{note[1:]}." for note in notes(plan, report, "Dry")]
        return "\n".join(lines)

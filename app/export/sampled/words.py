"""Size and result of an export of samples, with notes on it in words, for the command line and the window alike."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.export.sampled.plan import SampledPlan
from app.export.sampled.sf2 import ZEROS_BEHIND

SMALLEST_REPORTED_DB = 0.05
_LINES_BYTES = 512  # of a sample at most: its lines of the SFZ and its file's header, or its rows of a SoundFont


@dataclass(frozen=True)
class SampledReport:
    """The report of an instrument that was written.

    Attributes:
        samples: how many the instrument has.
        size_bytes: of the instrument with all its samples.
        cut: samples that still rang at their end, and were faded out.
        gain_db: relative to the instrument. An SFZ is softer where a note would clip; a SoundFont has full level.
        peak_db: of its loudest note as a sampler plays it, relative to full scale.
    """

    path: Path
    samples: int
    size_bytes: int
    cut: int
    gain_db: float
    peak_db: float


def number_of(count: int, thing: str) -> str:
    """A count with its noun, such as "1 key", "2 keys"."""
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"


def instrument_bytes(plan: SampledPlan, soundfont: bool) -> int:
    """The finished instrument's size at most: as if all samples were of full length and FLAC did not compress."""
    if soundfont:
        behind = ZEROS_BEHIND * len(plan.zones) * plan.channels * 2
        return plan.largest_bytes * 16 // int(plan.bits) + behind + _LINES_BYTES * len(plan.zones) * plan.channels
    return plan.largest_bytes + _LINES_BYTES * len(plan.zones)


def needed_bytes(plan: SampledPlan, soundfont: bool) -> int:
    """The space on disk needed at most: a SoundFont's samples, FLAC of 24 bits, lie beside it until the end."""
    return instrument_bytes(plan, soundfont) + (plan.largest_bytes * 24 // int(plan.bits) if soundfont else 0)


def size_words(plan: SampledPlan, soundfont: bool) -> str:
    """The instrument's size, and what else is needed meanwhile, in words."""
    most = f"at most {megabytes(instrument_bytes(plan, soundfont))}"
    if soundfont:
        beside = needed_bytes(plan, soundfont) - instrument_bytes(plan, soundfont)
        return f"{most} (16-bit), and up to {megabytes(beside)} more while it is written"
    return f"{most}, before FLAC compression" if plan.format == "flac" else most


def counted(plan: SampledPlan) -> str:
    """The numbers of samples, keys and layers in words."""
    zones = plan.zones
    keys = number_of(len({zone.key for zone in zones}), "key")
    between = "" if plan.every == 1 else f", each for {plan.every} keys"
    layers = number_of(plan.layers, "velocity layer")
    return f"{number_of(len(zones), 'sample')} ({keys}{between}, {layers})"


def pitch_words(error_cents: float) -> str:
    """The largest pitch error of a note's start (`SampledPlan.pitch_error_cents`) in words."""
    return f"note starts within {error_cents:.1f} cents of the instrument"


def megabytes(size: int) -> str:
    return f"{size / 1e6:,.0f} MB" if size >= 1e7 else f"{size / 1e6:.1f} MB"


def notes(plan: SampledPlan, report: SampledReport, dry_option: str) -> list[str]:
    """Notes for a musician on what was written. `dry_option`: the name of the choice that takes the room out."""
    lines = []
    if plan.instrument.room.mix > 0 and not plan.instrument.damping.let_ring:
        lines.append(f"a released key ends the room's tail as well; {dry_option} leaves the room to the sampler")
    if report.cut:
        rang = f"{number_of(report.cut, 'sample')} still rang after {plan.seconds:g} s and "
        lines.append(rang + ("was faded out" if report.cut == 1 else "were faded out"))
    if abs(report.gain_db) >= SMALLEST_REPORTED_DB:
        why = "softer than the instrument, so that no note clips"
        if report.gain_db > 0:
            why = "louder than the instrument, at the full level of 16 bits"
        lines.append(f"all of it is {abs(report.gain_db):.1f} dB {why}")
    return lines

"""SFZ: the text that tells a player which sample sounds for which key and velocity, and how.

Opcodes of SFZ 1, understood by every player, but for `default_path`, `note_polyphony` and `note_selfmask` of SFZ 2.
Source: https://sfzformat.com
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping

from app.export.sampled.plan import SampledPlan, Zone
from app.export.sampled.store import StoredSample
from app.patches.patch import Patch
from app.shared.version import PROGRAM, program_version
from engine.plain_text import one_line

RELEASE_SPAN_DB = 78.2  # a released voice falls by so much in `ampeg_release`: exp(-9), measured in sfizz


def sfz_text(plan: SampledPlan, samples: Mapping[Zone, StoredSample], folder: str) -> str:
    """The whole file. `folder`: of the samples, beside it; of plain characters."""
    return "\n".join(_lines(plan, samples, folder)) + "\n"


def sfz_gain_db(samples: Mapping[Zone, StoredSample]) -> float:
    """What all of it is raised by: 0, or below where a note would clip. No volume is above 0 dB then."""
    return min(0.0, *(sample.gain_db for sample in samples.values()))


def release_s(patch: Patch) -> float:
    """`ampeg_release` that lets a note fall by 60 dB in the patch's damping time."""
    return patch.damping.release_t60_s * RELEASE_SPAN_DB / 60


def _lines(plan: SampledPlan, samples: Mapping[Zone, StoredSample], folder: str) -> Iterator[str]:
    patch, gain_db = plan.patch, sfz_gain_db(samples)
    yield f"// {one_line(patch.name)}, by {PROGRAM} {program_version()}"
    yield f"// {one_line(patch.description)}" if patch.description else "//"
    if plan.every > 1:
        yield f"// A sample for every {plan.every} keys; those between are transposed."
    if gain_db:
        yield f"// All of it is {-gain_db:.2f} dB softer than the patch, so that no note clips."
    yield "<control>"
    yield f"default_path={folder}/"
    yield ""  # sfzlint reads a value that ends with a slash on into the next line
    yield "<global>"
    # one_shot: letting go damps nothing; the damping is still what ends a string that is plucked again
    yield f"loop_mode={'one_shot' if patch.damping.let_ring else 'no_loop'}"
    yield f"ampeg_release={min(100.0, release_s(patch)):.4f}"
    # a string that is plucked again: `off_by` for players of SFZ 1, where one key may end itself;
    # `note_polyphony` for the others, `note_selfmask=off` so that a soft note ends a loud one as well
    yield "off_mode=normal"
    yield "note_polyphony=1"
    yield "note_selfmask=off"
    bend = round(100 * patch.bend_semitones)
    yield f"bend_up={bend}"
    yield f"bend_down={-bend}"
    yield from _velocity_curve(patch, samples)
    for keys, zones in itertools.groupby(samples, lambda zone: zone.keys):
        layers = list(zones)
        yield "<group>"
        yield f"lokey={keys[0]} hikey={keys[1]} pitch_keycenter={layers[0].key}"
        if keys[0] == keys[1]:
            yield f"group={keys[0] + 1} off_by={keys[0] + 1}"
        for zone in layers:
            low, high = zone.velocities
            volume_db = gain_db - samples[zone].gain_db
            yield (f"<region> sample={plan.file_name(zone)} lovel={low} hivel={high} volume={volume_db:.2f}")


def _velocity_curve(patch: Patch, zones: Iterable[Zone]) -> Iterator[str]:
    """Within a layer the level follows the patch: it is 1 at the velocity that was rendered."""
    for (low, high), velocity in sorted({(zone.velocities, zone.velocity) for zone in zones}):
        rendered_mm = patch.pluck.pluck(velocity).amplitude_mm
        for played in range(low, high + 1):
            gain = patch.pluck.pluck(played).amplitude_mm / rendered_mm
            yield f"amp_velcurve_{played}={gain:.5f}"

"""SFZ: the text that assigns samples to keys and velocities for a player.

Opcodes of SFZ 1, understood by every player, except `default_path`, `note_polyphony` and `note_selfmask` of SFZ 2.
Source: https://sfzformat.com
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from app.export.sampled.levels import Levels, by_key, headroom_db, velocity_levels
from app.export.sampled.plan import SampledPlan, Zone
from app.export.sampled.sample import StoredSample
from app.instruments.instrument import Instrument
from app.shared.version import PROGRAM, program_version
from engine.plain_text import one_line

RELEASE_SPAN_DB = 78.2  # a released voice falls by so much in `ampeg_release`: exp(-9), measured in sfizz


def sfz_text(plan: SampledPlan, samples: Mapping[Zone, StoredSample], folder: str) -> str:
    """The whole file. `folder`: of the samples, beside it; of plain characters."""
    return "\n".join(_lines(plan, samples, folder)) + "\n"


def sfz_gain_db(instrument: Instrument, samples: Mapping[Zone, StoredSample]) -> float:
    """The dB that the whole is raised by: 0, or less where a note would clip. No volume is above 0 dB."""
    headrooms_db = headroom_db(instrument, samples)
    return min(0.0, *(sample.gain_db - headrooms_db[zone] for zone, sample in samples.items()))


def release_s(instrument: Instrument) -> float:
    """The `ampeg_release` that lets a note fall by 60 dB in the instrument's damping time."""
    return instrument.damping.release_t60_s * RELEASE_SPAN_DB / 60


def _lines(plan: SampledPlan, samples: Mapping[Zone, StoredSample], folder: str) -> Iterator[str]:
    """The lines of the file, of the arguments of `sfz_text`: a group for each key, a region for each sample."""
    instrument, gain_db = plan.instrument, sfz_gain_db(plan.instrument, samples)
    headrooms_db = headroom_db(instrument, samples)
    yield f"// {one_line(instrument.name)}, by {PROGRAM} {program_version()}"
    yield f"// {one_line(instrument.description)}" if instrument.description else "//"
    if plan.every > 1:
        yield f"// A sample for every {plan.every} keys; those between are transposed."
    if gain_db:
        yield f"// All of it is {-gain_db:.2f} dB softer than the instrument, so that no note clips."
    yield "<control>"
    yield f"default_path={folder}/"
    yield ""  # some readers take a value that ends with a slash on into the next line
    yield "<global>"
    # one_shot: letting go damps nothing; the damping is still what ends a string that is plucked again
    yield f"loop_mode={'one_shot' if instrument.damping.let_ring else 'no_loop'}"
    yield f"ampeg_release={release_s(instrument):.4f}"  # below 100, the format's longest
    # a string that is plucked again ends the former note: by `off_by` in players of SFZ 1, where a key may end
    # itself, by `note_polyphony` in the others, with `note_selfmask=off` so that a soft note ends a loud one as well
    yield "off_mode=normal"
    yield "note_polyphony=1"
    yield "note_selfmask=off"
    bend = round(100 * instrument.bend_semitones)
    yield f"bend_up={bend}"
    yield f"bend_down={-bend}"
    for layers, stored in by_key(samples):
        low, high = layers[0].keys
        yield "<group>"
        yield f"lokey={low} hikey={high} pitch_keycenter={layers[0].key}"
        if low == high:
            yield f"group={low + 1} off_by={low + 1}"
        levels_db = velocity_levels(instrument, layers, stored)
        for zone, sample in zip(layers, stored, strict=True):
            softest, hardest = zone.velocities
            yield (
                f"<region> sample={plan.file_name(zone)} lovel={softest} hivel={hardest}"
                f" volume={gain_db - sample.gain_db + headrooms_db[zone]:.2f} {_velocity_curve(zone, levels_db)}"
            )


def _velocity_curve(zone: Zone, levels_db: Levels) -> str:
    """Gains by velocity within a layer, along the levels of all layers: 1 at its loudest velocity.

    Players draw straight lines between these points: with four, a layer of 10 dB is right to 0.1 dB.
    """
    low, high = zone.velocities
    points = sorted({low + (high - low) * part // 3 for part in range(4)})
    gains = np.minimum(1, 10 ** ((levels_db - levels_db[low : high + 1].max()) / 20))
    return " ".join(f"amp_velcurve_{velocity}={gains[velocity]:.5f}" for velocity in points)

"""The results learned from a recording, as plain data and as text."""

from __future__ import annotations

import math
from typing import Any

from training.recording.learn import Learned
from training.recording.report import figures


def as_data(learned: Learned) -> dict[str, Any]:
    """The data for JSON: file, gate, string with what is assumed, errors, partials, bands."""
    physics, report = learned.physics, learned.report
    return {
        "file": learned.source.name,
        "digest": learned.source.digest,
        "gate": [{"kind": each.kind, "reason": each.reason, "remedy": each.remedy} for each in learned.findings],
        "found": learned.verdict.found,
        "linear_esr": _finite(learned.verdict.linear_esr),
        "loud_partials_on_law": learned.verdict.near,
        "seconds": learned.seconds,
        "f0_hz": _finite(physics.f0_hz),
        "f0_error_hz": _finite(physics.f0_error_hz),
        "inharmonicity": _finite(physics.stiffness),
        "inharmonicity_error": _finite(physics.stiffness_error),
        "glide_cents": 1200 * math.log2(1 + physics.rise),
        "assumed": list(learned.strung.assumed),
        "errors": {name: _finite(value) for name, value in figures(report).items()},
        "partials": [
            {
                "number": each.number,
                "hz": each.hz,
                "cents_from_law": each.cents,
                "hz_interval": each.hz_interval,
                "level_db": each.level_db,
                "level_interval_db": each.level_interval_db,
                "t60_s": math.log(1000) / each.decay,
                "t60_interval_s": [math.log(1000) / each.decay_interval[1], math.log(1000) / each.decay_interval[0]],
                "poles": each.poles,
            }
            for each in report.partials
        ],
        "bands": [
            {"hz": each.hz, "recorded_t60_s": _finite(each.recorded_s), "learned_t60_s": _finite(each.learned_s)}
            for each in report.bands
        ],
    }


def as_text(learned: Learned) -> list[str]:
    """The text for people: a few lines, the most important first."""
    physics, errors = learned.physics, learned.report.errors
    lines = [
        f"{learned.source.name}: {physics.f0_hz:.2f} Hz, inharmonicity {physics.stiffness:.2e}, "
        f"{len(physics.partials)} partials, glide {1200 * math.log2(1 + physics.rise):.0f} cents",
        f"  error-to-signal ratio {errors.esr:.4f} (from 50 ms {errors.late_esr:.4f}), "
        f"noise {learned.report.noise_esr:.1e}",
        f"  {learned.verdict.words}",
        f"  log spectral distance {errors.distance_db:.1f} dB, STFT {errors.stft:.2f}",
    ]
    bands = [f"{band.hz:g} Hz {band.recorded_s:.2f}/{band.learned_s:.2f}" for band in learned.report.bands]
    lines.append(f"  decay by 60 dB in s, recorded/learned: {', '.join(bands) or 'no octave decays by 12 dB'}")
    lines += [f"  assumed: {words}" for words in learned.strung.assumed]
    lines += [
        f"  {'overruled' if each.refused else 'warning'}: {each.reason}: {each.remedy}" for each in learned.findings
    ]
    return lines


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None

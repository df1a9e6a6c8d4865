"""The results learned from a recording, as plain data and as text."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from training.recording.learn import Learned
from training.recording.report import figures


def as_data(learned: Learned) -> dict[str, Any]:
    """The data for JSON: file, gate, string with what is assumed, errors, partials, bands."""
    physics, report = learned.physics, learned.report
    return {
        "file": learned.source.name,
        "digest": learned.source.digest,
        "gate": [{"kind": row.kind, "reason": row.reason, "remedy": row.remedy} for row in learned.findings],
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
        "partials": [asdict(row) for row in report.partials],
        "bands": [{name: _finite(value) for name, value in asdict(row).items()} for row in report.bands],
    }


def as_text(learned: Learned) -> list[str]:
    """The text for people: a few lines, the most important first."""
    physics, errors = learned.physics, learned.report.errors
    lines = [
        f"{learned.source.name}: {physics.f0_hz:.2f} Hz, inharmonicity {physics.stiffness:.2e}, "
        f"{len(physics.partials)} partials, glide {1200 * math.log2(1 + physics.rise):.0f} cents",
        f"  error-to-signal ratio {errors.esr:.4f} (from 50 ms {errors.esr_from_50_ms:.4f}), "
        f"noise {errors.noise_esr:.1e}",
        f"  {learned.verdict.words}",
        f"  log spectral distance {errors.log_spectral_distance_db:.1f} dB, STFT {errors.stft:.2f}",
    ]
    bands = [f"{band.hz:g} Hz {band.recorded_t60_s:.2f}/{band.learned_t60_s:.2f}" for band in learned.report.bands]
    lines.append(f"  decay by 60 dB in s, recorded/learned: {', '.join(bands) or 'no octave decays by 12 dB'}")
    lines += [f"  assumed: {words}" for words in learned.strung.assumed]
    lines += [
        f"  {'overruled' if finding.refused else 'warning'}: {finding.reason}: {finding.remedy}"
        for finding in learned.findings
    ]
    return lines


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None

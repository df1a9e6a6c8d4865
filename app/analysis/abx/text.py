"""A record as text: for the screen, a file and the command line."""

from __future__ import annotations

from app.analysis.abx.record import AbxRecord, HeardPluck, HeardSource
from app.analysis.abx.trials import LEVEL
from app.patches.patch import PhysicalString
from app.presets.words import shape_word

MEANING = (
    "The p-value is the probability that guessing alone would give at least this many right answers. "
    f"Below {LEVEL:g}, luck is an unlikely explanation; a larger value does not show that A and B sound the same, "
    "only that this test did not tell them apart."
)


def p_text(p_value: float) -> str:
    """A p-value for people: three decimals, the smallest as a bound."""
    return "p < 0.001" if p_value < 0.001 else f"p = {p_value:.3f}"


def score_text(record: AbxRecord) -> str:
    """The result in one line."""
    if record.p_value is None:
        return f"incomplete: {record.correct} right of {len(record.trials)} answered, {record.planned_trials} planned"
    return f"{record.correct} of {record.planned_trials} right, {p_text(record.p_value)}"


def verdict(record: AbxRecord) -> str:
    """What follows from the result, in a sentence."""
    if record.p_value is None:
        return "The test was not completed, so no p-value can be given."
    if record.p_value < LEVEL:
        return "You can tell them apart: luck is an unlikely explanation."
    return "This test did not show that you can tell them apart."


def as_text(record: AbxRecord) -> str:
    """The whole record, with a line break at the end of every line."""
    pluck, through = record.pluck, record.through
    width = "" if pluck.shape == "triangular" else f", width {pluck.width:g}"
    head = {
        "Date": f"{record.date:%Y-%m-%d %H:%M:%S %z}",
        "Result": score_text(record),
        "Remark": record.remark,
        "A": _source(record.a),
        "B": _source(record.b),
        **_presets(record),
        "String": "" if pluck.string is None else _string(pluck.string),
        "Pluck": f"position {pluck.position:g}, {pluck.amplitude_mm:g} mm, {shape_word(pluck.shape)}{width}",
        "Heard": _heard(pluck),
        "Device": f"{through.device} ({through.host_api}), {through.rate_hz} Hz, volume {through.volume_db:+g} dB",
        "Switch": "from the beginning" if through.restart_at_switch else "at the playhead",
        "Seed": str(record.seed),
        "Program": f"Learned Strings {record.program}",
    }
    lines = ["ABX listening test", ""]
    lines += [f"{name:<9} {value}" for name, value in head.items() if value]
    lines += ["", "trial  X  answer  right  seconds  auditions"]
    for number, trial in enumerate(record.trials, 1):
        right = "yes" if trial.correct else "no"
        lines.append(f"{number:5}  {trial.x}  {trial.answer:6}  {right:5}  {trial.seconds:7.1f}  {trial.auditions:9}")
    lines += ["", verdict(record)]
    if record.complete:
        lines += [MEANING]
    return "\n".join(lines) + "\n"


def _heard(pluck: HeardPluck) -> str:
    right = "" if pluck.listen_right is None else f" (left) and {pluck.listen_right:g} (right)"
    parts = [f"at {pluck.listen:g}{right} of the length"]
    parts += ["as velocity"] if pluck.pickup == "velocity" else []
    parts += [f"mode {pluck.solo} alone"] if pluck.solo else []
    return ", ".join([*parts, f"{pluck.seconds:g} s"])


def _source(source: HeardSource) -> str:
    return f"{source.label}, turned down by {abs(source.gain_db):.2f} dB"


def _string(string: PhysicalString) -> str:
    values = ", ".join(f"{name} {value:g}" for name, value in string.model_dump().items())
    return f"{string.first_hz:.1f} Hz: {values}"


def _presets(record: AbxRecord) -> dict[str, str]:
    """The presets of A and B, once where they are the same, with their digests: a name may come to mean another."""
    a, b = ((source.preset, source.preset_sha256) for source in (record.a, record.b))
    if a == b:
        return {"Preset": a[0], "SHA-256": a[1]}
    return {"Preset A": a[0], "SHA-256 A": a[1], "Preset B": b[0], "SHA-256 B": b[1]}

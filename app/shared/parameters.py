"""The table of the session's parameters, macros, and what may change the parameters of an instrument."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from app.shared.vocabulary import DIFFERENCE_GAIN_RANGE_DB
from engine.bounds import LARGEST_AMPLITUDE_MM, POSITION_RANGE, WIDTH_RANGE
from engine.parameters import OF_INSTRUMENTS, PERCENT, PLACE, WIDTH, Modulation, Parameter, Taper, by_id
from engine.pluck import DEFAULT_LISTEN, Pluck

_OF_CHOICES = (
    Parameter(
        "position",
        "position",
        POSITION_RANGE,
        Pluck().position,
        PLACE,
        modulation="learn",
        name="pluck position",
        tip="Pluck position; 0 and 1 are the ends of the string",
    ),
    Parameter(
        "amplitude_mm",
        "amplitude",
        (0, LARGEST_AMPLITUDE_MM),
        Pluck().amplitude_mm,
        Taper(0.25, "{:.2f} mm"),
        modulation="learn",
        tip="Peak displacement of the pluck",
    ),
    Parameter(
        "width",
        "width",
        WIDTH_RANGE,
        Pluck().width,
        WIDTH,
        modulation="learn",
        name="pluck width",
        tip="Width of the pluck as a share of the string's length",
    ),
    Parameter(
        "listen",
        "listen",
        (0, 1),
        DEFAULT_LISTEN,
        PLACE,
        modulation="learn",
        name="listening point",
        tip="Listening point on the string",
    ),
    Parameter(
        "listen_right",
        "right",
        (0, 1),
        1 - DEFAULT_LISTEN,
        PLACE,
        modulation="learn",
        name="right listening point",
        tip="Listening point of the right channel in stereo; the left is at “listen”",
    ),
    Parameter(
        "seconds",
        "duration",
        (0.5, 12),
        4.0,
        Taper(0.5, "{:.1f} s"),
        modulation="learn",
        tip="Length of a rendered pluck",
    ),
    Parameter(
        "speed",
        "slow-mo",
        (0.001, 1),
        0.004,
        Taper(1.25, "× {:.3f}", True),
        modulation="learn",
        name="slow motion",
        tip="Slow motion of the string view, as under a stroboscope; the sound is not slowed",
    ),
    Parameter(
        "volume_db",
        "volume",
        (-60, 12),
        6.0,
        Taper(1, "{:+.0f} dB"),
        modulation="learn",
        tip="Playback volume; exported files are not affected",
    ),
    Parameter(
        "difference_gain_db",
        "difference",
        DIFFERENCE_GAIN_RANGE_DB,
        20.0,
        Taper(10, "{:+.0f} dB"),
        tip="Gain of the difference between model and truth",
    ),
)
OF_CHOICES = by_id(_OF_CHOICES)
MOST_MACROS = 8  # of an instrument
MACROS: Mapping[str, Parameter] = {
    id: Parameter(id, label, (0, 1), 0.5, PERCENT, modulation="learn")
    for id, label in ((f"macros.{number}", f"macro {number + 1}") for number in range(MOST_MACROS))
}
LEARNABLE: Mapping[str, Parameter] = {  # what a MIDI controller can be assigned to
    id: parameter for id, parameter in {**OF_CHOICES, **MACROS, **OF_INSTRUMENTS}.items() if parameter.allows("learn")
}


def modulated_by(modulation: Modulation) -> Iterator[Parameter]:
    """The parameters of instruments that this kind of modulation may change, in the table's order."""
    return (parameter for parameter in OF_INSTRUMENTS.values() if parameter.allows(modulation))


def in_group(group: str) -> tuple[Parameter, ...]:
    """The parameters of instruments whose knobs stand together."""
    return tuple(parameter for parameter in OF_INSTRUMENTS.values() if parameter.group == group)

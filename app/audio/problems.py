"""Faults of the sound output, in words for the user."""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from enum import StrEnum


class ProblemKind(StrEnum):
    PORTAUDIO_MISSING = "portaudio_missing"
    NO_DEVICE = "no_device"
    BUSY = "busy"
    RATE_REFUSED = "rate_refused"
    STALLED = "stalled"
    VANISHED = "vanished"
    OTHER = "other"
    INTERNAL = "internal"


@dataclass(eq=False)
class AudioProblem(Exception):
    """A fault: what happened, the remedy, and the system's own words (`detail`, "" where there are none).

    It is raised where no sound output can be used at present; pictures and export continue.
    """

    kind: ProblemKind
    message: str
    remedy: str
    detail: str = ""

    def __str__(self) -> str:
        return f"{self.message} {self.remedy}"


def portaudio_missing(detail: str) -> AudioProblem:
    return AudioProblem(
        ProblemKind.PORTAUDIO_MISSING,
        "No sound: the PortAudio library was not found.",
        "Install it (Debian and Ubuntu: apt-get install libportaudio2) and start the app again.",
        detail,
    )


def not_started(detail: str) -> AudioProblem:
    return AudioProblem(
        ProblemKind.OTHER,
        "The computer's sound system could not be started.",
        "Check the system's sound settings and start the app again.",
        detail,
    )


def no_device(detail: str = "") -> AudioProblem:
    return AudioProblem(
        ProblemKind.NO_DEVICE,
        "No audio output was found.",
        "Connect loudspeakers or headphones and choose them in the audio settings.",
        detail,
    )


def stalled(device_name: str) -> AudioProblem:
    return AudioProblem(
        ProblemKind.STALLED,
        f"The sound output “{device_name}” stopped. The computer may be too busy.",
        "The app keeps trying. If it does not recover, choose a larger buffer or another output in Audio.",
    )


def internal(detail: str) -> AudioProblem:
    return AudioProblem(
        ProblemKind.INTERNAL,
        "An internal error occurred while the sound was supervised. Playback continues.",
        "Please report the details.",
        detail,
    )


def unexpected(error: Exception, device_name: str) -> AudioProblem:
    """Return the problem of a device that was looked for or opened, where that is no known fault."""
    return AudioProblem(
        ProblemKind.OTHER,
        f"The sound output “{device_name}” could not be opened because of an internal error.",
        "The app keeps trying. Choose another output in the audio settings, and please report the details.",
        "".join(traceback.format_exception(error)),
    )


def vanished(device_name: str, detail: str = "") -> AudioProblem:
    return AudioProblem(
        ProblemKind.VANISHED,
        f"The sound output “{device_name}” was not found: it is disconnected, or the computer is too busy.",
        "The app keeps trying. Connect it again, or choose another one in the audio settings.",
        detail,
    )


def refused(error: Exception, device_name: str, rate_hz: int) -> AudioProblem:
    """Return why a device did not open or start, from PortAudio's error code and text."""
    output = f"The sound output “{device_name}”"
    detail = str(error)
    text = str(error).lower()
    code = next((value for value in error.args[1:2] if isinstance(value, int)), 0)
    # PortAudio reports many errors of drivers as "unanticipated host error", hence the search in the text.
    if code == _PA_INVALID_SAMPLE_RATE or "sample rate" in text:
        remedy = "Set another sample rate for it in the system's sound settings, or choose another output."
        return AudioProblem(ProblemKind.RATE_REFUSED, f"{output} refuses {rate_hz} Hz.", remedy, detail)
    if code == _PA_INVALID_DEVICE or any(word in text for word in _VANISHED_WORDS):
        return vanished(device_name, detail)
    if code == _PA_DEVICE_UNAVAILABLE or any(word in text for word in _BUSY_WORDS):
        remedy = "Close that program and try again, or choose another output."
        return AudioProblem(ProblemKind.BUSY, f"{output} is in use by another program.", remedy, detail)
    remedy = "Try again, or choose another output in the audio settings."
    return AudioProblem(ProblemKind.OTHER, f"{output} could not be opened.", remedy, detail)


_PA_INVALID_SAMPLE_RATE = -9997
_PA_INVALID_DEVICE = -9996
_PA_DEVICE_UNAVAILABLE = -9985
_BUSY_WORDS = ("busy", "in use", "in_use", "exclusive")
_VANISHED_WORDS = ("no such device", "invalidated", "disconnected", "not found")

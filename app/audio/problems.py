"""Faults of the sound output, in words for the user."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class ProblemKind(StrEnum):
    PORTAUDIO_MISSING = "portaudio_missing"
    NOT_STARTED = "not_started"
    NO_DEVICE = "no_device"
    BUSY = "busy"
    RATE_REFUSED = "rate_refused"
    STALLED = "stalled"
    VANISHED = "vanished"
    NOT_OPENED = "not_opened"
    UNEXPECTED = "unexpected"  # of a device that was looked for or opened: no known fault
    INTERNAL = "internal"


_OUTPUT, _ANOTHER = "The sound output “{device}”", "choose another output in the audio settings."
_WORDS: dict[ProblemKind, tuple[str, str]] = {  # what happened, and the remedy
    ProblemKind.PORTAUDIO_MISSING: (
        "No sound: the PortAudio library was not found.",
        "Install it (Debian and Ubuntu: apt-get install libportaudio2) and start the app again.",
    ),
    ProblemKind.NOT_STARTED: (
        "The computer's sound system could not be started.",
        "Check the system's sound settings and start the app again.",
    ),
    ProblemKind.NO_DEVICE: (
        "No audio output was found.",
        "Connect loudspeakers or headphones and choose them in the audio settings.",
    ),
    ProblemKind.BUSY: (
        f"{_OUTPUT} is in use by another program.",
        "Close that program and try again, or choose another output.",
    ),
    ProblemKind.RATE_REFUSED: (
        f"{_OUTPUT} refuses {{rate_hz}} Hz.",
        "Set another sample rate for it in the system's sound settings, or choose another output.",
    ),
    ProblemKind.STALLED: (
        f"{_OUTPUT} stopped. The computer may be too busy.",
        "The app keeps trying. If it does not recover, choose a larger buffer or another output in Audio.",
    ),
    ProblemKind.VANISHED: (
        f"{_OUTPUT} was not found: it is disconnected, or the computer is too busy.",
        "The app keeps trying. Connect it again, or choose another one in the audio settings.",
    ),
    ProblemKind.NOT_OPENED: (f"{_OUTPUT} could not be opened.", f"Try again, or {_ANOTHER}"),
    ProblemKind.UNEXPECTED: (
        f"{_OUTPUT} could not be opened because of an internal error.",
        "The app keeps trying. Choose another output in the audio settings, and please report the details.",
    ),
    ProblemKind.INTERNAL: (
        "An internal error occurred while the sound was supervised. Playback continues.",
        "Please report the details.",
    ),
}


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


def problem(kind: ProblemKind, device: str = "", detail: str = "", rate_hz: int = 0) -> AudioProblem:
    """The problem of a kind; `device`: the name of the output, and the rate that it was to have."""
    message, remedy = _WORDS[kind]
    return AudioProblem(kind, message.format(device=device, rate_hz=rate_hz), remedy, detail)


def refused(error: Exception, device: str, rate_hz: int) -> AudioProblem:
    """Return why a device did not open or start, from PortAudio's error code and text."""
    text = str(error).lower()
    code = next((value for value in error.args[1:2] if isinstance(value, int)), 0)
    kind = ProblemKind.NOT_OPENED
    # PortAudio reports many errors of drivers as "unanticipated host error", hence the search in the text.
    if code == _PA_INVALID_SAMPLE_RATE or "sample rate" in text:
        kind = ProblemKind.RATE_REFUSED
    elif code == _PA_INVALID_DEVICE or any(word in text for word in _VANISHED_WORDS):
        kind = ProblemKind.VANISHED
    elif code == _PA_DEVICE_UNAVAILABLE or any(word in text for word in _BUSY_WORDS):
        kind = ProblemKind.BUSY
    return problem(kind, device, str(error), rate_hz)


_PA_INVALID_SAMPLE_RATE = -9997
_PA_INVALID_DEVICE = -9996
_PA_DEVICE_UNAVAILABLE = -9985
_BUSY_WORDS = ("busy", "in use", "in_use", "exclusive")
_VANISHED_WORDS = ("no such device", "invalidated", "disconnected", "not found")

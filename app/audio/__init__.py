"""The sound output: devices, what can go wrong with them, and the thread that looks after the one that plays."""

from app.audio.devices import AudioDevice, default_device, find, output_devices
from app.audio.problems import AudioProblem, AudioUnavailable, ProblemKind
from app.audio.sound import BUFFER_S, DEFAULT_RATE_HZ, Sound, SoundStatus

__all__ = [
    "BUFFER_S",
    "DEFAULT_RATE_HZ",
    "AudioDevice",
    "AudioProblem",
    "AudioUnavailable",
    "ProblemKind",
    "Sound",
    "SoundStatus",
    "default_device",
    "find",
    "output_devices",
]

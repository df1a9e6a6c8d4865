"""Playback: tracks that grow, a mixer that never clicks, and a player that also runs without a device."""

from app.audio.devices import AudioDevice, default_device, find, output_devices
from app.audio.levels import Levels
from app.audio.mixer import Mixer, MixerStatus
from app.audio.player import Player
from app.audio.player_status import DEFAULT_RATE_HZ, PlayerStatus
from app.audio.problems import AudioProblem, AudioUnavailable, ProblemKind
from app.audio.track import Track

__all__ = [
    "DEFAULT_RATE_HZ",
    "AudioDevice",
    "AudioProblem",
    "AudioUnavailable",
    "Levels",
    "Mixer",
    "MixerStatus",
    "Player",
    "PlayerStatus",
    "ProblemKind",
    "Track",
    "default_device",
    "find",
    "output_devices",
]

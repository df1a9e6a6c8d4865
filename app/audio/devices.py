"""The sound outputs of this computer, and opening one.

`sounddevice` is imported at first use only: pictures and export must work where PortAudio is absent.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from app.audio.problems import no_device, not_started, portaudio_missing, refused, vanished

SHORT_BUFFER_S = 0.02


@dataclass(frozen=True)
class AudioDevice:
    """A sound output, known by name and host API; PortAudio's index changes when something is plugged in."""

    name: str
    host_api: str
    default_rate_hz: int = 0  # 0 in a remembered choice that has not been looked up yet
    channels: int = 2
    is_default: bool = False


Callback = Callable[[NDArray[np.float32], int, Any, Any], None]


class RawStream(Protocol):
    """The part of `sounddevice.OutputStream` that is used here."""

    @property
    def active(self) -> bool: ...
    @property
    def latency(self) -> float: ...
    def start(self) -> None: ...
    def abort(self) -> None: ...
    def close(self) -> None: ...


def output_devices(rescan: bool = False) -> list[AudioDevice]:
    """All sound outputs, the system's default first.

    Args:
        rescan: PortAudio looks for devices only once, when it starts. True starts it anew, which ends every
            open stream: only while none is open.

    Raises:
        AudioUnavailable: If PortAudio is missing. No output at all is an empty list.
    """
    return sorted((device for _, device in _list(rescan)), key=lambda device: not device.is_default)


def default_device(rescan: bool = False) -> AudioDevice:
    """The system's default output, or the first if it names none; AudioUnavailable if there is no output."""
    devices = output_devices(rescan)
    if not devices:
        raise no_device()
    return devices[0]


def find(name: str, host_api: str, rescan: bool = False) -> AudioDevice:
    """The output of this name; AudioUnavailable says that it has vanished."""
    return _find(name, host_api, rescan)[1]


def open_device(device: AudioDevice, buffer_s: float, block_frames: int, callback: Callback) -> RawStream:
    """Opens, but does not start, a float32 stream at the device's own rate, so that no rate is forced on it.

    The device's buffer is PortAudio's safe choice ("high latency"), or `buffer_s` where that is longer: a
    callback in Python has to wait for the interpreter lock now and then. A buffer below `SHORT_BUFFER_S` is a wish
    for promptness: then it is what the device itself calls low latency.

    Raises:
        AudioUnavailable: With the reason in plain words.
    """
    sounddevice = _sounddevice()
    index, _ = _find(device.name, device.host_api)
    safe = "default_high_output_latency" if buffer_s >= SHORT_BUFFER_S else "default_low_output_latency"
    try:
        stream: RawStream = sounddevice.OutputStream(
            samplerate=device.default_rate_hz,
            blocksize=block_frames,
            device=index,
            channels=min(device.channels, 2),
            dtype="float32",
            latency=max(buffer_s, sounddevice.query_devices(index)[safe]),
            callback=callback,
        )
    except (sounddevice.PortAudioError, OSError, ValueError) as error:
        raise refused(error, device.name, device.default_rate_hz) from error
    return stream


_lock = threading.Lock()  # PortAudio's listing is not made for two threads


def _find(name: str, host_api: str, rescan: bool = False) -> tuple[int, AudioDevice]:
    for index, device in _list(rescan):
        if (device.name, device.host_api) == (name, host_api):
            return index, device
    raise vanished(name, f"{host_api} lists no output of this name.")


def _list(rescan: bool = False) -> list[tuple[int, AudioDevice]]:
    sounddevice = _sounddevice()
    with _lock:
        try:
            if rescan:
                sounddevice._terminate()
                sounddevice._initialize()
            apis: list[Mapping[str, Any]] = list(sounddevice.query_hostapis())
            entries: list[Mapping[str, Any]] = list(sounddevice.query_devices())
            default = sounddevice.default.device["output"]  # -1 if there is none
        except sounddevice.PortAudioError as error:
            raise no_device(str(error)) from error
    return [
        (
            index,
            AudioDevice(
                name=entry["name"],
                host_api=apis[entry["hostapi"]]["name"],
                default_rate_hz=round(entry["default_samplerate"]),
                channels=entry["max_output_channels"],
                is_default=index == default,
            ),
        )
        for index, entry in enumerate(entries)
        if entry["max_output_channels"] > 0
    ]


def _sounddevice() -> ModuleType:
    try:
        import sounddevice
    except (ImportError, OSError) as error:
        raise portaudio_missing(str(error)) from error
    except Exception as error:  # the module starts PortAudio as it is imported, and has its own exception for it
        raise not_started(str(error)) from error
    module: ModuleType = sounddevice
    return module

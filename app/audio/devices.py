"""The sound outputs of this computer, and opening one.

`sounddevice` is imported at first use only: pictures and export must work where PortAudio is absent.
"""

from __future__ import annotations

import contextlib
import ctypes
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from types import ModuleType
from typing import Any

from app.audio.choices import DeviceChoice
from app.audio.problems import ProblemKind, problem, refused
from engine.voices.mixer import Mixer

SMALLEST_BLOCK = 64  # frames that a device asks for at a time, at least
PERIODS = 4  # in a buffer: the device asks for a quarter of it at a time, so that a pluck waits for less


@dataclass(frozen=True)
class AudioDevice:
    """A sound output, known by name and host API; PortAudio's index changes when something is plugged in."""

    name: str
    host_api: str
    default_rate_hz: int
    channels: int = 2
    is_default: bool = False
    index: int = field(default=-1, compare=False)  # PortAudio's, of now

    @property
    def choice(self) -> DeviceChoice:
        return DeviceChoice(name=self.name, host_api=self.host_api)


def output_devices(rescan: bool = False) -> list[AudioDevice]:
    """All sound outputs, the system's default first.

    Args:
        rescan: starts PortAudio again, as it looks for devices only when it starts. Has no effect while a stream is
            open, which a new start would end.

    Raises:
        AudioProblem: PortAudio is missing or does not start. Where it finds no output, the list is empty.
    """
    sounddevice = _sounddevice()
    with _lock:
        try:
            if rescan and not _streams:
                sounddevice._terminate()
                sounddevice._initialize()
            apis: list[Mapping[str, Any]] = list(sounddevice.query_hostapis())
            entries: list[Mapping[str, Any]] = list(sounddevice.query_devices())
            default = sounddevice.default.device["output"]  # -1 if there is none
        except sounddevice.PortAudioError as error:
            raise problem(ProblemKind.NO_DEVICE, detail=str(error)) from error
    listed = [
        AudioDevice(
            name=entry["name"],
            host_api=apis[entry["hostapi"]]["name"],
            default_rate_hz=round(entry["default_samplerate"]),
            channels=entry["max_output_channels"],
            is_default=index == default,
            index=index,
        )
        for index, entry in enumerate(entries)
        if entry["max_output_channels"] > 0
    ]
    return sorted(listed, key=lambda device: not device.is_default)


def find(device: DeviceChoice | None, rescan: bool = False) -> AudioDevice:
    """The output as PortAudio lists it now, by name and host API; for None the system's default, else the first.

    Raises:
        AudioProblem: it is not connected (any more), there is none, or PortAudio is missing.
    """
    for listed in output_devices(rescan):
        if device in (None, listed.choice):
            return listed
    if device is None:
        raise problem(ProblemKind.NO_DEVICE)
    raise problem(ProblemKind.VANISHED, device.name, f"{device.host_api} lists no output of this name.")


def open_device(device: AudioDevice, buffer_s: float, mixer: Mixer) -> Any:
    """Open, but do not start, one of `sounddevice`'s streams, at `device.default_rate_hz`, of two channels at most.

    The device calls the compiled mixer in its own thread, without the Python interpreter. Its buffer is `buffer_s`,
    or the latency that the device calls low where that is longer.

    Raises:
        AudioProblem: it is gone, in use, or refuses the rate.
    """
    from engine.kernels.mixer import call  # imported late, because it may have to be compiled first

    sounddevice = _sounddevice()
    with _lock:
        index = find(device.choice).index
        ffi, channels = sounddevice._ffi, min(device.channels, 2)
        low_s = sounddevice.query_devices(index)["default_low_output_latency"]
        frames = max(SMALLEST_BLOCK, round(buffer_s * device.default_rate_hz / PERIODS))
        try:
            # The private base class is the only one that takes a compiled callback; rtmixer uses it as well.
            stream = sounddevice._StreamBase(
                kind="output",
                samplerate=device.default_rate_hz,
                blocksize=frames,
                device=index,
                channels=channels,
                dtype="float32",
                latency=max(buffer_s, low_s),
                callback=ffi.cast("PaStreamCallback*", call.address),
                userdata=ffi.cast("void*", mixer.address),
            )
        except (sounddevice.PortAudioError, OSError, ValueError) as error:
            raise refused(error, device.name, device.default_rate_hz) from error
        _streams.add(stream)
    return stream


def close_device(stream: Any) -> None:
    """Stop at once and free the device; errors of a device that cannot be stopped are ignored."""
    with _lock:
        for end in (stream.abort, stream.close):
            with contextlib.suppress(Exception):
                end()
        _streams.discard(stream)


_lock = threading.RLock()  # PortAudio does not allow listing and opening from two threads
_streams: set[Any] = set()  # open ones: while there are any, PortAudio must not be started again


def _sounddevice() -> ModuleType:
    """The module `sounddevice`, imported at the first call. Raises AudioProblem: PortAudio is missing or fails."""
    try:
        import sounddevice
    except (ImportError, OSError) as error:
        raise problem(ProblemKind.PORTAUDIO_MISSING, detail=str(error)) from error
    except Exception as error:  # importing the module starts PortAudio, which fails with an exception of its own
        raise problem(ProblemKind.NOT_STARTED, detail=str(error)) from error
    _silence_alsa()
    module: ModuleType = sounddevice
    return module


@cache
def _silence_alsa() -> None:
    """Let ALSA print nothing: the window counts gaps, and errors are raised.

    ALSA calls the handler in the audio thread too, where Python must not run. So it is one of C's functions that
    has no effect.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL("libasound.so.2").snd_lib_error_set_handler(ctypes.CDLL(None).abs)

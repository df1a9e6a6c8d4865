"""Outputs are known by name, and one table has what goes wrong with them, in plain words."""

from __future__ import annotations

import builtins
import math
import subprocess
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from app.audio.choices import DeviceChoice
from app.audio.devices import AudioDevice, close_device, find, open_device, output_devices
from app.audio.output import DeviceOutput
from app.audio.problems import AudioProblem, ProblemKind
from engine.kernels.mixer import call
from engine.kernels.mixer_records import CAUSE_DEVICE
from engine.kernels.voice import note_gap
from engine.voices import Mixer


class PortAudioError(Exception):
    pass


class FakeStream:
    """What `sounddevice` opens; the device itself calls the mixer."""

    latency, time, cpu_load, active = 0.02, 3.0, 0.1, False

    def __init__(self, start_error: Exception | None) -> None:
        self.asked: list[str] = []
        self.start_error = start_error

    def start(self) -> None:
        if self.start_error is not None:
            raise self.start_error
        self.asked.append("start")
        self.active = True

    def abort(self) -> None:
        self.asked.append("abort")
        raise PortAudioError("it cannot even stop")

    def close(self) -> None:
        self.asked.append("close")


class FakeSoundDevice(SimpleNamespace):
    """The part of the `sounddevice` module that is used."""

    PortAudioError = PortAudioError

    def __init__(self, entries: list[tuple[str, int, int]], default: int) -> None:
        super().__init__(default=SimpleNamespace(device={"output": default}), opened=[], restarts=0)
        self.streams: list[FakeStream] = []
        self._ffi = SimpleNamespace(cast=lambda kind, address: (kind, address))
        self.entries = entries
        self.open_error: Exception | None = None
        self.start_error: Exception | None = None

    def query_hostapis(self) -> tuple[dict[str, Any], ...]:
        return ({"name": "ALSA"}, {"name": "JACK"})

    def query_devices(self, index: int | None = None) -> Any:
        times = {"default_high_output_latency": 0.035, "default_low_output_latency": 0.01}
        names = ("name", "hostapi", "max_output_channels")
        rows = [
            {**dict(zip(names, each, strict=True)), "default_samplerate": 48_000.0} | times for each in self.entries
        ]
        return rows if index is None else rows[index]

    def _StreamBase(self, **options: Any) -> FakeStream:
        self.opened.append(options)
        if self.open_error is not None:
            raise self.open_error
        self.streams.append(FakeStream(self.start_error))
        return self.streams[-1]

    def _terminate(self) -> None:
        self.restarts += 1

    def _initialize(self) -> None:
        self.entries.append(("Headset", 0, 2))


@pytest.fixture
def portaudio(monkeypatch: pytest.MonkeyPatch) -> FakeSoundDevice:
    fake = FakeSoundDevice([("Microphone", 0, 0), ("HDMI", 0, 8), ("Speakers", 0, 2), ("Speakers", 1, 1)], 2)
    monkeypatch.setitem(sys.modules, "sounddevice", fake)
    return fake


@pytest.fixture
def mixer() -> Mixer:
    return Mixer(48_000)


def test_outputs_are_listed_with_the_default_first(portaudio: FakeSoundDevice) -> None:
    assert output_devices() == [
        AudioDevice("Speakers", "ALSA", 48_000, 2, is_default=True),
        AudioDevice("HDMI", "ALSA", 48_000, 8),
        AudioDevice("Speakers", "JACK", 48_000, 1),
    ]
    assert find(None).name == "Speakers"
    portaudio.default.device["output"] = -1
    assert find(None).name == "HDMI"
    portaudio.entries[:] = [("Microphone", 0, 0)]
    assert output_devices() == []
    with pytest.raises(AudioProblem, match="No audio output") as caught:
        find(None)
    assert caught.value.kind is ProblemKind.NO_DEVICE


@pytest.mark.parametrize(("buffer_s", "latency_s", "block"), [(0.05, 0.05, 600), (0.005, 0.01, 64), (0.0, 0.01, 64)])
def test_a_device_is_found_by_its_name_and_calls_the_compiled_mixer_itself(
    portaudio: FakeSoundDevice, mixer: Mixer, buffer_s: float, latency_s: float, block: int
) -> None:
    """In blocks of a quarter of its buffer, of two of its channels."""
    wanted = find(DeviceChoice(name="HDMI", host_api="ALSA"))
    portaudio.entries.insert(0, ("Webcam", 0, 2))  # its index moves
    close_device(open_device(wanted, buffer_s, mixer))
    assert portaudio.opened == [
        {
            **{"kind": "output", "samplerate": 48_000, "blocksize": block, "device": 2, "channels": 2},
            **{"dtype": "float32", "latency": latency_s, "callback": ("PaStreamCallback*", call.address)},
            "userdata": ("void*", mixer.address),
        }
    ]


def test_nothing_is_looked_for_again_while_a_stream_is_open(portaudio: FakeSoundDevice, mixer: Mixer) -> None:
    stream = open_device(find(DeviceChoice(name="Speakers", host_api="ALSA")), 0.05, mixer)
    output_devices(rescan=True)
    assert portaudio.restarts == 0
    close_device(stream)
    assert portaudio.streams[0].asked == ["abort", "close"]  # though it could not stop
    assert find(DeviceChoice(name="Headset", host_api="ALSA"), rescan=True).channels == 2, "it was plugged in"
    assert portaudio.restarts == 1


@pytest.mark.parametrize("value", [0.0, float("nan"), float("inf"), float("-inf"), -1795774879.331, 1e12])
def test_times_of_a_device_that_cannot_be_are_not_shown(
    portaudio: FakeSoundDevice, mixer: Mixer, monkeypatch: pytest.MonkeyPatch, value: float
) -> None:
    for name in ("latency", "time", "cpu_load"):
        monkeypatch.setattr(FakeStream, name, value)
    output = DeviceOutput(find(DeviceChoice(name="Speakers", host_api="ALSA")), 0.05, mixer)
    assert output.latency_s == 0.05, "as it was asked for"
    assert math.isfinite(output.now_s()) and 0 <= output.load() < math.inf
    mixer.record["dac_s"] = value
    assert 0 <= mixer.output_latency_s < 1
    note_gap(mixer.record, 100, 1000 * value, CAUSE_DEVICE)
    assert [gap.milliseconds for gap in mixer.new_gaps()] == [0.0]
    output.close()


def test_an_output_plays_stalls_and_is_lost(
    portaudio: FakeSoundDevice, mixer: Mixer, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(now_s=100.0)
    monkeypatch.setattr("app.audio.output.time.monotonic", lambda: clock.now_s)
    output = DeviceOutput(find(DeviceChoice(name="Speakers", host_api="ALSA")), 0.05, mixer)
    (stream,) = portaudio.streams
    assert (output.latency_s, output.now_s(), output.load()) == (0.02, 3.0, 0.1)
    found = []
    for later_s, calls, active in (
        (0, 0, True),
        (3, 0, True),
        (0, 1, True),
        (7, 0, True),
        (0, 1, True),
        (0, 0, False),
    ):
        clock.now_s += later_s
        mixer.record["calls"] += calls
        stream.active = active
        found.append((output.stalled(), output.lost()))
    assert [stalled for stalled, _ in found[:3]] == [False, True, False]
    assert [lost for _, lost in found] == [False, False, False, True, False, True]
    output.close()
    assert stream.asked == ["start", "abort", "close"]
    with pytest.raises(RuntimeError, match="closed"):
        output.now_s()  # its memory is PortAudio's again


# Faults


def opening(error: Exception) -> Callable[[FakeSoundDevice], None]:
    return lambda portaudio: setattr(portaudio, "open_error", error)


@pytest.mark.parametrize(
    ("fault", "kind", "message"),
    [
        (opening(PortAudioError("Error opening", -9997)), ProblemKind.RATE_REFUSED, "“Speakers” refuses 48000 Hz"),
        (opening(PortAudioError("Invalid sample rate")), ProblemKind.RATE_REFUSED, "refuses 48000 Hz"),
        (opening(PortAudioError("Device unavailable", -9985)), ProblemKind.BUSY, "in use by another program"),
        (opening(PortAudioError("x", -9999, (0, -16, "Device or resource busy"))), ProblemKind.BUSY, "in use"),
        (opening(PortAudioError("x", -9999, (0, 0, "AUDCLNT_E_DEVICE_IN_USE"))), ProblemKind.BUSY, "in use"),
        (opening(PortAudioError("x", -9999, (0, -19, "No such device"))), ProblemKind.VANISHED, "disconnected"),
        (opening(PortAudioError("Invalid device", -9996)), ProblemKind.VANISHED, "disconnected"),
        (opening(PortAudioError("Internal PortAudio error", -9986)), ProblemKind.NOT_OPENED, "could not be opened"),
        (opening(ValueError("strange")), ProblemKind.NOT_OPENED, "could not be opened"),
        (
            lambda portaudio: setattr(portaudio, "start_error", PortAudioError("busy", -9985)),
            *(ProblemKind.BUSY, "in use by another program"),
        ),
        (
            lambda portaudio: portaudio.entries.pop(2),
            ProblemKind.VANISHED,
            "“Speakers” was not found: it is disconnected",
        ),
        (lambda portaudio: portaudio.entries.clear(), ProblemKind.VANISHED, "disconnected"),
    ],
)
def test_a_device_that_cannot_be_opened_is_explained_and_freed(
    portaudio: FakeSoundDevice, mixer: Mixer, fault: Callable[[Any], object], kind: ProblemKind, message: str
) -> None:
    wanted = find(DeviceChoice(name="Speakers", host_api="ALSA"))
    fault(portaudio)
    with pytest.raises(AudioProblem, match=message) as caught:
        DeviceOutput(wanted, 0.05, mixer)
    error = portaudio.open_error or portaudio.start_error
    assert caught.value.kind is kind and caught.value.remedy in str(caught.value)
    assert error is None or caught.value.detail == str(error)
    assert all(stream.asked == ["abort", "close"] for stream in portaudio.streams)
    output_devices(rescan=True)
    assert portaudio.restarts == 1, "no stream counts as open"


def test_a_missing_portaudio_is_said_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    original = builtins.__import__

    def refuse(name: str, *arguments: Any, **options: Any) -> Any:
        if name == "sounddevice":
            raise OSError("PortAudio library not found")
        return original(name, *arguments, **options)

    monkeypatch.setattr("builtins.__import__", refuse)
    with pytest.raises(AudioProblem) as caught:
        output_devices()
    assert caught.value.kind is ProblemKind.PORTAUDIO_MISSING
    assert caught.value.detail == "PortAudio library not found"


@pytest.mark.skipif(sys.platform != "linux", reason="ALSA is Linux's")
def test_alsa_prints_nothing_into_the_terminal() -> None:
    """In a process of its own: the handler stays."""
    script = (
        "import ctypes, contextlib, sys; from app.audio.devices import output_devices\n"
        "with contextlib.suppress(Exception): sys.argv[1:] and output_devices()\n"
        "ctypes.CDLL('libasound.so.2').snd_pcm_open(ctypes.byref(ctypes.c_void_p()), b'no_such_device', 0, 0)"
    )
    loud, quiet = (
        subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, check=False)
        for words in ([], ["quiet"])
    )
    if "ALSA lib" not in loud.stderr:
        pytest.skip("there is no ALSA")
    assert (quiet.returncode, quiet.stderr) == (0, "")

"""Outputs are known by name, and what goes wrong with them is said in plain words."""

import math
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import app
from app.audio.devices import AudioDevice, close_device, default_device, find, open_device, output_devices
from app.audio.output import DeviceOutput
from app.audio.problems import AudioUnavailable, ProblemKind
from engine.kernels.mixer import call
from engine.kernels.mixer_records import CAUSE_DEVICE
from engine.kernels.voice import note_gap
from engine.voices import Mixer


class PortAudioError(Exception):
    pass


class FakeStream:
    """What `sounddevice` opens; the device itself calls the mixer."""

    latency, time, cpu_load, active = 0.02, 3.0, 0.1, False

    def __init__(self) -> None:
        self.asked: list[str] = []

    def start(self) -> None:
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

    def __init__(self, entries: list[tuple[str, int, int]], default: int = -1) -> None:
        super().__init__(default=SimpleNamespace(device={"output": default}), opened=[], restarts=0)
        self.streams: list[FakeStream] = []
        self._ffi = SimpleNamespace(cast=lambda kind, address: (kind, address))
        self.entries = entries
        self.refusal: Exception | None = None

    def query_hostapis(self) -> tuple[dict[str, Any], ...]:
        return ({"name": "ALSA"}, {"name": "JACK"})

    def query_devices(self, index: int | None = None) -> Any:
        entries = [
            {
                "name": name,
                "hostapi": api,
                "max_output_channels": channels,
                "default_samplerate": 48_000.0,
                "default_high_output_latency": 0.035,
                "default_low_output_latency": 0.01,
            }
            for name, api, channels in self.entries
        ]
        return entries if index is None else entries[index]

    def _StreamBase(self, **options: Any) -> FakeStream:
        self.opened.append(options)
        if self.refusal is not None:
            raise self.refusal
        self.streams.append(FakeStream())
        return self.streams[-1]

    def _terminate(self) -> None:
        self.restarts += 1

    def _initialize(self) -> None:
        self.entries.append(("Headset", 0, 2))


@pytest.fixture
def sounddevice(monkeypatch: pytest.MonkeyPatch) -> FakeSoundDevice:
    fake = FakeSoundDevice([("Microphone", 0, 0), ("HDMI", 0, 8), ("Speakers", 0, 2), ("Speakers", 1, 1)], 2)
    monkeypatch.setitem(sys.modules, "sounddevice", fake)
    monkeypatch.setattr("app.audio.devices._streams", set())
    return fake


@pytest.fixture
def mixer() -> Mixer:
    return Mixer(48_000)


def test_outputs_are_listed_with_the_default_first(sounddevice: FakeSoundDevice) -> None:
    assert output_devices() == [
        AudioDevice("Speakers", "ALSA", 48_000, 2, is_default=True),
        AudioDevice("HDMI", "ALSA", 48_000, 8),
        AudioDevice("Speakers", "JACK", 48_000, 1),
    ]
    assert default_device().name == "Speakers"
    sounddevice.default.device["output"] = -1
    assert default_device().name == "HDMI"


def test_a_device_is_found_again_though_its_index_has_moved(sounddevice: FakeSoundDevice, mixer: Mixer) -> None:
    wanted = find("Speakers", "ALSA")
    sounddevice.entries.insert(0, ("Webcam", 0, 2))
    open_device(wanted, 0.05, mixer)
    (options,) = sounddevice.opened
    assert options["device"] == 3
    assert options["samplerate"] == 48_000
    assert options["blocksize"] == 600  # a quarter of the buffer
    assert (options["channels"], options["dtype"]) == (2, "float32")
    assert options["latency"] == 0.05
    open_device(wanted, 0.005, mixer)
    assert (sounddevice.opened[1]["latency"], sounddevice.opened[1]["blocksize"]) == (0.01, 64)
    open_device(wanted, 0.0, mixer)
    assert sounddevice.opened[2]["blocksize"] == 64


def test_the_device_calls_the_compiled_mixer_itself(sounddevice: FakeSoundDevice, mixer: Mixer) -> None:
    open_device(find("HDMI", "ALSA"), 0.05, mixer)
    (options,) = sounddevice.opened
    assert options["callback"] == ("PaStreamCallback*", call.address)
    assert options["userdata"] == ("void*", mixer.address)
    assert options["channels"] == 2  # of its eight


def test_nothing_is_looked_for_again_while_a_stream_is_open(sounddevice: FakeSoundDevice, mixer: Mixer) -> None:
    stream = open_device(find("Speakers", "ALSA"), 0.05, mixer)
    output_devices(rescan=True)
    assert sounddevice.restarts == 0
    close_device(stream)
    assert sounddevice.streams[0].asked == ["abort", "close"]  # though it could not stop
    output_devices(rescan=True)
    assert sounddevice.restarts == 1


@pytest.mark.parametrize("value", [0.0, float("nan"), float("inf"), float("-inf"), -1795774879.331, 1e12])
def test_times_of_a_device_that_cannot_be_are_not_shown(
    sounddevice: FakeSoundDevice, mixer: Mixer, monkeypatch: pytest.MonkeyPatch, value: float
) -> None:
    for name in ("latency", "time", "cpu_load"):
        monkeypatch.setattr(FakeStream, name, value)
    output = DeviceOutput(find("Speakers", "ALSA"), 0.05, mixer)
    assert output.latency_s == 0.05, "as it was asked for"
    assert math.isfinite(output.now_s()) and 0 <= output.load() < math.inf
    mixer.record["dac_s"] = value
    assert 0 <= mixer.output_latency_s < 1
    note_gap(mixer.record, 100, 1000 * value, CAUSE_DEVICE)
    (gap,) = mixer.new_gaps()
    assert gap.milliseconds == 0.0
    output.close()


def test_an_output_plays_stalls_and_is_lost(
    sounddevice: FakeSoundDevice, mixer: Mixer, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 100.0
    monkeypatch.setattr("app.audio.output.time.monotonic", lambda: now_s)
    output = DeviceOutput(find("Speakers", "ALSA"), 0.05, mixer)
    (stream,) = sounddevice.streams
    assert (output.latency_s, output.now_s(), output.load()) == (0.02, 3.0, 0.1)
    assert not output.stalled() and not output.lost()
    now_s += 3.0
    assert output.stalled() and not output.lost()
    mixer.record["calls"] += 1
    assert not output.stalled()
    now_s += 7.0
    assert output.lost()
    mixer.record["calls"] += 1
    assert not output.lost()
    stream.active = False
    assert output.lost()
    output.close()
    assert stream.asked == ["start", "abort", "close"]
    with pytest.raises(RuntimeError, match="closed"):
        output.now_s()  # its memory is PortAudio's again


def test_an_output_that_does_not_start_is_freed(
    sounddevice: FakeSoundDevice, mixer: Mixer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(self: FakeStream) -> None:
        raise PortAudioError("busy", -9985)

    monkeypatch.setattr(FakeStream, "start", refuse)
    with pytest.raises(AudioUnavailable, match="in use by another program"):
        DeviceOutput(find("Speakers", "ALSA"), 0.05, mixer)
    assert sounddevice.streams[0].asked == ["abort", "close"]
    output_devices(rescan=True)
    assert sounddevice.restarts == 1


def test_rescanning_finds_what_was_plugged_in(sounddevice: FakeSoundDevice) -> None:
    with pytest.raises(AudioUnavailable):
        find("Headset", "ALSA")
    assert find("Headset", "ALSA", rescan=True).channels == 2
    assert sounddevice.restarts == 1


def test_a_vanished_device_is_named(sounddevice: FakeSoundDevice, mixer: Mixer) -> None:
    with pytest.raises(AudioUnavailable, match="“Headset” was not found: it is disconnected") as caught:
        open_device(AudioDevice("Headset", "ALSA", 48_000), 0.05, mixer)
    assert caught.value.kind is ProblemKind.VANISHED


@pytest.mark.parametrize(
    ("error", "kind", "message"),
    [
        (PortAudioError("Error opening", -9997), ProblemKind.RATE_REFUSED, "“Speakers” refuses 48000 Hz"),
        (PortAudioError("Invalid sample rate"), ProblemKind.RATE_REFUSED, "refuses 48000 Hz"),
        (PortAudioError("Device unavailable", -9985), ProblemKind.BUSY, "in use by another program"),
        (PortAudioError("x", -9999, (0, -16, "Device or resource busy")), ProblemKind.BUSY, "in use"),
        (PortAudioError("x", -9999, (0, 0, "AUDCLNT_E_DEVICE_IN_USE")), ProblemKind.BUSY, "in use"),
        (PortAudioError("x", -9999, (0, -19, "No such device")), ProblemKind.VANISHED, "disconnected"),
        (PortAudioError("Invalid device", -9996), ProblemKind.VANISHED, "disconnected"),
        (PortAudioError("Internal PortAudio error", -9986), ProblemKind.OTHER, "could not be opened"),
        (ValueError("strange"), ProblemKind.OTHER, "could not be opened"),
    ],
)
def test_refusals_are_explained(
    sounddevice: FakeSoundDevice, mixer: Mixer, error: Exception, kind: ProblemKind, message: str
) -> None:
    sounddevice.refusal = error
    with pytest.raises(AudioUnavailable, match=message) as caught:
        open_device(find("Speakers", "ALSA"), 0.05, mixer)
    assert caught.value.kind is kind
    assert caught.value.detail == str(error)
    assert caught.value.remedy in str(caught.value)


def test_no_output_at_all(sounddevice: FakeSoundDevice) -> None:
    sounddevice.entries[:] = [("Microphone", 0, 0)]
    assert output_devices() == []
    with pytest.raises(AudioUnavailable, match="No audio output") as caught:
        default_device()
    assert caught.value.kind is ProblemKind.NO_DEVICE


def test_neither_portaudio_nor_qt_is_needed_for_the_import() -> None:
    code = "import sys, app.audio; print(*{'sounddevice', 'PySide6'} & {*sys.modules})"
    environment = {**os.environ, "PYTHONPATH": str(Path(app.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert (done.stdout.strip(), done.stderr) == ("", "")


def test_a_missing_portaudio_is_said_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str, *arguments: Any, **options: Any) -> Any:
        if name == "sounddevice":
            raise OSError("PortAudio library not found")
        return original(name, *arguments, **options)

    original = __import__
    monkeypatch.delitem(sys.modules, "sounddevice", raising=False)
    monkeypatch.setattr("builtins.__import__", refuse)
    with pytest.raises(AudioUnavailable, match="apt-get install libportaudio2") as caught:
        output_devices()
    assert caught.value.kind is ProblemKind.PORTAUDIO_MISSING
    assert caught.value.detail == "PortAudio library not found"


@pytest.mark.skipif(sys.platform != "linux", reason="ALSA is Linux's")
def test_alsa_prints_nothing_into_the_terminal() -> None:
    """In a process of its own: the handler stays."""
    script = (
        "import ctypes, sys; from app.audio.devices import _silence_alsa\n"
        "if sys.argv[1:]: _silence_alsa()\n"
        "ctypes.CDLL('libasound.so.2').snd_pcm_open(ctypes.byref(ctypes.c_void_p()), b'no_such_device', 0, 0)"
    )
    loud, quiet = (
        subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, check=False)
        for words in ([], ["quiet"])
    )
    if "ALSA lib" not in loud.stderr:
        pytest.skip("there is no ALSA")
    assert (quiet.returncode, quiet.stderr) == (0, "")

"""Outputs are known by name, and one table has what goes wrong with them, in plain words."""

import builtins
import math
import sys
from operator import attrgetter
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

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


@pytest.fixture
def portaudio(monkeypatch: pytest.MonkeyPatch) -> Mock:
    """The part of the `sounddevice` module that is used; `stream` is what it opens."""
    fake = Mock(PortAudioError=PortAudioError, default=SimpleNamespace(device={"output": 2}))
    fake.entries = [("Microphone", 0, 0), ("HDMI", 0, 8), ("Speakers", 0, 2), ("Speakers", 1, 1)]
    fake.stream = fake._StreamBase.return_value = Mock(latency=0.02, time=3.0, cpu_load=0.1, active=True)
    fake.stream.abort.side_effect = PortAudioError("it cannot even stop")
    fake.query_hostapis.return_value = ({"name": "ALSA"}, {"name": "JACK"})
    fake._ffi.cast = lambda kind, address: (kind, address)
    fake._initialize.side_effect = lambda: fake.entries.append(("Headset", 0, 2))

    def query_devices(index: int | None = None) -> Any:
        other = {"default_samplerate": 48_000.0, "default_low_output_latency": 0.01}
        rows = [{"name": n, "hostapi": api, "max_output_channels": most} | other for n, api, most in fake.entries]
        return rows if index is None else rows[index]

    fake.query_devices = query_devices
    monkeypatch.setitem(sys.modules, "sounddevice", fake)
    return fake


@pytest.fixture
def mixer() -> Mixer:
    return Mixer(48_000)


def found(name: str = "Speakers", rescan: bool = False) -> AudioDevice:
    return find(DeviceChoice(name=name, host_api="ALSA"), rescan)


def asked(stream: Mock) -> list[str]:
    return [name for name, *_ in stream.method_calls]


def test_outputs_are_listed_with_the_default_first(portaudio):
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
    portaudio, mixer, buffer_s, latency_s, block
):
    """In blocks of a quarter of its buffer, of two channels. PortAudio is not started again under an open stream."""
    wanted = found("HDMI")
    portaudio.entries.insert(0, ("Webcam", 0, 2))  # its index moves
    stream = open_device(wanted, buffer_s, mixer)
    assert portaudio._StreamBase.call_args.kwargs == {
        **{"kind": "output", "samplerate": 48_000, "blocksize": block, "device": 2, "channels": 2},
        **{"dtype": "float32", "latency": latency_s, "callback": ("PaStreamCallback*", call.address)},
        "userdata": ("void*", mixer.address),
    }
    output_devices(rescan=True)
    assert portaudio._terminate.call_count == 0
    close_device(stream)
    assert asked(stream) == ["abort", "close"]  # though it could not stop
    assert found("Headset", rescan=True).channels == 2, "it was plugged in"
    assert portaudio._terminate.call_count == 1
    portaudio.entries.clear()
    with pytest.raises(AudioProblem, match="“HDMI” was not found: it is disconnected") as caught:
        open_device(wanted, buffer_s, mixer)
    assert caught.value.kind is ProblemKind.VANISHED


@pytest.mark.parametrize("value", [0.0, float("nan"), float("inf"), float("-inf"), -1795774879.331, 1e12])
def test_times_that_cannot_be_are_not_shown(portaudio, mixer, value):
    portaudio.stream.configure_mock(latency=value, time=value, cpu_load=value)
    output = DeviceOutput(found(), 0.05, mixer)
    assert output.latency_s == 0.05, "as it was asked for"
    assert math.isfinite(output.now_s()) and 0 <= output.load() < math.inf
    mixer.record["dac_s"] = value
    assert 0 <= mixer.output_latency_s < 1
    note_gap(mixer.record, 100, 1000 * value, CAUSE_DEVICE)
    assert [gap.milliseconds for gap in mixer.new_gaps()] == [0.0]
    output.close()


def test_an_output_plays_stalls_and_is_lost(portaudio, mixer, monkeypatch):
    now_s, stream = 100.0, portaudio.stream
    monkeypatch.setattr("app.audio.output.time.monotonic", lambda: now_s)
    output = DeviceOutput(found(), 0.05, mixer)
    assert (output.latency_s, output.now_s(), output.load()) == (0.02, 3.0, 0.1)
    course = ((0, 0, True), (3, 0, True), (0, 1, True), (7, 0, True), (0, 1, True), (0, 0, False))
    states = []
    for later_s, calls, stream.active in course:
        now_s += later_s
        mixer.record["calls"] += calls
        states.append((output.stalled(), output.lost()))
    assert [stalled for stalled, _ in states] == [False, True, False, True, False, False]
    assert [lost for _, lost in states] == [False, False, False, True, False, True]
    output.close()
    assert asked(stream) == ["start", "abort", "close"]
    with pytest.raises(RuntimeError, match="closed"):
        output.now_s()  # its memory is PortAudio's again


WORDS = {
    ProblemKind.RATE_REFUSED: "“Speakers” refuses 48000 Hz",
    ProblemKind.BUSY: "“Speakers” is in use by another program",
    ProblemKind.VANISHED: "“Speakers” was not found: it is disconnected",
    ProblemKind.NOT_OPENED: "“Speakers” could not be opened",
}


@pytest.mark.parametrize("place", ["_StreamBase", "stream.start"])
@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (PortAudioError("Error opening", -9997), ProblemKind.RATE_REFUSED),
        (PortAudioError("Invalid sample rate"), ProblemKind.RATE_REFUSED),
        (PortAudioError("Device unavailable", -9985), ProblemKind.BUSY),
        (PortAudioError("x", -9999, (0, -16, "Device or resource busy")), ProblemKind.BUSY),
        (PortAudioError("x", -9999, (0, 0, "AUDCLNT_E_DEVICE_IN_USE")), ProblemKind.BUSY),
        (PortAudioError("x", -9999, (0, -19, "No such device")), ProblemKind.VANISHED),
        (PortAudioError("Invalid device", -9996), ProblemKind.VANISHED),
        (PortAudioError("Internal PortAudio error", -9986), ProblemKind.NOT_OPENED),
        (ValueError("strange"), ProblemKind.NOT_OPENED),
    ],
)
def test_a_device_that_cannot_be_opened_is_explained_and_freed(portaudio, mixer, place, error, kind):
    attrgetter(place)(portaudio).side_effect = error
    with pytest.raises(AudioProblem, match=WORDS[kind]) as caught:
        DeviceOutput(found(), 0.05, mixer)
    assert (caught.value.kind, caught.value.detail) == (kind, str(error))
    assert caught.value.remedy in str(caught.value)
    assert asked(portaudio.stream) == (["start", "abort", "close"] if "start" in place else [])
    output_devices(rescan=True)
    assert portaudio._terminate.call_count == 1, "no stream counts as open"


@pytest.mark.parametrize(
    ("error", "kind"), [(OSError, ProblemKind.PORTAUDIO_MISSING), (PortAudioError, ProblemKind.NOT_STARTED)]
)
def test_no_portaudio_is_said(monkeypatch, error, kind):
    original = builtins.__import__

    def refuse(name: str, *arguments: Any, **options: Any) -> Any:
        if name == "sounddevice":
            raise error("PortAudio library not found")
        return original(name, *arguments, **options)

    monkeypatch.setattr("builtins.__import__", refuse)
    with pytest.raises(AudioProblem) as caught:
        output_devices()
    assert (caught.value.kind, caught.value.detail) == (kind, "PortAudio library not found")

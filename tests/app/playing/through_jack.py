"""Sends MIDI through a real port of a private JACK server into the app's own input, and prints what came, as JSON.

A script of its own, which a driver's fault or a deadlock would end:  python through_jack.py FOLDER
"""

from __future__ import annotations

import faulthandler
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.player.events import Bend, ControlChange, Event, NoteOff, NoteOn
from app.player.midi_file import message_of
from app.playing.midi_backend import VARIABLE, MidiUnavailable, RtMidi, load_backend
from app.playing.midi_port import MidiInput

PATIENCE_S = 10.0


def until(done: Callable[[], object]) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not done() and time.monotonic() < deadline_s:
        time.sleep(0.005)


def tried(work: Callable[[], Any]) -> Any:
    """What `work` returns at last; JACK refuses a client while it starts, and now and then while it is busy."""
    deadline_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            return work()
        except (OSError, MidiUnavailable):
            if time.monotonic() > deadline_s:
                raise
            time.sleep(0.05)


def virtual_output(name: str) -> Any:
    """An output that other programs find as an input."""
    import supriya_midi

    systems = {supriya_midi.get_api_name(api): api for api in supriya_midi.get_compiled_apis()}
    output = supriya_midi.MidiOut(systems[os.environ[VARIABLE]], "Learned Strings")
    try:
        return output.open_virtual_port(name)
    except (supriya_midi.RtMidiError, RuntimeError) as error:
        output.delete()
        raise OSError(str(error)) from error


def measured(backend: RtMidi) -> dict[str, Any]:
    came: list[Event] = []
    ended, found = threading.Event(), dict[str, Any]()
    midi, output = MidiInput(came.append), tried(lambda: virtual_output("hands"))

    def send(*events: Event) -> None:
        for event in events:
            output.send_message(message_of(event))

    def stream() -> None:
        while not ended.is_set():
            send(Bend(0.5))
            time.sleep(0.001)

    def port(ending: str) -> str:
        return next(each for each in midi.names() if each.endswith(ending))

    name = tried(lambda: port("hands"))
    tried(lambda: midi.open(name))
    until(lambda: send(Bend(0.0)) or came)  # until the server has connected them
    events = [NoteOn(60, 100, 2), Bend(-1.0), ControlChange(64, 127), NoteOff(60, 2)]
    send(*events)
    until(lambda: came[-4:] == events)
    found["came"] = [repr(event) for event in came[-4:]]
    streaming = threading.Thread(target=stream)
    streaming.start()
    try:
        for found["closed"] in range(1, 11):
            midi.close()
            came.clear()
            tried(lambda: midi.open(name))
        until(lambda: came)
        found["streamed"] = bool(came)
        midi.close()
    finally:
        ended.set()
        streaming.join()
    other = virtual_output("other")
    midi.open(port("other"))
    found["looks"] = [midi.look()]
    other.delete()
    until(lambda: found["looks"][-1] or found["looks"].append(midi.look()))
    found["looks"].append(midi.look())
    other = virtual_output("other")
    until(lambda: found["looks"][-1] or found["looks"].append(midi.look()))
    came.clear()
    until(lambda: other.send_message([0x90, 60, 100]) or came)
    found["came again"] = repr(came[0])
    try:
        midi.open("Nobody:nothing")
    except MidiUnavailable as error:
        found["absent"] = str(error)
    for each in (other, output):
        each.delete()
    return found


def main(folder: str) -> None:
    faulthandler.dump_traceback_later(120, exit=True)
    server = f"play{os.getpid()}"
    os.environ |= {"JACK_DEFAULT_SERVER": server, "JACK_NO_START_SERVER": "1", VARIABLE: "jack"}
    options = "--no-realtime --sync --name {} -d dummy --rate 48000 --period 128"
    command = ["jackd", *options.format(server).split()]
    environment = {**os.environ, "JACK_NO_AUDIO_RESERVATION": "1"}
    with (Path(folder) / "log").open("wb") as log:
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    try:
        found = measured(load_backend())
    finally:
        process.terminate()
        process.wait()
    try:
        MidiInput(print).names()
    except (MidiUnavailable, OSError) as error:
        found["no server"] = str(error)
    print(json.dumps(found))


if __name__ == "__main__":
    main(sys.argv[1])

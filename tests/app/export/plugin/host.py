"""A CLAP host: loads a plug-in, sends events, takes sound. Structures are written from CLAP's documents."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.app.export.plugin.abi import Events, Playing, Sound, cut_off, filled, structures

NOTE_ON, NOTE_OFF, NOTE_CHOKE, NOTE_END, EXPRESSION, PARAM, MIDI = 0, 1, 2, 3, 4, 5, 10
TUNING, BRIGHTNESS = 3, 5
IN_FILE, IN_PLUGIN = 0, 1  # kinds of places of presets

clap = structures("clap")


def presets(library: Library, kind: int = IN_PLUGIN) -> list[tuple[str, str]]:
    """Names and keys that a provider reports of one kind of place."""
    reported = list[tuple[str, str]]()

    def begin(_receiver: int, name: bytes, key: bytes) -> bool:
        reported.append((name.decode(), key.decode()))
        return True

    indexer = filled(clap.Indexer, version=clap.Version(1, 2, 0), name=b"tests", declare_location=lambda *_: True)
    others = ("add_plugin_id", "set_flags", "set_description", "add_creator", "add_feature")
    receiver = filled(clap.Receiver, begin_preset=begin, **dict.fromkeys(others, lambda *_: None))
    at = library.entry.get_factory(b"clap.preset-discovery-factory/2")
    factory = clap.Factory.from_address(at)
    id = clap.Descriptor.from_address(factory.descriptor(at, 0)).id
    made = factory.create(at, c.addressof(indexer), id)
    provider = clap.Provider.from_address(made)
    assert provider.init(made)
    assert provider.get_metadata(made, kind, None, c.byref(receiver)) == (kind == IN_PLUGIN)
    provider.destroy(made)
    return reported


Event = tuple[int, c.Structure]


def event(frame: int, kind: Any, type: int, *values: Any) -> Event:
    return frame, kind(clap.Header(c.sizeof(kind), 0, 0, type, 0), *values)


def note_on(frame: int, key: int, velocity: float, channel: int = 0, note_id: int = -1) -> Event:
    return event(frame, clap.NoteEvent, NOTE_ON, note_id, 0, channel, key, velocity / 127)


def note_off(frame: int, key: int, channel: int = 0) -> Event:
    return event(frame, clap.NoteEvent, NOTE_OFF, -1, 0, channel, key, 0.0)


def choke(frame: int, key: int = -1, note_id: int = -1) -> Event:
    return event(frame, clap.NoteEvent, NOTE_CHOKE, note_id, 0, -1, key, 0.0)


def tune(frame: int, semitones: float, note_id: int) -> Event:
    return event(frame, clap.ExpressionEvent, EXPRESSION, TUNING, note_id, 0, -1, -1, semitones)


def brighten(frame: int, value: float, channel: int) -> Event:
    return event(frame, clap.ExpressionEvent, EXPRESSION, BRIGHTNESS, -1, 0, channel, -1, value)


def midi(frame: int, *data: int) -> Event:
    return event(frame, clap.MidiEvent, MIDI, 0, (c.c_uint8 * 3)(*data))


def param(frame: int, id: int, value: float) -> Event:
    return event(frame, clap.ParamEvent, PARAM, id, None, -1, -1, -1, -1, value)


def of_midi(frame: int, data: bytes) -> Event:
    """Notes as CLAP has them; other messages as they are."""
    kind, channel = data[0] & 0xF0, data[0] & 15
    if kind == 0x90:
        return note_on(frame, data[1], data[2], channel)
    return note_off(frame, data[1], channel) if kind == 0x80 else midi(frame, *data)


class Library:
    def __init__(self, path: Path) -> None:
        self.instances: list[Instance] = []
        self.library = c.CDLL(str(path))
        self.entry = clap.Entry.in_dll(self.library, "clap_entry")
        assert self.entry.init(str(path).encode())
        self.at = self.entry.get_factory(b"clap.plugin-factory")
        self.factory = clap.Factory.from_address(self.at)

    @property
    def plugins(self) -> dict[str, str]:
        all_of = (self.factory.descriptor(self.at, index) for index in range(self.factory.count(self.at)))
        return {each.id.decode(): each.name.decode() for each in map(clap.Descriptor.from_address, all_of)}

    def create(self, id: str) -> Instance:
        self.instances.append(Instance(self, id))
        return self.instances[-1]

    def create_named(self, name: str) -> Instance:
        return self.create(self.id_of(name))

    def id_of(self, name: str) -> str:
        return next(id for id, shown in self.plugins.items() if shown == name)

    def destroy_instances(self) -> None:
        while self.instances:
            self.instances.pop().destroy()


class Instance(Playing):
    def __init__(self, library: Library, id: str) -> None:
        self.callbacks = 0
        self.rescans: list[int] = []
        self.loaded: list[tuple[int, bytes | None, bytes | None]] = []
        self.errors: list[bytes] = []
        self.ended: list[int] = []
        self.offers: dict[bytes, c.Structure] = {
            b"clap.params": filled(clap.HostParams, rescan=lambda _host, flags: self.rescans.append(flags)),
            b"clap.preset-load/2": filled(
                clap.HostPresetLoad,
                on_error=lambda _host, _kind, _location, _key, _code, text: self.errors.append(text),
                loaded=lambda _host, *place: self.loaded.append(place),
            ),
        }

        def offered(_host: int, id: bytes) -> int | None:
            return c.addressof(self.offers[id]) if id in self.offers else None

        def call_back(_host: int) -> None:
            self.callbacks += 1

        texts = {"name": b"tests", "vendor": b"", "url": b"", "host_version": b"1"}
        calls: dict[str, Any] = dict.fromkeys(("request_restart", "request_process"), lambda host: None)
        calls |= {"get_extension": offered, "request_callback": call_back}
        self._host = filled(clap.HostStructure, version=clap.Version(1, 2, 0), **texts, **calls)
        self.at = library.factory.create(library.at, c.addressof(self._host), id.encode())
        assert self.at, f"{id} is not in the library"
        self._own = clap.Plugin.from_address(self.at)
        assert self._own.init(self.at)

    def extension(self, id: str, kind: type[c.Structure]) -> c.Structure:
        at = self._own.get_extension(self.at, id.encode())
        assert at, f"no extension {id}"
        return kind.from_address(at)

    @property
    def parameters(self) -> dict[str, Any]:
        """By name, in the plug-in's order."""
        params = self.extension("clap.params", clap.Params)
        found = [clap.ParamInfo() for _ in range(params.count(self.at))]
        assert all(params.info(self.at, index, c.byref(info)) for index, info in enumerate(found))
        return {info.name.decode(): info for info in found}

    @property
    def ids(self) -> list[int]:
        return [info.id for info in self.parameters.values()]

    def value(self, id: int) -> float:
        found = c.c_double()
        assert self.extension("clap.params", clap.Params).value(self.at, id, c.byref(found))
        return found.value

    def text(self, id: int, value: float) -> str:
        """A value in words, which lead back to it, within single precision."""
        found = c.create_string_buffer(64)
        assert self.extension("clap.params", clap.Params).to_text(self.at, id, value, found, len(found))
        back = self.number(id, found.value)
        assert back is not None and abs(back - value) < 2e-6
        return found.value.decode()

    def number(self, id: int, text: bytes) -> float | None:
        found = c.c_double()
        done = self.extension("clap.params", clap.Params).from_text(self.at, id, text, c.byref(found))
        return found.value if done else None

    @property
    def latency(self) -> int:
        return int(self.extension("clap.latency", clap.Frames).get(self.at))

    def activate(self, rate_hz: float, most: int = 4096) -> None:
        assert self._own.activate(self.at, rate_hz, 1, most)
        assert self._own.start_processing(self.at)
        self.frame = 0

    def accepts(self, rate_hz: float, most: int = 4096) -> bool:
        """Whether it can be activated so; it is left as it was."""
        found = bool(self._own.activate(self.at, rate_hz, 1, most))
        self._own.deactivate(self.at)
        return found

    def deactivate(self) -> None:
        self._own.stop_processing(self.at)
        self._own.deactivate(self.at)

    def go_offline(self) -> None:
        assert self.extension("clap.render", clap.Render).set(self.at, 1)

    def reset(self) -> None:
        self._own.reset(self.at)

    def destroy(self) -> None:
        """Once: later calls do nothing."""
        if self.at:
            self._own.destroy(self.at)
        self.at = 0

    def save(self) -> bytes:
        kept = bytearray()

        def write(_stream: int, data: int, size: int) -> int:
            kept.extend(c.string_at(data, size))
            return size

        assert self.extension("clap.state", clap.State).save(self.at, c.byref(filled(clap.Stream, move=write)))
        return bytes(kept)

    def load(self, content: bytes) -> bool:
        left = [content]

        def read(_stream: int, data: int, size: int) -> int:
            part = cut_off(left, size)
            c.memmove(data, part, len(part))
            return len(part)

        return bool(self.extension("clap.state", clap.State).load(self.at, c.byref(filled(clap.Stream, move=read))))

    def load_preset(self, key: str | None, kind: int = IN_PLUGIN) -> bool:
        load = self.extension("clap.preset-load/2", clap.PresetLoad)
        return bool(load.from_location(self.at, kind, None, None if key is None else key.encode()))

    def block(self, frames: int, events: Events) -> Sound:
        out = np.zeros((2, frames), np.float32)
        self.repeated(out, events)()
        return out.T.copy()

    def repeated(self, out: Sound, events: Events = ()) -> Callable[[], None]:
        """A call that gives the next frames to `out`, (2, frames), and makes nothing that could take time."""
        frames = out.shape[1]
        rows = (c.c_void_p * 2)(*(row.ctypes.data for row in out))
        due = [of_midi(*each) if isinstance(each[1], bytes) else each for each in events]
        for at, content in due:
            content.header.time = at

        def push(_list: int, at: int) -> bool:
            note = clap.NoteEvent.from_address(at)
            if note.header.type == NOTE_END:
                self.ended.append(note.note_id)
            return True

        incoming = filled(clap.InEvents, size=lambda _: len(due), get=lambda _, index: c.addressof(due[index][1]))
        outgoing = filled(clap.OutEvents, push=push)
        audio = clap.Audio(c.addressof(rows), None, 2, 0, 0)
        lists = c.addressof(incoming), c.addressof(outgoing)
        process = clap.Process(self.frame, frames, None, None, c.addressof(audio), 0, 1, *lists)
        at = c.addressof(process)
        memory = (out, rows, audio, incoming, outgoing, process)  # which the call keeps alive

        def call() -> None:
            self.status = self._own.process(self.at, at)
            assert self.status != 0 and memory
            self.frame += frames

        return call

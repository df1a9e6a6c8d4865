"""A CLAP host: loads a plug-in, sends events, takes sound. Structures are written from CLAP's documents."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

NOTE_ON, NOTE_OFF, NOTE_CHOKE, NOTE_END, EXPRESSION, PARAM, MIDI = 0, 1, 2, 3, 4, 5, 10


class Version(c.Structure):
    _fields_ = (("major", c.c_uint32), ("minor", c.c_uint32), ("revision", c.c_uint32))


class Header(c.Structure):
    _fields_ = (
        ("size", c.c_uint32),
        ("time", c.c_uint32),
        ("space", c.c_uint16),
        ("type", c.c_uint16),
        ("flags", c.c_uint32),
    )


_PLACE = (("note_id", c.c_int32), ("port", c.c_int16), ("channel", c.c_int16), ("key", c.c_int16))


class NoteEvent(c.Structure):
    _fields_ = (("header", Header), *_PLACE, ("velocity", c.c_double))


class ExpressionEvent(c.Structure):
    _fields_ = (("header", Header), ("id", c.c_int32), *_PLACE, ("value", c.c_double))


class ParamEvent(c.Structure):
    _fields_ = (("header", Header), ("id", c.c_uint32), ("cookie", c.c_void_p), *_PLACE, ("value", c.c_double))


class MidiEvent(c.Structure):
    _fields_ = (("header", Header), ("port", c.c_uint16), ("data", c.c_uint8 * 3))


SIZE_FN = c.CFUNCTYPE(c.c_uint32, c.c_void_p)
GET_FN = c.CFUNCTYPE(c.c_void_p, c.c_void_p, c.c_uint32)
PUSH_FN = c.CFUNCTYPE(c.c_bool, c.c_void_p, c.c_void_p)


class InEvents(c.Structure):
    _fields_ = (("context", c.c_void_p), ("size", SIZE_FN), ("get", GET_FN))


class OutEvents(c.Structure):
    _fields_ = (("context", c.c_void_p), ("push", PUSH_FN))


class Audio(c.Structure):
    _fields_ = (
        ("data32", c.POINTER(c.POINTER(c.c_float))),
        ("data64", c.c_void_p),
        ("channels", c.c_uint32),
        ("latency", c.c_uint32),
        ("constant", c.c_uint64),
    )


class Process(c.Structure):
    _fields_ = (
        ("steady", c.c_int64),
        ("frames", c.c_uint32),
        ("transport", c.c_void_p),
        ("inputs", c.c_void_p),
        ("outputs", c.POINTER(Audio)),
        ("inputs_count", c.c_uint32),
        ("outputs_count", c.c_uint32),
        ("in_events", c.POINTER(InEvents)),
        ("out_events", c.POINTER(OutEvents)),
    )


P = c.c_void_p


class Plugin(c.Structure):
    _fields_ = (
        ("descriptor", P),
        ("data", P),
        ("init", c.CFUNCTYPE(c.c_bool, P)),
        ("destroy", c.CFUNCTYPE(None, P)),
        ("activate", c.CFUNCTYPE(c.c_bool, P, c.c_double, c.c_uint32, c.c_uint32)),
        ("deactivate", c.CFUNCTYPE(None, P)),
        ("start_processing", c.CFUNCTYPE(c.c_bool, P)),
        ("stop_processing", c.CFUNCTYPE(None, P)),
        ("reset", c.CFUNCTYPE(None, P)),
        ("process", c.CFUNCTYPE(c.c_int32, P, c.POINTER(Process))),
        ("get_extension", c.CFUNCTYPE(P, P, c.c_char_p)),
        ("on_main_thread", c.CFUNCTYPE(None, P)),
    )


class HostStructure(c.Structure):
    _fields_ = (
        ("version", Version),
        ("data", P),
        ("name", c.c_char_p),
        ("vendor", c.c_char_p),
        ("url", c.c_char_p),
        ("host_version", c.c_char_p),
        ("get_extension", c.CFUNCTYPE(P, P, c.c_char_p)),
        ("request_restart", c.CFUNCTYPE(None, P)),
        ("request_process", c.CFUNCTYPE(None, P)),
        ("request_callback", c.CFUNCTYPE(None, P)),
    )


class Descriptor(c.Structure):
    _fields_ = (("version", Version), *((n, c.c_char_p) for n in ("id", "name", "vendor")))


class Factory(c.Structure):
    _fields_ = (
        ("count", c.CFUNCTYPE(c.c_uint32, P)),
        ("descriptor", c.CFUNCTYPE(c.POINTER(Descriptor), P, c.c_uint32)),
        ("create", c.CFUNCTYPE(c.POINTER(Plugin), P, P, c.c_char_p)),
    )


class Entry(c.Structure):
    _fields_ = (
        ("version", Version),
        ("init", c.CFUNCTYPE(c.c_bool, c.c_char_p)),
        ("deinit", c.CFUNCTYPE(None)),
        ("get_factory", c.CFUNCTYPE(P, c.c_char_p)),
    )


class ParamInfo(c.Structure):
    _fields_ = (
        ("id", c.c_uint32),
        ("flags", c.c_uint32),
        ("cookie", P),
        ("name", c.c_char * 256),
        ("module", c.c_char * 1024),
        ("low", c.c_double),
        ("high", c.c_double),
        ("standard", c.c_double),
    )


class Params(c.Structure):
    _fields_ = (
        ("count", c.CFUNCTYPE(c.c_uint32, P)),
        ("info", c.CFUNCTYPE(c.c_bool, P, c.c_uint32, c.POINTER(ParamInfo))),
        ("value", c.CFUNCTYPE(c.c_bool, P, c.c_uint32, c.POINTER(c.c_double))),
        ("to_text", c.CFUNCTYPE(c.c_bool, P, c.c_uint32, c.c_double, c.c_char_p, c.c_uint32)),
        ("from_text", c.CFUNCTYPE(c.c_bool, P, c.c_uint32, c.c_char_p, c.POINTER(c.c_double))),
    )


WRITE_FN = c.CFUNCTYPE(c.c_int64, P, P, c.c_uint64)


class Stream(c.Structure):
    _fields_ = (("context", P), ("move", WRITE_FN))


class State(c.Structure):
    _fields_ = tuple((n, c.CFUNCTYPE(c.c_bool, P, c.POINTER(Stream))) for n in ("save", "load"))


class Frames(c.Structure):
    _fields_ = (("get", c.CFUNCTYPE(c.c_uint32, P)),)


class Render(c.Structure):
    _fields_ = (("required", c.CFUNCTYPE(c.c_bool, P)), ("set", c.CFUNCTYPE(c.c_bool, P, c.c_int32)))


IN_FILE, IN_PLUGIN = 0, 1  # kinds of places of presets
S = c.c_char_p


class PresetLoad(c.Structure):
    _fields_ = (("from_location", c.CFUNCTYPE(c.c_bool, P, c.c_uint32, S, S)),)


class HostParams(c.Structure):
    _fields_ = (
        ("rescan", c.CFUNCTYPE(None, P, c.c_uint32)),
        ("clear", c.CFUNCTYPE(None, P, c.c_uint32, c.c_uint32)),
        ("request_flush", c.CFUNCTYPE(None, P)),
    )


class HostPresetLoad(c.Structure):
    _fields_ = (
        ("on_error", c.CFUNCTYPE(None, P, c.c_uint32, S, S, c.c_int32, S)),
        ("loaded", c.CFUNCTYPE(None, P, c.c_uint32, S, S)),
    )


class UniversalId(c.Structure):
    _fields_ = (("abi", S), ("id", S))


TEXT_FN, TWO_TEXTS_FN = c.CFUNCTYPE(None, P, S), c.CFUNCTYPE(None, P, S, S)


class Receiver(c.Structure):
    _fields_ = (
        ("data", P),
        ("on_error", c.CFUNCTYPE(None, P, c.c_int32, S)),
        ("begin_preset", c.CFUNCTYPE(c.c_bool, P, S, S)),
        ("add_plugin_id", c.CFUNCTYPE(None, P, c.POINTER(UniversalId))),
        ("set_soundpack_id", TEXT_FN),
        ("set_flags", c.CFUNCTYPE(None, P, c.c_uint32)),
        ("add_creator", TEXT_FN),
        ("set_description", TEXT_FN),
        ("set_timestamps", c.CFUNCTYPE(None, P, c.c_uint64, c.c_uint64)),
        ("add_feature", TEXT_FN),
        ("add_extra_info", TWO_TEXTS_FN),
    )


class Location(c.Structure):
    _fields_ = (("flags", c.c_uint32), ("name", S), ("kind", c.c_uint32), ("location", S))


class ProviderDescriptor(c.Structure):
    _fields_ = (("version", Version), ("id", S), ("name", S), ("vendor", S))


class Provider(c.Structure):
    _fields_ = (
        ("descriptor", c.POINTER(ProviderDescriptor)),
        ("data", P),
        ("init", c.CFUNCTYPE(c.c_bool, P)),
        ("destroy", c.CFUNCTYPE(None, P)),
        ("get_metadata", c.CFUNCTYPE(c.c_bool, P, c.c_uint32, S, c.POINTER(Receiver))),
        ("get_extension", c.CFUNCTYPE(P, P, S)),
    )


class Indexer(c.Structure):
    _fields_ = (
        ("version", Version),
        *((name, S) for name in ("name", "vendor", "url", "host_version")),
        ("data", P),
        ("declare_filetype", c.CFUNCTYPE(c.c_bool, P, P)),
        ("declare_location", c.CFUNCTYPE(c.c_bool, P, c.POINTER(Location))),
        ("declare_soundpack", c.CFUNCTYPE(c.c_bool, P, P)),
        ("get_extension", c.CFUNCTYPE(P, P, S)),
    )


class PresetFactory(c.Structure):
    _fields_ = (
        ("count", c.CFUNCTYPE(c.c_uint32, P)),
        ("descriptor", c.CFUNCTYPE(c.POINTER(ProviderDescriptor), P, c.c_uint32)),
        ("create", c.CFUNCTYPE(c.POINTER(Provider), P, P, S)),
    )


@dataclass
class Preset:
    """As a host's browser has it; `plugins` are pairs of interface and identifier."""

    name: str
    key: str
    plugins: list[tuple[str, str]] = field(default_factory=list)
    flags: int = 0
    creators: list[str] = field(default_factory=list)
    description: str = ""
    features: list[str] = field(default_factory=list)


class Browser:
    """A host's list of the presets of a plug-in file."""

    def __init__(self, library: Library) -> None:
        self.locations: list[tuple[int, str, int, str | None]] = []
        self._indexer = Indexer(Version(1, 2, 0), b"tests")
        self._indexer.declare_location = Indexer._fields_[7][1](self._declare)
        self.factory = c.cast(library.entry.get_factory(b"clap.preset-discovery-factory/2"), c.POINTER(PresetFactory))
        assert self.factory
        own = self.factory.contents
        self.ids = [own.descriptor(self._at, each).contents.id.decode() for each in range(own.count(self._at))]

    @property
    def _at(self) -> int:
        return c.addressof(self.factory.contents)

    def _declare(self, _indexer: int, location: c._Pointer[Location]) -> bool:
        at = location.contents
        self.locations.append((at.flags, at.name.decode(), at.kind, at.location and at.location.decode()))
        return True

    def create(self, id: str | None, indexer: bool = True) -> c._Pointer[Provider]:
        """A provider: null where there is none."""
        at = c.addressof(self._indexer) if indexer else None
        found: c._Pointer[Provider] = self.factory.contents.create(self._at, at, None if id is None else id.encode())
        return found

    def read(self, kind: int = IN_PLUGIN, most: int = 1_000, bare: bool = False) -> tuple[bool, list[Preset]]:
        """Whether the provider succeeded, and presets, up to one more than `most`; bare: only what is required."""
        found: list[Preset] = []

        def begin(_receiver: int, name: bytes, key: bytes) -> bool:
            found.append(Preset(name.decode(), key.decode()))
            return len(found) <= most

        kinds: dict[str, Any] = dict(Receiver._fields_)
        receiver = Receiver()
        receiver.begin_preset = kinds["begin_preset"](begin)
        if not bare:

            def add_plugin(_receiver: int, at: c._Pointer[UniversalId]) -> None:
                found[-1].plugins.append((at.contents.abi.decode(), at.contents.id.decode()))

            def set_flags(_receiver: int, flags: int) -> None:
                found[-1].flags = flags

            def describe(_receiver: int, text: bytes) -> None:
                found[-1].description = text.decode()

            receiver.add_plugin_id = kinds["add_plugin_id"](add_plugin)
            receiver.set_flags = kinds["set_flags"](set_flags)
            receiver.set_description = TEXT_FN(describe)
            receiver.add_creator = TEXT_FN(lambda _, text: found[-1].creators.append(text.decode()))
            receiver.add_feature = TEXT_FN(lambda _, text: found[-1].features.append(text.decode()))
        provider = self.create(self.ids[0])
        assert provider
        at, own = c.addressof(provider.contents), provider.contents
        assert own.init(at)
        assert not own.get_extension(at, b"unknown")
        done = own.get_metadata(at, kind, None, receiver)
        assert not own.get_metadata(at, kind, None, None)
        own.destroy(at)
        return bool(done), found


@dataclass(frozen=True)
class Event:
    """An event at a frame of the whole piece; `content` is one of the structures above."""

    frame: int
    content: c.Structure


def note_on(frame: int, key: int, velocity: float, channel: int = 0, note_id: int = -1) -> Event:
    return Event(frame, NoteEvent(Header(40, 0, 0, NOTE_ON, 0), note_id, 0, channel, key, velocity / 127))


def note_off(frame: int, key: int, channel: int = 0) -> Event:
    return Event(frame, NoteEvent(Header(40, 0, 0, NOTE_OFF, 0), -1, 0, channel, key, 0.0))


def choke(frame: int, key: int = -1, note_id: int = -1) -> Event:
    return Event(frame, NoteEvent(Header(40, 0, 0, NOTE_CHOKE, 0), note_id, 0, -1, key, 0.0))


def tune(frame: int, semitones: float, note_id: int) -> Event:
    return Event(frame, ExpressionEvent(Header(40, 0, 0, EXPRESSION, 0), 3, note_id, 0, -1, -1, semitones))


def brighten(frame: int, value: float, channel: int) -> Event:
    return Event(frame, ExpressionEvent(Header(40, 0, 0, EXPRESSION, 0), 5, -1, 0, channel, -1, value))


def midi(frame: int, *data: int) -> Event:
    return Event(frame, MidiEvent(Header(24, 0, 0, MIDI, 0), 0, (c.c_uint8 * 3)(*data)))


def param(frame: int, id: int, value: float) -> Event:
    return Event(frame, ParamEvent(Header(56, 0, 0, PARAM, 0), id, None, -1, -1, -1, -1, value))


class Library:
    """A plug-in file."""

    def __init__(self, path: Path) -> None:
        self.instances: list[Instance] = []
        self._library = c.CDLL(str(path))
        self.entry = Entry.in_dll(self._library, "clap_entry")
        assert self.entry.init(str(path).encode())
        self.factory = c.cast(self.entry.get_factory(b"clap.plugin-factory"), c.POINTER(Factory)).contents
        self._factory_at = c.addressof(self.factory)

    @property
    def plugins(self) -> dict[str, str]:
        """Names by id."""
        found = {}
        for index in range(self.factory.count(self._factory_at)):
            each = self.factory.descriptor(self._factory_at, index).contents
            found[each.id.decode()] = each.name.decode()
        return found

    def create(self, id: str) -> Instance:
        self.instances.append(Instance(self, id))
        return self.instances[-1]

    def destroy_instances(self) -> None:
        while self.instances:
            self.instances.pop().destroy()


class Instance:
    """A plug-in of a library."""

    def __init__(self, library: Library, id: str) -> None:
        self.callbacks = 0
        self.rescans: list[int] = []
        self.loaded: list[tuple[int, bytes | None, bytes | None]] = []
        self.errors: list[str] = []
        self.ended: list[int] = []

        def count(_host: int) -> None:
            self.callbacks += 1

        rescan, clear, flush = (kind for _, kind in HostParams._fields_)
        on_error, on_load = (kind for _, kind in HostPresetLoad._fields_)
        self._offers: dict[bytes, c.Structure] = {
            b"clap.params": HostParams(
                rescan(lambda host, flags: self.rescans.append(flags)),
                clear(lambda host, id, flags: None),
                flush(lambda host: None),
            ),
            b"clap.preset-load/2": HostPresetLoad(
                on_error(lambda host, kind, location, key, code, text: self.errors.append(text.decode())),
                on_load(lambda host, kind, location, key: self.loaded.append((kind, location, key))),
            ),
        }

        def offered(_host: int, id: bytes) -> int | None:
            return c.addressof(self._offers[id]) if id in self._offers else None

        none = HostStructure._fields_[7][1](lambda host: None)
        self._host = HostStructure(
            Version(1, 2, 0),
            None,
            b"tests",
            b"",
            b"",
            b"1",
            HostStructure._fields_[6][1](offered),
            none,
            none,
            HostStructure._fields_[9][1](count),
        )
        found = library.factory.create(library._factory_at, c.addressof(self._host), id.encode())
        assert found, f"{id} is not in the library"
        self.at = c.addressof(found.contents)
        self._own = found.contents
        assert self._own.init(self.at)
        self.frame = 0

    def extension(self, id: str, kind: type[c.Structure]) -> c.Structure:
        at = self._own.get_extension(self.at, id.encode())
        assert at, f"no extension {id}"
        return c.cast(at, c.POINTER(kind)).contents

    @property
    def parameters(self) -> dict[str, ParamInfo]:
        """By name."""
        params = self.extension("clap.params", Params)
        found = {}
        for index in range(params.count(self.at)):
            info = ParamInfo()
            assert params.info(self.at, index, info)
            found[info.name.decode()] = info
        return found

    @property
    def ids(self) -> list[int]:
        """Of its parameters, in the plug-in's order."""
        params, info = self.extension("clap.params", Params), ParamInfo()
        found = []
        for index in range(params.count(self.at)):
            assert params.info(self.at, index, info)
            found.append(info.id)
        return found

    def value(self, id: int) -> float:
        found = c.c_double()
        assert self.extension("clap.params", Params).value(self.at, id, found)
        return found.value

    def text(self, id: int, value: float) -> str:
        """A value in words, which lead back to it, within single precision."""
        params, found, back = self.extension("clap.params", Params), c.create_string_buffer(64), c.c_double()
        assert params.to_text(self.at, id, value, found, len(found))
        assert params.from_text(self.at, id, found.value, back)
        assert abs(back.value - value) < 2e-6
        return found.value.decode()

    @property
    def latency(self) -> int:
        return int(self.extension("clap.latency", Frames).get(self.at))

    def activate(self, rate_hz: float, most: int = 4096) -> None:
        assert self._own.activate(self.at, rate_hz, 1, most)
        assert self._own.start_processing(self.at)
        self.frame = 0

    def accepts(self, rate_hz: float, most: int) -> bool:
        """Whether it can be activated so; it is left as it was."""
        found = bool(self._own.activate(self.at, rate_hz, 1, most))
        self._own.deactivate(self.at)
        return found

    def deactivate(self) -> None:
        self._own.stop_processing(self.at)
        self._own.deactivate(self.at)

    def go_offline(self) -> None:
        """As hosts do before a bounce."""
        assert self.extension("clap.render", Render).set(self.at, 1)

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

        assert self.extension("clap.state", State).save(self.at, Stream(None, WRITE_FN(write)))
        return bytes(kept)

    def load(self, content: bytes) -> bool:
        left = [content]

        def read(_stream: int, data: int, size: int) -> int:
            part, left[0] = left[0][: min(size, 7)], left[0][min(size, 7) :]  # in small pieces, as hosts may
            c.memmove(data, part, len(part))
            return len(part)

        return bool(self.extension("clap.state", State).load(self.at, Stream(None, WRITE_FN(read))))

    def withdraw_extensions(self) -> None:
        """As a host that offers none."""
        self._offers.clear()

    def load_preset(self, key: str | None, kind: int = IN_PLUGIN) -> bool:
        load = self.extension("clap.preset-load/2", PresetLoad)
        return bool(load.from_location(self.at, kind, None, None if key is None else key.encode()))

    def block(self, frames: int, events: Sequence[Event]) -> NDArray[np.float32]:
        """The next frames, (frames, 2); events are of frames of the whole piece."""
        out = np.zeros((2, frames), np.float32)
        self.repeated(out, events)()
        return out.T.copy()

    def repeated(self, out: NDArray[np.float32], events: Sequence[Event] = ()) -> Callable[[], None]:
        """A call that gives the next frames to `out`, (2, frames), and makes nothing that could take time."""
        frames = out.shape[1]
        rows = (c.POINTER(c.c_float) * 2)(*(row.ctypes.data_as(c.POINTER(c.c_float)) for row in out))
        for event in events:
            event.content.header.time = event.frame - self.frame
        kept = [event.content for event in events]
        incoming = InEvents(
            None, SIZE_FN(lambda _list: len(kept)), GET_FN(lambda _list, index: c.addressof(kept[index]))
        )

        def push(_list: int, event: int) -> bool:
            note = c.cast(event, c.POINTER(NoteEvent)).contents
            if note.header.type == NOTE_END:
                self.ended.append(note.note_id)
            return True

        outgoing = OutEvents(None, PUSH_FN(push))
        audio = Audio(rows, None, 2, 0, 0)
        process = Process(
            self.frame, frames, None, None, c.pointer(audio), 0, 1, c.pointer(incoming), c.pointer(outgoing)
        )

        memory = out, rows, audio, incoming, outgoing  # which the call keeps alive

        def call() -> None:
            self.status = self._own.process(self.at, process)
            assert self.status != 0 and memory
            self.frame += frames

        return call

    def render(self, frames: int, events: Sequence[Event], block: int = 512) -> NDArray[np.float32]:
        """A piece, (frames, 2), in blocks; frames of events count from its beginning, which is now."""
        first, blocks = self.frame, []
        ordered = sorted((Event(first + each.frame, each.content) for each in events), key=lambda event: event.frame)
        while self.frame < first + frames:
            count = min(block, first + frames - self.frame)
            due = [event for event in ordered if self.frame <= event.frame < self.frame + count]
            blocks.append(self.block(count, due))
        return np.concatenate(blocks)

"""A CLAP host: loads a plug-in, sends events, takes sound. Structures are written from CLAP's documents."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.app.export.plugin.abi import filled, structure

NOTE_ON, NOTE_OFF, NOTE_CHOKE, NOTE_END, EXPRESSION, PARAM, MIDI = 0, 1, 2, 3, 4, 5, 10


Version = structure("u32 major; u32 minor; u32 revision")
Header = structure("u32 size; u32 time; u16 space; u16 type; u16 flags")
PLACE = "i32 note_id; i16 port; i16 channel; i16 key"
NoteEvent = structure(f"Header header; {PLACE}; f64 velocity", Header=Header)
ExpressionEvent = structure(f"Header header; i32 id; {PLACE}; f64 value", Header=Header)
ParamEvent = structure(f"Header header; u32 id; ptr cookie; {PLACE}; f64 value", Header=Header)
MidiEvent = structure("Header header; u16 port; u8[3] data", Header=Header)
InEvents = structure("ptr context; u32(ptr) size; ptr(ptr, u32) get")
OutEvents = structure("ptr context; bool(ptr, ptr) push")
Audio = structure("ptr data32; ptr data64; u32 channels; u32 latency; u64 constant")
Process = structure(
    "i64 steady; u32 frames; ptr transport; ptr inputs; ptr outputs; u32 inputs_count; u32 outputs_count;"
    " ptr in_events; ptr out_events"
)
Plugin = structure(
    "ptr descriptor; ptr data; bool(ptr) init; void(ptr) destroy; bool(ptr, f64, u32, u32) activate;"
    " void(ptr) deactivate; bool(ptr) start_processing; void(ptr) stop_processing; void(ptr) reset;"
    " i32(ptr, ptr) process; ptr(ptr, str) get_extension; void(ptr) on_main_thread"
)
HostStructure = structure(
    "Version version; ptr data; str name; str vendor; str url; str host_version; ptr(ptr, str) get_extension;"
    " void(ptr) request_restart; void(ptr) request_process; void(ptr) request_callback",
    Version=Version,
)
Descriptor = structure("Version version; str id; str name; str vendor", Version=Version)
Factory = structure("u32(ptr) count; ptr(ptr, u32) descriptor; ptr(ptr, ptr, str) create")
Entry = structure("Version version; bool(str) init; void() deinit; ptr(str) get_factory", Version=Version)
ParamInfo = structure(
    "u32 id; u32 flags; ptr cookie; char[256] name; char[1024] module; f64 low; f64 high; f64 standard"
)
Params = structure(
    "u32(ptr) count; bool(ptr, u32, ptr) info; bool(ptr, u32, ptr) value; bool(ptr, u32, f64, ptr, u32) to_text;"
    " bool(ptr, u32, str, ptr) from_text"
)
Stream = structure("ptr context; i64(ptr, ptr, u64) move")
State = structure("bool(ptr, ptr) save; bool(ptr, ptr) load")
Frames = structure("u32(ptr) get")
Render = structure("bool(ptr) required; bool(ptr, i32) set")
PresetLoad = structure("bool(ptr, u32, str, str) from_location")
HostParams = structure("void(ptr, u32) rescan; void(ptr, u32, u32) clear; void(ptr) request_flush")
HostPresetLoad = structure("void(ptr, u32, str, str, i32, str) on_error; void(ptr, u32, str, str) loaded")
UniversalId = structure("str abi; str id")
Receiver = structure(
    "ptr data; void(ptr, i32, str) on_error; bool(ptr, str, str) begin_preset; void(ptr, ptr) add_plugin_id;"
    " void(ptr, str) set_soundpack_id; void(ptr, u32) set_flags; void(ptr, str) add_creator;"
    " void(ptr, str) set_description; void(ptr, u64, u64) set_timestamps; void(ptr, str) add_feature;"
    " void(ptr, str, str) add_extra_info"
)
Location = structure("u32 flags; str name; u32 kind; str location")
ProviderDescriptor = structure("Version version; str id; str name; str vendor", Version=Version)
Provider = structure(
    "ptr descriptor; ptr data; bool(ptr) init; void(ptr) destroy; bool(ptr, u32, str, ptr) get_metadata;"
    " ptr(ptr, str) get_extension"
)
Indexer = structure(
    "Version version; str name; str vendor; str url; str host_version; ptr data; bool(ptr, ptr) declare_filetype;"
    " bool(ptr, ptr) declare_location; bool(ptr, ptr) declare_soundpack; ptr(ptr, str) get_extension",
    Version=Version,
)
IN_FILE, IN_PLUGIN = 0, 1  # kinds of places of presets


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

        def declare(_indexer: int, at: int) -> bool:
            place = Location.from_address(at)
            name, location = place.name.decode(), place.location and place.location.decode()
            self.locations.append((place.flags, name, place.kind, location))
            return True

        self.indexer = filled(Indexer, version=Version(1, 2, 0), name=b"tests", declare_location=declare)
        self.at = library.entry.get_factory(b"clap.preset-discovery-factory/2")
        self.factory = Factory.from_address(self.at)
        ids = (self.factory.descriptor(self.at, each) for each in range(self.factory.count(self.at)))
        self.ids = [ProviderDescriptor.from_address(each).id.decode() for each in ids]

    def create(self, id: str | None, indexer: bool = True) -> int | None:
        """A provider's address: none where there is none."""
        at = c.addressof(self.indexer) if indexer else None
        return self.factory.create(self.at, at, None if id is None else id.encode())

    def read(self, kind: int = IN_PLUGIN, most: int = 1_000, bare: bool = False) -> tuple[bool, list[Preset]]:
        """Whether the provider succeeded, and presets, up to one more than `most`; bare: only what is required."""
        found: list[Preset] = []

        def begin(_receiver: int, name: bytes, key: bytes) -> bool:
            found.append(Preset(name.decode(), key.decode()))
            return len(found) <= most

        def add_plugin(_receiver: int, at: int) -> None:
            id = UniversalId.from_address(at)
            found[-1].plugins.append((id.abi.decode(), id.id.decode()))

        optional = {
            "add_plugin_id": add_plugin,
            "set_flags": lambda _, flags: setattr(found[-1], "flags", flags),
            "set_description": lambda _, text: setattr(found[-1], "description", text.decode()),
            "add_creator": lambda _, text: found[-1].creators.append(text.decode()),
            "add_feature": lambda _, text: found[-1].features.append(text.decode()),
        }
        receiver = filled(Receiver, begin_preset=begin, **({} if bare else optional))
        at = self.create(self.ids[0])
        assert at
        own = Provider.from_address(at)
        assert own.init(at)
        assert not own.get_extension(at, b"unknown")
        done = own.get_metadata(at, kind, None, c.byref(receiver))
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
        self.library = c.CDLL(str(path))
        self.entry = Entry.in_dll(self.library, "clap_entry")
        assert self.entry.init(str(path).encode())
        self.at = self.entry.get_factory(b"clap.plugin-factory")
        self.factory = Factory.from_address(self.at)

    @property
    def plugins(self) -> dict[str, str]:
        """Names by id."""
        all_of = (self.factory.descriptor(self.at, index) for index in range(self.factory.count(self.at)))
        described = [Descriptor.from_address(each) for each in all_of]
        return {each.id.decode(): each.name.decode() for each in described}

    def create(self, id: str) -> Instance:
        self.instances.append(Instance(self, id))
        return self.instances[-1]

    def create_named(self, name: str) -> Instance:
        return self.create(next(id for id, shown in self.plugins.items() if shown == name))

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
        self._offers: dict[bytes, c.Structure] = {
            b"clap.params": filled(
                HostParams,
                rescan=lambda host, flags: self.rescans.append(flags),
                clear=lambda host, id, flags: None,
                request_flush=lambda host: None,
            ),
            b"clap.preset-load/2": filled(
                HostPresetLoad,
                on_error=lambda host, kind, location, key, code, text: self.errors.append(text.decode()),
                loaded=lambda host, kind, location, key: self.loaded.append((kind, location, key)),
            ),
        }

        def offered(_host: int, id: bytes) -> int | None:
            return c.addressof(self._offers[id]) if id in self._offers else None

        def call_back(_host: int) -> None:
            self.callbacks += 1

        texts = {"name": b"tests", "vendor": b"", "url": b"", "host_version": b"1"}
        calls = dict.fromkeys(("request_restart", "request_process"), lambda host: None)
        self._host = filled(
            HostStructure,
            version=Version(1, 2, 0),
            get_extension=offered,
            request_callback=call_back,
            **texts,
            **calls,
        )
        self.at = library.factory.create(library.at, c.addressof(self._host), id.encode())
        assert self.at, f"{id} is not in the library"
        self._own = Plugin.from_address(self.at)
        assert self._own.init(self.at)
        self.frame = 0

    def extension(self, id: str, kind: type[c.Structure]) -> c.Structure:
        at = self._own.get_extension(self.at, id.encode())
        assert at, f"no extension {id}"
        return kind.from_address(at)

    @property
    def described(self) -> list[Any]:
        """Its parameters, in the plug-in's order."""
        params = self.extension("clap.params", Params)
        found = [ParamInfo() for _ in range(params.count(self.at))]
        assert all(params.info(self.at, index, c.byref(info)) for index, info in enumerate(found))
        return found

    @property
    def parameters(self) -> dict[str, Any]:
        """By name."""
        return {info.name.decode(): info for info in self.described}

    @property
    def ids(self) -> list[int]:
        return [info.id for info in self.described]

    def value(self, id: int) -> float:
        found = c.c_double()
        assert self.extension("clap.params", Params).value(self.at, id, c.byref(found))
        return found.value

    def text(self, id: int, value: float) -> str:
        """A value in words, which lead back to it, within single precision."""
        params, found, back = self.extension("clap.params", Params), c.create_string_buffer(64), c.c_double()
        assert params.to_text(self.at, id, value, found, len(found))
        assert params.from_text(self.at, id, found.value, c.byref(back))
        assert abs(back.value - value) < 2e-6
        return found.value.decode()

    def number(self, id: int, text: bytes) -> float | None:
        """The value of a text; none where it is refused."""
        found = c.c_double()
        done = self.extension("clap.params", Params).from_text(self.at, id, text, c.byref(found))
        return found.value if done else None

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

        assert self.extension("clap.state", State).save(self.at, c.byref(filled(Stream, move=write)))
        return bytes(kept)

    def load(self, content: bytes) -> bool:
        left = [content]

        def read(_stream: int, data: int, size: int) -> int:
            part, left[0] = left[0][: min(size, 7)], left[0][min(size, 7) :]  # in small pieces, as hosts may
            c.memmove(data, part, len(part))
            return len(part)

        return bool(self.extension("clap.state", State).load(self.at, c.byref(filled(Stream, move=read))))

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
        rows = (c.c_void_p * 2)(*(row.ctypes.data for row in out))
        for event in events:
            event.content.header.time = event.frame - self.frame
        kept = [event.content for event in events]

        def push(_list: int, at: int) -> bool:
            note = NoteEvent.from_address(at)
            if note.header.type == NOTE_END:
                self.ended.append(note.note_id)
            return True

        incoming = filled(InEvents, size=lambda _: len(kept), get=lambda _, index: c.addressof(kept[index]))
        outgoing = filled(OutEvents, push=push)
        audio = Audio(c.addressof(rows), None, 2, 0, 0)
        lists = c.addressof(incoming), c.addressof(outgoing)
        process = Process(self.frame, frames, None, None, c.addressof(audio), 0, 1, *lists)
        at = c.addressof(process)
        memory = (out, rows, audio, incoming, outgoing, process)  # which the call keeps alive

        def call() -> None:
            self.status = self._own.process(self.at, at)
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

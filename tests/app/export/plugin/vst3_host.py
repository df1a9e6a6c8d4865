"""A VST3 host: loads a plug-in, sends events, takes sound. Interfaces are tables of functions, by their numbers."""

from __future__ import annotations

import ctypes as c
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.app.export.plugin.abi import structure

P, I32, U32, F64 = c.c_void_p, c.c_int32, c.c_uint32, c.c_double
OK, NO_INTERFACE = 0, -1
COMPONENT = uuid.UUID("E831FF31-F2D5-4301-928E-BBEE25697802").bytes
PROCESSOR = uuid.UUID("42043F99-B7DA-453C-A569-E79D9AAEC33D").bytes
CONTROLLER = uuid.UUID("DCD7BBE3-7742-448D-A874-AACC979C759E").bytes
MIDI_MAPPING = uuid.UUID("DF0FF9F7-49B7-4669-B63A-B7327ADBF5E5").bytes
EXPRESSIONS = uuid.UUID("B7F8F859-4123-4872-9116-95814F3721A3").bytes
FACTORY_3 = uuid.UUID("4555A2AB-C123-4E57-9B12-291036878931").bytes
NOTE_ON, NOTE_OFF, EXPRESSION = 0, 1, 4
TUNING = 2
AUDIO, EVENTS, INPUT, OUTPUT = 0, 1, 0, 1


Class3 = structure(
    "u8[16] id; i32 cardinality; char[32] category; u16[64] name; u32 flags; char[128] subcategories;"
    " u16[64] vendor; u16[64] version; u16[64] sdk"
)
Parameter = structure(
    "u32 id; u16[128] title; u16[128] short_title; u16[128] units; i32 steps; f64 standard; i32 unit; i32 flags"
)
Note = structure("i16 channel; i16 key; f32 cents; f32 velocity; i32 length; i32 id")
NoteOff = structure("i16 channel; i16 key; f32 velocity; i32 id; f32 cents")
Expressed = structure("u32 type; i32 note; f64 value")


class Content(c.Union):
    _fields_ = (("on", Note), ("off", NoteOff), ("expressed", Expressed))


Event = structure("i32 bus; i32 frame; f64 quarter; u16 flags; u16 type; Content content", Content=Content)
Setup = structure("i32 mode; i32 sample_size; i32 most_frames; f64 rate_hz")
Buffers = structure("i32 channels; u64 silence; ptr data")
Process = structure(
    "i32 mode; i32 sample_size; i32 frames; i32 inputs_count; i32 outputs_count; ptr inputs; ptr outputs;"
    " ptr changes; ptr changes_out; ptr events; ptr events_out; ptr context"
)


class Interface:
    """A pointer that a plug-in gave."""

    def __init__(self, at: int) -> None:
        self.at = at

    def call(self, number: int, kind: Any, *arguments: Any) -> Any:
        """The function of this number in its table; arguments are ctypes values."""
        table = c.cast(c.cast(self.at, c.POINTER(P))[0], c.POINTER(P))
        kinds = [P if isinstance(each, bytes | c.Array) else type(each) for each in arguments]
        return c.CFUNCTYPE(kind, P, *kinds)(table[number])(self.at, *arguments)

    def query(self, id: bytes) -> Interface | None:
        found = P()
        result = self.call(0, I32, id, c.pointer(found))
        assert (result == OK) == bool(found.value)
        return Interface(found.value) if found.value else None

    def release(self) -> int:
        return int(self.call(2, U32))


class Given:
    """An object of the host's: a table of Python functions."""

    def __init__(self, *functions: tuple[Any, Sequence[Any], Callable[..., Any]]) -> None:
        none = (I32, (), lambda: NO_INTERFACE)
        self._kept = [
            c.CFUNCTYPE(kind, P, *kinds)(_without_self(of)) for kind, kinds, of in (none, none, none, *functions)
        ]
        self._table = (P * len(self._kept))(*(c.cast(each, P).value for each in self._kept))
        self._object = P(c.addressof(self._table))
        self.at = c.addressof(self._object)


def _without_self(of: Callable[..., Any]) -> Callable[..., Any]:
    return lambda _self, *arguments: of(*arguments)


def text(units: Any) -> str:
    return "".join(map(chr, units)).partition("\0")[0]


def note_on(key: int, velocity: float, channel: int = 0, id: int = -1, cents: float = 0.0) -> Event:
    return Event(type=NOTE_ON, content=Content(on=Note(channel, key, cents, velocity / 127, 0, id)))


def note_off(key: int, channel: int = 0) -> Event:
    return Event(type=NOTE_OFF, content=Content(off=NoteOff(channel, key, 0.0, -1, 0.0)))


def tuned(id: int, semitones: float) -> Event:
    return Event(type=EXPRESSION, content=Content(expressed=Expressed(TUNING, id, 0.5 + semitones / 240)))


class Library:
    """A bundle's library."""

    def __init__(self, path: Path) -> None:
        self._library = c.CDLL(str(path))
        assert self._library.ModuleEntry(P(1))
        self._library.GetPluginFactory.restype = P
        factory = Interface(self._library.GetPluginFactory()).query(FACTORY_3)
        assert factory
        self.factory = factory

    @property
    def plugins(self) -> dict[str, bytes]:
        """Ids by name."""
        found = {}
        for index in range(self.factory.call(4, I32)):
            info = Class3()
            assert self.factory.call(8, I32, I32(index), c.pointer(info)) == OK
            assert info.category == b"Audio Module Class"
            found[text(info.name)] = bytes(info.id)
        return found

    def create(self, name: str) -> Instance:
        found = P()
        assert self.factory.call(6, I32, self.plugins[name], COMPONENT, c.pointer(found)) == OK
        return Instance(Interface(found.value or 0))


class Instance:
    """A plug-in of a library: component, processor and controller."""

    def __init__(self, component: Interface) -> None:
        parts = [component.query(id) for id in (PROCESSOR, CONTROLLER, MIDI_MAPPING, EXPRESSIONS)]
        assert all(parts)
        self.component = component
        self.processor, self.controller, self.mapping, self.expressions = parts
        assert component.call(3, I32, P()) == OK
        assert component.call(7, I32, I32(AUDIO), I32(OUTPUT)) == component.call(7, I32, I32(EVENTS), I32(INPUT)) == 1
        assert component.call(7, I32, I32(AUDIO), I32(INPUT)) == 0
        self.frame = 0
        self.moved: dict[int, float] = {}  # parameters that the plug-in has moved

    def accepts(self, rate_hz: float, most: int = 4096) -> bool:
        setup = Setup(0, 0, most, rate_hz)
        return bool(self.processor.call(7, I32, c.pointer(setup)) == OK)

    def activate(self, rate_hz: float) -> None:
        assert self.accepts(rate_hz)
        assert self.component.call(11, I32, c.c_uint8(1)) == OK
        assert self.processor.call(8, I32, c.c_uint8(1)) == OK
        self.frame = 0

    def destroy(self) -> None:
        """Checks that nothing holds it any more."""
        assert self.processor.call(8, I32, c.c_uint8(0)) == OK
        assert self.component.call(11, I32, c.c_uint8(0)) == OK
        assert self.component.call(4, I32) == OK
        for each in (self.processor, self.controller, self.mapping, self.expressions):
            assert each.release() > 0
        assert self.component.release() == 0

    @property
    def latency(self) -> int:
        return int(self.processor.call(6, U32))

    @property
    def parameters(self) -> dict[str, Parameter]:
        found = {}
        for index in range(self.controller.call(8, I32)):
            info = Parameter()
            assert self.controller.call(9, I32, I32(index), c.pointer(info)) == OK
            found[text(info.title)] = info
        return found

    def value(self, id: int) -> float:
        return float(self.controller.call(14, F64, U32(id)))

    def set_value(self, id: int, value: float) -> bool:
        """In the controller."""
        return bool(self.controller.call(15, I32, U32(id), F64(value)) == OK)

    def shown(self, id: int, value: float) -> str:
        found = (c.c_uint16 * 128)()
        assert self.controller.call(10, I32, U32(id), F64(value), found) == OK
        return text(found)

    def assigned(self, channel: int, number: int) -> int | None:
        """The parameter of a controller."""
        found = U32()
        result = self.mapping.call(3, I32, I32(0), c.c_int16(channel), c.c_int16(number), c.pointer(found))
        return found.value if result == OK else None

    def save(self) -> bytes:
        kept = bytearray()

        def write(data: int, size: int, done: Any) -> int:
            kept.extend(c.string_at(data, size))
            c.cast(done, c.POINTER(I32))[0] = size
            return OK

        stream = Given((I32, (P, I32, P), lambda *_: 1), (I32, (P, I32, P), write))
        assert self.component.call(13, I32, P(stream.at)) == OK
        return bytes(kept)

    def load(self, content: bytes) -> bool:
        """Into the component, then into the controller, as hosts do."""
        left = [content]

        def read(data: int, size: int, done: Any) -> int:
            part, left[0] = left[0][: min(size, 7)], left[0][min(size, 7) :]
            c.memmove(data, part, len(part))
            c.cast(done, c.POINTER(I32))[0] = len(part)
            return OK

        stream = Given((I32, (P, I32, P), read), (I32, (P, I32, P), lambda *_: 1))
        found = self.component.call(12, I32, P(stream.at)) == OK
        left[0] = content
        return (self.controller.call(5, I32, P(stream.at)) == OK) == found and found

    def block(
        self, frames: int, events: Sequence[tuple[int, Event]], changes: Sequence[tuple[int, int, float]] = ()
    ) -> NDArray[np.float32]:
        """The next frames, (frames, 2); events and changes (frame, id, value) are of frames of the whole piece."""
        out = np.zeros((2, frames), np.float32)
        rows = (P * 2)(*(row.ctypes.data for row in out))
        buffers = Buffers(2, 0, c.addressof(rows))

        def event(index: int, to: int) -> int:
            frame, content = events[index]
            content.frame = frame - self.frame
            c.memmove(to, c.addressof(content), c.sizeof(Event))
            return OK

        def point(change: tuple[int, int, float], frame: Any, value: Any) -> int:
            c.cast(frame, c.POINTER(I32))[0] = change[0] - self.frame
            c.cast(value, c.POINTER(F64))[0] = change[2]
            return OK

        queues = [
            Given(
                (U32, (), lambda each=each: each[1]),
                (I32, (), lambda: 1),
                (I32, (I32, P, P), lambda _index, frame, value, each=each: point(each, frame, value)),
            )
            for each in changes
        ]
        listed = Given((I32, (), lambda: len(events)), (I32, (I32, P), event))
        changed = Given((I32, (), lambda: len(queues)), (P, (I32,), lambda index: queues[index].at))
        kept: list[Given] = []

        def add(id: Any, _index: int) -> int:
            number = c.cast(id, c.POINTER(U32))[0]

            def hear(_frame: int, value: float, _index: int) -> int:
                self.moved[number] = value
                return OK

            none = (I32, (), lambda: 0)
            kept.append(Given(none, none, none, (I32, (I32, F64, P), hear)))
            return kept[-1].at

        none = (I32, (), lambda: 0)
        answered = Given(none, none, (P, (P, P), add))
        process = Process(
            0, 0, frames, 0, 1, None, c.addressof(buffers), changed.at, answered.at, listed.at, None, None
        )
        assert self.processor.call(9, I32, c.pointer(process)) == OK
        self.frame += frames
        return out.T.copy()

"""A VST3 host: loads a plug-in, sends events, takes sound. Interfaces are tables of functions, by their numbers."""

from __future__ import annotations

import ctypes as c
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.app.export.plugin.abi import Events, P, Playing, Sound, cut_off, filled, structures

I32, U32, F64 = c.c_int32, c.c_uint32, c.c_double
OK, NO_INTERFACE = 0, -1
COMPONENT = uuid.UUID("E831FF31-F2D5-4301-928E-BBEE25697802").bytes
PROCESSOR = uuid.UUID("42043F99-B7DA-453C-A569-E79D9AAEC33D").bytes
CONTROLLER = uuid.UUID("DCD7BBE3-7742-448D-A874-AACC979C759E").bytes
MIDI_MAPPING = uuid.UUID("DF0FF9F7-49B7-4669-B63A-B7327ADBF5E5").bytes
EXPRESSIONS = uuid.UUID("B7F8F859-4123-4872-9116-95814F3721A3").bytes
FACTORY_3 = uuid.UUID("4555A2AB-C123-4E57-9B12-291036878931").bytes
NOTE_ON, NOTE_OFF, EXPRESSION = 0, 1, 4
TUNING, BEND = 2, 129
AUDIO, EVENTS, INPUT, OUTPUT = 0, 1, 0, 1

vst3 = structures("vst3")


class Interface:
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
    """An object of the host's: a table of Python functions, which get the object first."""

    def __init__(self, kind: Any, **functions: Callable[..., Any]) -> None:
        unknown = dict.fromkeys(("query", "hold", "release"), lambda *_: NO_INTERFACE)
        self._table = filled(kind, **unknown, **functions)
        self._object = P(c.addressof(self._table))
        self.at = c.addressof(self._object)


def text(units: Any) -> str:
    return "".join(map(chr, units)).partition("\0")[0]


def note_on(key: int, velocity: float, channel: int = 0, id: int = -1, cents: float = 0.0) -> vst3.Event:
    return vst3.Event(type=NOTE_ON, content=vst3.Content(on=vst3.Note(channel, key, cents, velocity / 127, 0, id)))


def tuned(id: int, semitones: float) -> vst3.Event:
    expressed = vst3.Expressed(TUNING, id, 0.5 + semitones / 240)
    return vst3.Event(type=EXPRESSION, content=vst3.Content(expressed=expressed))


class Library:
    def __init__(self, path: Path) -> None:
        self._library = c.CDLL(str(path))
        assert self._library.ModuleEntry(P(1))
        self._library.GetPluginFactory.restype = P
        factory = Interface(self._library.GetPluginFactory()).query(FACTORY_3)
        assert factory
        self.factory = factory

    @property
    def plugins(self) -> dict[str, bytes]:
        found = {}
        for index in range(self.factory.call(4, I32)):
            info = vst3.Class3()
            assert self.factory.call(8, I32, I32(index), c.pointer(info)) == OK
            assert info.category == b"Audio Module Class"
            found[text(info.name)] = bytes(info.id)
        return found

    def create_named(self, name: str) -> Instance:
        found = P()
        assert self.factory.call(6, I32, self.plugins[name], COMPONENT, c.pointer(found)) == OK
        return Instance(Interface(found.value or 0))


class Instance(Playing):
    """A plug-in of a library: component, processor and controller."""

    def __init__(self, component: Interface) -> None:
        parts = [component.query(id) for id in (PROCESSOR, CONTROLLER, MIDI_MAPPING, EXPRESSIONS)]
        assert all(parts)
        self.component = component
        self.processor, self.controller, self.mapping, self.expressions = parts
        assert component.call(3, I32, P()) == OK
        assert component.call(7, I32, I32(AUDIO), I32(OUTPUT)) == component.call(7, I32, I32(EVENTS), I32(INPUT)) == 1
        assert component.call(7, I32, I32(AUDIO), I32(INPUT)) == 0
        self.moved: dict[int, float] = {}  # parameters that the plug-in has moved

    def accepts(self, rate_hz: float, most: int = 4096) -> bool:
        setup = vst3.Setup(0, 0, most, rate_hz)
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
    def parameters(self) -> dict[str, vst3.Parameter]:
        found = {}
        for index in range(self.controller.call(8, I32)):
            info = vst3.Parameter()
            assert self.controller.call(9, I32, I32(index), c.pointer(info)) == OK
            found[text(info.title)] = info
        return found

    def value(self, id: int) -> float:
        return float(self.controller.call(14, F64, U32(id)))

    def set_value(self, id: int, value: float) -> bool:
        return bool(self.controller.call(15, I32, U32(id), F64(value)) == OK)

    def shown(self, id: int, value: float) -> str:
        found = (c.c_uint16 * 128)()
        assert self.controller.call(10, I32, U32(id), F64(value), found) == OK
        return text(found)

    def assigned(self, channel: int, number: int) -> int | None:
        found = U32()
        result = self.mapping.call(3, I32, I32(0), c.c_int16(channel), c.c_int16(number), c.pointer(found))
        return found.value if result == OK else None

    def save(self) -> bytes:
        kept = bytearray()

        def write(_stream: int, data: int, size: int, done: int) -> int:
            kept.extend(c.string_at(data, size))
            I32.from_address(done).value = size
            return OK

        stream = Given(vst3.Stream, write=write)
        assert self.component.call(13, I32, P(stream.at)) == OK
        return bytes(kept)

    def load(self, content: bytes) -> bool:
        """Into the component, then into the controller, as hosts do."""
        left = [content]

        def read(_stream: int, data: int, size: int, done: int) -> int:
            part = cut_off(left, size)
            c.memmove(data, part, len(part))
            I32.from_address(done).value = len(part)
            return OK

        stream = Given(vst3.Stream, read=read)
        found = self.component.call(12, I32, P(stream.at)) == OK
        left[0] = content
        return (self.controller.call(5, I32, P(stream.at)) == OK) == found and found

    def _of_midi(self, kind: int, first: int, second: int) -> vst3.Event | tuple[int, float]:
        """Notes as events; other messages as the change of a parameter, its identifier and its value."""
        channel = kind & 15
        if kind & 0xF0 == 0x90:
            return note_on(first, second, channel)
        if kind & 0xF0 == 0x80:
            return vst3.Event(type=NOTE_OFF, content=vst3.Content(off=vst3.NoteOff(channel, first, 0.0, -1, 0.0)))
        if kind & 0xF0 == 0xE0:
            return self.assigned(channel, BEND) or 0, (first + 128 * second) / 16383
        return self.assigned(channel, first) or 0, second / 127

    def block(self, frames: int, events: Events) -> Sound:
        out = np.zeros((2, frames), np.float32)
        rows = (P * 2)(*(row.ctypes.data for row in out))
        buffers = vst3.Buffers(2, 0, c.addressof(rows))
        due = [(at, self._of_midi(*what) if isinstance(what, bytes) else what) for at, what in events]
        notes = [(at, what) for at, what in due if isinstance(what, vst3.Event)]

        def event(_list: int, index: int, to: int) -> int:
            notes[index][1].frame = notes[index][0]
            c.memmove(to, c.addressof(notes[index][1]), c.sizeof(vst3.Event))
            return OK

        def queue(at: int, id: int, value: float) -> Given:
            def point(_queue: int, _index: int, frame: int, to: int) -> int:
                I32.from_address(frame).value, F64.from_address(to).value = at, value
                return OK

            return Given(vst3.Queue, id=lambda _: id, count=lambda _: 1, point=point)

        def moved(_changes: int, id: int, _index: int) -> int:
            number = U32.from_address(id).value

            def hear(_queue: int, _frame: int, value: float, _index: int) -> int:
                self.moved[number] = value
                return OK

            kept.append(Given(vst3.Queue, add=hear))
            return kept[-1].at

        kept = list[Given]()
        queues = [queue(at, *what) for at, what in due if not isinstance(what, vst3.Event)]
        listed = Given(vst3.EventList, count=lambda _: len(notes), event=event)
        changed = Given(vst3.Changes, count=lambda _: len(queues), queue=lambda _, index: queues[index].at)
        answered = Given(vst3.Changes, add=moved)
        lists = changed.at, answered.at, listed.at
        process = vst3.Process(0, 0, frames, 0, 1, None, c.addressof(buffers), *lists, None, None)
        assert self.processor.call(9, I32, c.pointer(process)) == OK
        self.frame += frames
        return out.T.copy()

"""An LV2 host: loads a bundle, connects its ports, sends MIDI, takes sound, keeps state; from LV2's documents."""

import ctypes as c
import struct
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

import numpy as np

from app.export.plugin.image import Control
from tests.app.export.plugin.abi import Events, P, Playing, Sound, filled, function, structures

MAP = "http://lv2plug.in/ns/ext/urid#map"
CHUNK, STATE = "http://lv2plug.in/ns/ext/atom#Chunk", "http://lv2plug.in/ns/ext/state#interface"
POD, PORTABLE = 1, 2
EVENTS, LEFT, RIGHT, LATENCY, FIRST = range(5)
State = dict[str, bytes]  # a property's value by its key; each is a chunk

lv2 = structures("lv2")


Store = function("i32", "ptr", "u32", "ptr", "size", "u32", "u32")
Retrieve = function("ptr", "ptr", "u32", "ptr", "ptr", "ptr")


class Refused(Exception):
    """The plug-in makes no instance."""


class Instance(Playing):
    """A plug-in of a bundle, to be activated; `values` are its control ports."""

    latency = 96

    def __init__(self, bundle: Path, id: str, controls: Sequence[Control], rate_hz: float) -> None:
        (binary,) = bundle.glob("*.so")
        find = c.CDLL(str(binary)).lv2_descriptor
        find.restype = P
        described = map(lv2.Descriptor.from_address, takewhile(bool, map(find, range(1000))))
        self._own = next(each for each in described if each.uri == f"urn:{id}".encode())
        self._uris = list[bytes]()

        def number(_handle: int, uri: bytes) -> int:
            if uri not in self._uris:
                self._uris.append(uri)
            return 1 + self._uris.index(uri)

        self._map = filled(lv2.UridMap, map=number)
        self._feature = lv2.Feature(MAP.encode(), c.addressof(self._map))
        features = (P * 2)(c.addressof(self._feature), None)
        self._midi = number(0, b"http://lv2plug.in/ns/ext/midi#MidiEvent")
        self._chunk = number(0, CHUNK.encode())
        self._at = self._own.instantiate(c.addressof(self._own), rate_hz, str(bundle).encode(), features)
        if not self._at:
            raise Refused
        self.controls = {each.id: each for each in controls}
        self.values = np.array([each.standard for each in controls], np.float32)
        self._latency = np.zeros(1, np.float32)
        for place in range(len(controls)):
            self._connect(FIRST + place, self.values[place:])
        self._connect(LATENCY, self._latency)

    def _connect(self, port: int, memory: np.ndarray) -> None:
        self._own.connect_port(self._at, port, memory.ctypes.data)

    def move(self, id: str, value: float) -> None:
        """A port, and a block."""
        self.values[[*self.controls].index(id)] = value
        self.block(64, [])

    def activate(self) -> None:
        self._own.activate(self._at)

    def activate_again(self) -> None:
        self._own.deactivate(self._at)
        self.activate()

    def save(self) -> State:
        """Without the values of ports, which hosts save themselves."""
        state = State()

        def store(_handle: int, key: int, value: int, size: int, kind: int, flags: int) -> int:
            assert (kind, flags) == (self._chunk, POD | PORTABLE)
            state[self._uris[key - 1].decode()] = c.string_at(value, size)
            return 0

        assert self._state.save(self._at, c.cast(Store(store), P), None, POD | PORTABLE, None) == 0
        return state

    def restore(self, state: State, kind: str = CHUNK) -> bool:
        kept = {key: c.create_string_buffer(value, len(value)) for key, value in state.items()}
        known = self._map.map(None, kind.encode())

        def retrieve(_handle: int, key: int, size: int, found: int, flags: int) -> int | None:
            value = kept.get(self._uris[key - 1].decode())
            if value is None:
                return None
            c.c_size_t.from_address(size).value = len(value)
            c.c_uint32.from_address(found).value = known
            c.c_uint32.from_address(flags).value = POD | PORTABLE
            return c.addressof(value)

        return self._state.restore(self._at, c.cast(Retrieve(retrieve), P), None, 0, None) == 0

    @property
    def _state(self) -> lv2.StateInterface:
        at = self._own.extension_data(STATE.encode())
        assert at, "no state"
        return lv2.StateInterface.from_address(at)

    def block(self, frames: int, events: Events) -> Sound:
        body = b"".join(struct.pack("<qII3s5x", at, 3, self._midi, data) for at, data in events)
        sequence = c.create_string_buffer(struct.pack("<IIII", 8 + len(body), 0, 0, 0) + body)
        out = np.zeros((2, frames), np.float32)
        self._own.connect_port(self._at, EVENTS, c.addressof(sequence))
        self._connect(LEFT, out[0])
        self._connect(RIGHT, out[1])
        self._own.run(self._at, frames)
        assert self._latency[0] == self.latency
        self.frame += frames
        return out.T.copy()

    def destroy(self) -> None:
        self._own.deactivate(self._at)
        self._own.cleanup(self._at)

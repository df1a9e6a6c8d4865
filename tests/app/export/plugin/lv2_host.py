"""An LV2 host: loads a bundle, connects its ports, sends MIDI, takes sound. Written from LV2's documents."""

from __future__ import annotations

import ctypes as c
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.export.plugin.image import Control

P = c.c_void_p
MAP = "http://lv2plug.in/ns/ext/urid#map"
EVENTS, LEFT, RIGHT, LATENCY, FIRST = range(5)


class Descriptor(c.Structure):
    _fields_ = (
        ("uri", c.c_char_p),
        ("instantiate", c.CFUNCTYPE(P, P, c.c_double, c.c_char_p, P)),
        ("connect_port", c.CFUNCTYPE(None, P, c.c_uint32, P)),
        ("activate", c.CFUNCTYPE(None, P)),
        ("run", c.CFUNCTYPE(None, P, c.c_uint32)),
        ("deactivate", c.CFUNCTYPE(None, P)),
        ("cleanup", c.CFUNCTYPE(None, P)),
        ("extension_data", c.CFUNCTYPE(P, c.c_char_p)),
    )


MAP_FN = c.CFUNCTYPE(c.c_uint32, P, c.c_char_p)


class UridMap(c.Structure):
    _fields_ = (("handle", P), ("map", MAP_FN))


class Feature(c.Structure):
    _fields_ = (("uri", c.c_char_p), ("data", P))


class Instance:
    """A plug-in of a bundle; `values` are its control ports, in the order of `controls`."""

    def __init__(self, bundle: Path, id: str, controls: Sequence[Control], rate_hz: int) -> None:
        (binary,) = bundle.glob("*.so")
        find = c.CDLL(str(binary)).lv2_descriptor
        find.restype = c.POINTER(Descriptor)
        found = {each.contents.uri: each for each in iter(map(find, range(1000)).__next__, None) if each}
        self._own = found[f"urn:{id}".encode()].contents
        uris = list[bytes]()

        def number(_handle: int, uri: bytes) -> int:
            if uri not in uris:
                uris.append(uri)
            return 1 + uris.index(uri)

        self._map = UridMap(None, MAP_FN(number))
        self._feature = Feature(MAP.encode(), c.addressof(self._map))
        features = (P * 2)(c.addressof(self._feature), None)
        self._midi = number(0, b"http://lv2plug.in/ns/ext/midi#MidiEvent")
        self._at = self._own.instantiate(c.addressof(self._own), rate_hz, str(bundle).encode(), features)
        assert self._at
        self.values = np.array([each.standard for each in controls], np.float32)
        self._latency = np.zeros(1, np.float32)
        for place in range(len(controls)):
            self._own.connect_port(self._at, FIRST + place, self.values[place:].ctypes.data)
        self._own.connect_port(self._at, LATENCY, self._latency.ctypes.data)
        self._own.activate(self._at)

    def activate_again(self) -> None:
        self._own.deactivate(self._at)
        self._own.activate(self._at)

    def render(self, frames: int, messages: Sequence[tuple[int, bytes]], block: int = 512) -> NDArray[np.float32]:
        """(frames, 2), without the latency; `messages` are pairs of a frame, in order, and three bytes of MIDI."""
        parts, done, total = [], 0, frames + 96
        while done < total:
            count = min(block, total - done)
            due = [each for each in messages if done <= each[0] < done + count]
            body = b"".join(struct.pack("<qII3s5x", at - done, 3, self._midi, data) for at, data in due)
            events = c.create_string_buffer(struct.pack("<IIII", 8 + len(body), 0, 0, 0) + body)
            out = np.zeros((2, count), np.float32)
            self._own.connect_port(self._at, EVENTS, c.addressof(events))
            self._own.connect_port(self._at, LEFT, out[0].ctypes.data)
            self._own.connect_port(self._at, RIGHT, out[1].ctypes.data)
            self._own.run(self._at, count)
            parts.append(out.T)
            done += count
        assert self._latency[0] == 96
        return np.concatenate(parts)[96:]

    def destroy(self) -> None:
        self._own.deactivate(self._at)
        self._own.cleanup(self._at)

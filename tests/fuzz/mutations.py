"""Damaged files: bytes changed at random, texts with wrong values; and the time and memory to read them."""

import copy
import json
import random
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from app.shared.heap import return_free_pages
from engine.presets.file import METADATA_KEY

HOSTILE: tuple[Any, ...] = (
    None, True, "", "x" * 20_000, "../../escape", "/etc/passwd", "\x1b]0;owned\x07\r\n", "<img src=x>", "\u202e\x00",
    0, -1, 1, 2, 3, 97, 10**9, -(10**9), 2**31, 2**63, 2**64, 10**400, 0.5, -0.0, 1e-320, 1e300, -1e300,
    float("nan"), float("inf"), [], {}, [[]], [1] * 5_000, [10**9], {"a": {"b": {}}}, ["a", 1, None],
)  # fmt: skip


def damaged_bytes(data: bytes, draw: random.Random) -> bytes:
    """Cut, lengthened, overwritten, swapped or doubled at a few places, most of them near the beginning."""
    if draw.random() < 0.05:
        return draw.randbytes(draw.choice((0, 7, 400)))
    changed = bytearray(data)
    for _ in range(draw.choice((1, 1, 2, 8))):
        size = max(1, len(changed))
        place = min(size - 1, int(size * draw.random() ** draw.choice((1, 4, 8))))
        kind = draw.randrange(6)
        if kind == 0:
            del changed[place:]
        elif kind == 1:
            changed[place : place + 1] = draw.randbytes(draw.choice((1, 4, 64)))
        elif kind == 2 and changed:
            changed[place] ^= 1 << draw.randrange(8)
        elif kind == 3:
            del changed[place : place + draw.choice((1, 8, 100))]
        elif kind == 4:
            changed[place:place] = changed[place : place + draw.choice((1, 8, 100))]
        else:
            changed[place : place + 8] = struct.pack("<Q", draw.choice((0, 1, 2**31, 2**40, 2**63, 2**64 - 1)))
    return bytes(changed)


def damaged_value(value: Any, draw: random.Random) -> Any:
    """Plain data with a few of its values, fields or lengths changed."""
    whole = {"": json.loads(json.dumps(value))}
    for _ in range(draw.choice((1, 1, 1, 2, 4))):
        holders: list[Any] = [whole]
        for holder in holders:
            inner = holder.values() if isinstance(holder, dict) else holder
            holders += [each for each in inner if isinstance(each, dict | list) and each]
        holder = draw.choice(holders)
        key = draw.choice(list(holder)) if isinstance(holder, dict) else draw.randrange(len(holder))
        kind = draw.randrange(5)
        if kind == 0 and len(holder) > 1:
            del holder[key]
        elif kind == 1 and isinstance(holder, dict) and holder is not whole:
            holder[draw.choice(("colour", "depth", "\x1b[2J", "y" * 5_000))] = copy.deepcopy(draw.choice(HOSTILE))
        elif kind == 2 and isinstance(holder[key], int | float) and not isinstance(holder[key], bool):
            holder[key] = min(holder[key], 1e18) * draw.choice((-1, 0, 2, 10, 1e3, 1e6, 10**9, 1e-9))
        elif kind == 3:
            depth = draw.choice((3, 40, 400))
            holder[key] = json.loads("[" * depth + "]" * depth)
        else:
            holder[key] = copy.deepcopy(draw.choice(HOSTILE))  # the next change may be within it
    return whole[""]


def damaged_text(value: Any, draw: random.Random) -> str:
    """The JSON of damaged data; now and then what no data make."""
    text = json.dumps(damaged_value(value, draw))
    kind = draw.randrange(12)
    if kind == 2:
        return text[: draw.randrange(len(text) + 1)]
    old, new = {0: (": ", ": " + "[" * draw.choice((100, 2_000))), 1: ("1", "7" * 5_000)}.get(kind, ("", ""))
    return text.replace(old, new, 1)


def damaged_preset(data: bytes, draw: random.Random) -> bytes:
    """Of its bytes, of its header, or of what it says of itself."""
    if draw.random() < 0.4:
        return damaged_bytes(data, draw)
    (length,) = struct.unpack_from("<Q", data)
    header, weights = json.loads(data[8 : 8 + length]), bytearray(data[8 + length :])
    kind = draw.randrange(8)
    if kind == 0:
        header = damaged_value(header, draw)
    elif kind == 1 and weights:  # weights that are numbers still, or not
        for _ in range(draw.choice((1, 100))):
            place, value = 4 * draw.randrange(len(weights) // 4), draw.choice((0, 1e30, -1e3, 1e-40))
            struct.pack_into("<f", weights, place, value)
    else:
        text = header["__metadata__"][METADATA_KEY]
        header["__metadata__"][METADATA_KEY] = damaged_text(json.loads(text), draw)
    written = json.dumps(header).encode()
    return struct.pack("<Q", len(written)) + written + bytes(weights)


MOST_MB = 200  # for any file, refused or not
PEAK = Path("/proc/self/clear_refs")  # 5, written to it, forgets the largest size that the process ever had


@dataclass
class Costs:
    """The slowest and the largest reading so far; its size stays 0 where the system does not report it."""

    slowest_s: float = 0.0
    largest_mb: float = 0.0

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Around nothing but the reading. Processor seconds are of all threads, and load hardly moves them."""
        return_free_pages()
        if PEAK.exists():
            PEAK.write_text("5")
        before, begun_s = psutil.Process().memory_info().rss, time.process_time()
        try:
            yield
        finally:
            self.slowest_s = max(self.slowest_s, time.process_time() - begun_s)
            if PEAK.exists():
                lines = Path("/proc/self/status").read_text().splitlines()
                largest = 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
                self.largest_mb = max(self.largest_mb, (largest - before) / 1e6)

    def __str__(self) -> str:
        return f"the slowest reading {self.slowest_s:.2f} s of processor, the largest {self.largest_mb:.0f} MB"


def attacked(
    name: str, rounds: int, seed: int, attack: Callable[[random.Random], None], costs: Costs | None = None
) -> None:
    """Run an attack so often, each from a seed of its own; costs are printed, and memory is held to `MOST_MB`."""
    failures = []
    for number in range(rounds):
        try:
            attack(random.Random(f"{seed}:{name}:{number}"))
        except Exception as error:
            failures.append(f"{name} {seed}:{number}: {type(error).__name__}: {error}"[:600])
    reported = f"; {costs}" if costs else ""
    print(f"\n{name}: refused or harmless {rounds - len(failures)} of {rounds} (seed {seed}){reported}")
    assert not failures, "\n".join(failures[:20])
    assert costs is None or costs.largest_mb <= MOST_MB, f"{name}: {costs}"

"""The memory that kernels read and write, as the objects that own it have it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.kernels.fields import slot
from engine.kernels.memory import publish

Number = TypeVar("Number", int, float)


class KernelMemory:
    """An owner of memory that kernels know by its address; its beginning is a record as `layout` has it."""

    layout: ClassVar[np.dtype[np.void]]
    memory: NDArray[np.float64]

    @property
    def address(self) -> int:
        return int(self.memory.ctypes.data)

    def publish(self, field: str, whole: int) -> None:
        """Write a whole number after all that was written before."""
        publish(self.memory.view(np.int64), slot(self.layout, field), whole)


class Reading(Generic[Number]):
    """A number of its owner's record, as an attribute that is read."""

    def __init__(self, number: type[Number], field: str) -> None:
        self.number: Callable[[Any], Number] = number
        self.field = field

    def __get__(self, owner: Any, _: type) -> Number:
        return self.number(owner.record[self.field])

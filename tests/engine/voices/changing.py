"""A voice whose string Python changes as it rings, as the compiled player changes those of its notes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.kernels.constants import QUANTUM
from engine.kernels.fields import record_of, slot, slots
from engine.kernels.memory import publish
from engine.kernels.voice_records import VOICE, WISH
from engine.resonators.base import Resonator
from engine.values.ear import Ear
from engine.voices import Program, Voice
from engine.voices.voice import resonator_rows

Array = NDArray[np.float64]


class ChangingVoice(Voice):
    """A pluck of a program that never ends; `begin`: the rows that it sets out from, as of `Program.start`."""

    def __init__(
        self, program: Program, displacement_m: Array, ear: Ear, begin: tuple[Array, Array] | None = None
    ) -> None:
        if begin is not None:
            program = replace(program, start=lambda _: begin)
        super().__init__(program, displacement_m, ear)
        self.never_ends()
        self._blocks: list[Array] = []  # of modes, which the kernel may be reading
        self._before: ChangingVoice | None = None

    def retune(self, resonator: Resonator, seconds: float = 0.005, frame: int = 0) -> None:
        """Other modes while it rings, as a tension, a length or a damping that changes: it gets there evenly.

        Amplitude and speed of each mode continue. Any one thread; the latest wish counts.

        Args:
            frame: of the mixer, from which they count, within a quantum; they wait for those wished for before.
        """
        block = np.concatenate([np.zeros(slots(WISH)), resonator_rows(resonator).ravel()])
        own = record_of(block, WISH)
        own["quanta"], own["at"] = max(1, round(seconds * self.program.rate_hz / QUANTUM)), frame
        taken = int(self.record["current_modes"])
        for place, each in enumerate(self._blocks):
            if int(each.ctypes.data) == taken:
                del self._blocks[:place]
                break
        if self._blocks:
            publish(self._blocks[-1].view(np.int64), slot(WISH, "next"), block.ctypes.data)
        else:
            publish(self.memory.view(np.int64), slot(VOICE, "pending_modes"), block.ctypes.data)
        self._blocks.append(block)

    def continues(self, before: ChangingVoice) -> None:
        """Before it is handed over: it is the same string, plucked again while `before` rings on.

        Its displacement is added to the motion as it begins, and it fades in as `before` fades out.
        """
        if before.record["previous_voice"] == 0:
            before._before = None
        self._before = before  # in memory until this one has begun
        self.record["previous_voice"] = before.address

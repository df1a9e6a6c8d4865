"""The settings beside Record: count-in and metronome."""

from __future__ import annotations

from pydantic import Field

from app.instrument.events import Meter


class RecordChoices(Meter):
    """The settings of the next take.

    Attributes:
        metronome: whether it clicks while it is recorded.
    """

    count_in_bars: int = Field(0, ge=0, le=2)
    metronome: bool = False

    @property
    def meter(self) -> Meter | None:
        """The meter of the recording; None: it is not counted."""
        counted = self.metronome or self.count_in_bars > 0
        return Meter(tempo_bpm=self.tempo_bpm, beats=self.beats) if counted else None

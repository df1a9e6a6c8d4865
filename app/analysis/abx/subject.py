"""The subject of a test: the sources that can be A or B, and the pluck that they share."""

from __future__ import annotations

from dataclasses import dataclass

from app.analysis.abx.record import HeardPluck
from app.analysis.abx.sound import Candidate
from app.presets.library import PresetEntry
from app.session.choices import Choices
from engine.presets import preset_digest


@dataclass(frozen=True)
class Subject:
    """See the module.

    Attributes:
        candidates: two or more; the first two are A and B until others are chosen.
        volume_db: of the playback, which stays the same during the test.
    """

    candidates: tuple[Candidate, ...]
    pluck: HeardPluck
    volume_db: float


def subject_of(entry: PresetEntry, choices: Choices) -> Subject:
    """Model and truth of a preset, plucked and heard as chosen.

    Raises:
        PresetError: its file cannot be read.
    """
    digest = preset_digest(entry.path)
    pluck = HeardPluck(
        position=choices.position,
        amplitude_mm=choices.amplitude_mm,
        shape=choices.shape,
        width=choices.width,
        listen=choices.listen,
        listen_right=choices.listen_right if choices.stereo else None,
        pickup=choices.pickup,
        solo=choices.solo,
        seconds=choices.seconds,
        string=choices.string,
    )
    candidates = tuple(Candidate(source, source.capitalize(), entry.name, digest) for source in ("model", "truth"))
    return Subject(candidates, pluck, choices.volume_db)

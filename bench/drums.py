"""Drums: frequencies and pitch drops compared with published ones; costs of voices and kits, and of choosing one."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.commands.drums import drum_of, mode_rows
from app.instruments.drums import Drums
from app.instruments.instrument import Instrument
from app.instruments.library import SHIPPED as FACTORY
from app.instruments.library import read_instrument
from app.player.compiled import InstrumentPlayer
from app.player.drum_keys import DrumKeys, tuned
from app.player.events import NoteOn
from bench.machine import RATE_HZ, Shares, shares, times_s
from engine.presets import SHIPPED, load_preset
from engine.resonators import surface
from engine.values.drum import Mallet
from engine.values.ear import Ear
from engine.voices import Mixer
from training.cli.console import ProgressReport

VELOCITY = 110
INSTRUMENTS = ("concert_toms", "tuned_toms", "frame_drum", "conga", "timpani", "soft_plate", "thin_bars")
# A tom: Rossing, Science of Percussion Instruments (2000), 26, as J. Hsu's code quotes it (percussionSynthesis,
# tomtoms.m): 142 Hz and ratios; which mode is which is our reading. Its size is not quoted; (1,1) sets the tension.
# A timpani head: Christian et al., JASA 76 (1984), 1336, from memory.
TOM_MODES = [(1, 1), (0, 1), (2, 1), (0, 2), (3, 1), (1, 2), (4, 1)]
TOM_RATIOS = [2.15, 1, 3.17, 3.42, 4.09, 4.80, 4.94]
MEASURED_HZ: dict[str, dict[tuple[int, int], float]] = {
    "tom_12": {mode: 142 * ratio for mode, ratio in zip(TOM_MODES, TOM_RATIOS, strict=True)},
    "timpani_head_26": {(0, 1): 82, (1, 1): 155, (2, 1): 229, (3, 1): 297, (4, 1): 366, (5, 1): 431},
}
DRUM_FILES, MODES_COMPARED = Path(__file__).parents[1] / "presets" / "drums", 40
# Drops of hard blows in percent. Toms: "almost 8 %" of one of 14 inches (Gärder, Chalmers thesis 2005:23, C.4.3), 160
# cents of one of 32 cm (Bork, PTB 1983, by Fletcher and Rossing, 18.4), both as CWBudde/algo-drum quotes them
# (docs/paper/references.bib). A kick drum: "around 10 percent" (Reid, Sound on Sound, January 2002).
PUBLISHED_DROPS = {"Tom": (8.0, 9.7), "Floor tom": (8.0, 9.7), "Bass drum": (9.0, 11.0)}
SIZES = (400, 800, 1500)  # modes
HARD = Mallet(mass_kg=0.015, radius_m=0.002, contact_s=0.0005)  # so that all modes move
STRINGS, STRING_INSTRUMENT = (40, 45, 50, 55, 59, 64, 67, 71), "classical_guitar"


@dataclass(frozen=True)
class MeasuredMode:
    """A frequency of a drum in air, and a published measurement."""

    drum: str
    mode: str
    measured_hz: float
    computed_hz: float

    @property
    def error_percent(self) -> float:
        return 100 * (self.computed_hz / self.measured_hz - 1)


@dataclass(frozen=True)
class PitchDrop:
    """The drop of the hardest blow on a drum of the kit, from its first half-period on, and the published range."""

    drum: str
    drop_percent: float
    lowest_percent: float
    highest_percent: float


@dataclass(frozen=True)
class DrumCost:
    """The cost of notes that begin together."""

    what: str
    voices: int
    share: Shares


@dataclass(frozen=True)
class ChoiceCost:
    """The processor time of an instrument's first choice: modes, radiation and gains of all its keys."""

    instrument: str
    keys: int
    choice_s: float


def measure(report: ProgressReport) -> dict[str, Any]:
    """Measure drums of several sizes, struck by a stick and by something small and hard, and kits."""
    costs: list[DrumCost] = []
    kit, guitar = (read_instrument(FACTORY / f"{name}.json") for name in ("concert_toms", STRING_INSTRUMENT))
    pads = [drum.note for drum in _drums(kit).drums]
    for number, size in enumerate(SIZES):
        report(number / (len(SIZES) + 1), f"{size} modes")
        instrument = _of_size(size)
        costs.append(_cost(f"{size} modes, a stick", (instrument, (47,))))
        costs.append(_cost(f"{size} modes, small and hard", (_with_mallet(instrument), (47,))))
    report(len(SIZES) / (len(SIZES) + 1), "kit")
    costs.append(_cost("kit", (kit, pads)))
    costs.append(_cost("kit and strings", (kit, pads), (guitar, STRINGS)))
    choices = tuple(_choice(name) for name in INSTRUMENTS)
    return {"modes": measured_modes(), "drops": _drops(kit), "costs": tuple(costs), "choices": choices}


def measured_modes() -> tuple[MeasuredMode, ...]:
    """Modes of drums whose frequencies are published."""
    found = []
    for name, measured in MEASURED_HZ.items():
        modes = drum_of(str(DRUM_FILES / f"{name}.toml"), None)[1].modes
        rows = reversed([*mode_rows(modes, MODES_COMPARED)])
        computed = {(row["m"], row["n"]): row["hz"] for row in rows}  # of a pair the lower
        found += [MeasuredMode(name, f"({m},{n})", hz, computed[m, n]) for (m, n), hz in measured.items()]
    return tuple(found)


def _drops(kit: Instrument) -> tuple[PitchDrop, ...]:
    keys, found = DrumKeys(kit, Ear((0.5,))), []
    for drum in _drums(kit).drums:
        key = keys.of_key(drum.note)
        published = next((drops for name, drops in PUBLISHED_DROPS.items() if drum.name.startswith(name)), None)
        if key is not None and published is not None:
            cents = key.drop_cents(127, kit.pluck.curve)
            found.append(PitchDrop(drum.name, 100 * (2 ** (cents / 1200) - 1), *published))
    return tuple(found)


def _choice(name: str) -> ChoiceCost:
    instrument = read_instrument(FACTORY / f"{name}.json")
    low, high = instrument.range

    def choose() -> int:
        tuned.cache_clear()
        surface.modes_below.cache_clear()
        surface.air_below.cache_clear()
        keys = DrumKeys(instrument, Ear((0.4, 0.6)))
        return sum(keys.of_key(key) is not None for key in range(low, high + 1))

    return ChoiceCost(name, choose(), min(times_s(choose, 2, time.process_time)))


def _cost(what: str, *played: tuple[Instrument, Sequence[int]]) -> DrumCost:
    """The cost of all these keys of each instrument."""

    def struck() -> list[Mixer]:
        mixers = []
        for instrument, keys in played:
            mixer, preset = Mixer(RATE_HZ), load_preset(SHIPPED / f"{instrument.preset}.safetensors")
            player = InstrumentPlayer(instrument, preset, RATE_HZ, {"model": 1.0})
            mixer.set_player(player.compiled)
            for key in keys:
                player.handle(NoteOn(key, VELOCITY))
            mixers.append(mixer)
        return mixers

    return DrumCost(what, sum(len(keys) for _, keys in played), shares(struck))


def _drums(instrument: Instrument) -> Drums:
    assert isinstance(instrument.strings, Drums)
    return instrument.strings


def _of_size(modes: int) -> Instrument:
    """The tom whose modes below a frequency are so many, about."""
    instrument = read_instrument(FACTORY / "tuned_toms.json")
    low, high = 1_000.0, 19_000.0
    for _ in range(8):
        middle = (low + high) / 2
        found = DrumKeys(_below(instrument, middle), Ear((0.5,))).of_key(47)
        assert found is not None
        low, high = (middle, high) if len(found.modes) < modes else (low, middle)
    return _below(instrument, high)


def _below(instrument: Instrument, highest_hz: float) -> Instrument:
    return instrument.model_copy(update={"strings": _drums(instrument).model_copy(update={"highest_hz": highest_hz})})


def _with_mallet(instrument: Instrument) -> Instrument:
    drum = _drums(instrument).drums[0].model_copy(update={"mallet": HARD})
    return instrument.model_copy(update={"strings": _drums(instrument).model_copy(update={"drums": (drum,)})})

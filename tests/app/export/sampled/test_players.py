"""Samplers play what was exported: pitch, level, damping and ringing are the instrument's, in every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.export.sampled.job import export_sampled, note_renderer
from app.export.sampled.plan import SampledPlan
from app.export.sampled.sf2 import release_timecents
from app.export.sampled.sfz import release_s
from app.instruments.instrument import BodyChoice
from app.instruments.library import find_instrument
from app.shared.parameters import OF_INSTRUMENTS
from engine.presets import find_preset, load_preset
from engine.values.effects import Amp, Room
from tests.app.export.sampled import conftest as players
from tests.app.export.sampled.conftest import PLAYERS, RATE_HZ, STEREO, cents, instrument_of, level_db, render, small

SECONDS = {"sfz": 0.17, "sf2": 1.0}  # of a sample: sfizz has the former in memory at once
PARTS = {"sfz": slice(0, 5_760), "sf2": slice(2_400, 20_000)}  # of a sound that are compared
OWN_DB = {"sfz": -11.5, "sf2": 1.4}  # of the player itself
LOUD = {"level_db": 20.0, "pluck": {"softest_mm": 1.0, "hardest_mm": 10.0}}
NOTES = [(58, 127), (58, 1), (59, 20), (60, 42), (60, 43), (61, 84), (61, 100)]


@pytest.mark.parametrize(
    ("kind", "fields", "choices", "spread_db"),
    [
        ("sfz", {"pickup": STEREO, "pluck": {"curve": 0.4}, "level_db": -6.0}, {}, 0.4),
        ("sfz", LOUD, {"every": 3}, 0.4),  # keys between are transposed; all is lowered
        ("sf2", {"pickup": STEREO}, {}, 0.4),
        ("sf2", {"pickup": {"points": (0.2,)}}, {}, 0.4),
        ("sf2", {"pluck": {"curve": 0.2}}, {}, 3.0),  # in a layer, dB over velocity are a straight line
    ],
)
def test_it_sounds_as_the_instrument_in_pitch_and_level(
    kind: str, fields: dict, choices: dict, spread_db: float, tmp_path: Path
) -> None:
    instrument, out, offsets = instrument_of(**fields), tmp_path / f"a.{kind}", []
    seconds, part = SECONDS[kind], PARTS[kind]
    gain_db = export_sampled(small(instrument, seconds=seconds, **choices), out, render).gain_db
    for key, velocity in NOTES:
        heard = PLAYERS[kind](out, [(0, key, velocity)], part.stop / RATE_HZ)
        direct = render(instrument, key, velocity, seconds, seconds, RATE_HZ)[part]
        off = abs(cents(direct[:, 0], players.hz_of(key)))
        assert abs(cents(heard[0, part], players.hz_of(key))) < (1 if choices else 0.1 + off)
        for side, own in zip(heard, (direct[:, 0], direct[:, -1]), strict=True):
            offsets.append(level_db(side[part]) - level_db(own) - gain_db)
    assert np.ptp(offsets) < spread_db  # one level for all: the player's own
    pan_db = -3.01 if kind == "sf2" and fields.get("pickup") != STEREO else 0.0
    assert np.mean(offsets) - pan_db == pytest.approx(OWN_DB[kind], abs=0.3)


@pytest.mark.parametrize("kind", PLAYERS)
def test_a_released_key_falls_by_60_db_in_the_damping_time(kind: str, tmp_path: Path) -> None:
    t60_s, released_s = {"sfz": (0.1, 0.04), "sf2": (0.4, 0.2)}[kind]
    out, step_s = tmp_path / f"a.{kind}", 0.5 * t60_s
    export_sampled(small(instrument_of(damping={"release_t60_s": t60_s}), seconds=SECONDS[kind]), out, render)
    heard = PLAYERS[kind](out, [(0, 60, 127), (released_s, 60, 0)], released_s + 0.03 + step_s)[0]
    before, after = (level_db(heard[round(at * RATE_HZ) :][:960]) for at in (released_s - 0.02, released_s + step_s))
    delay_s = 0.01  # from a block's end, and the first ms of a release
    assert before - after == pytest.approx(60 * (step_s / t60_s) + 30 * (step_s + 0.02), abs=60 * delay_s / t60_s)
    assert release_timecents(instrument_of(damping={"release_t60_s": 0.6})) == 0  # 100 dB in a second
    longest = OF_INSTRUMENTS["damping.release_t60_s"].limits[1]
    assert release_s(instrument_of(damping={"release_t60_s": longest})) < 100  # within the format's range


def test_strings_that_ring_on_end_where_they_are_plucked_again(tmp_path: Path) -> None:
    export_sampled(
        small(instrument_of(damping={"let_ring": True, "release_t60_s": 0.01})), tmp_path / "a.sfz", render
    )
    player = players.Sfizz(tmp_path / "a.sfz")
    player.play([(0, 60, 127), (0, 61, 127), (0.02, 60, 0), (0.02, 61, 0)], 0.05)
    assert player.voices == 2
    player.play([(0, 60, 10)], 0)  # softer, in another layer
    assert player.voices == 3
    player.play([], 0.09)
    assert player.voices == 2

    out = tmp_path / "a.sf2"
    export_sampled(small(instrument_of(damping={"let_ring": True}), seconds=2.0), out, render)
    heard = players.by_fluidsynth(out, [(0, 60, 127), (0.1, 60, 0), (0.8, 60, 1)], 1.6)[0]
    alone = players.by_fluidsynth(out, [(0.8, 60, 1)], 1.6)[0]
    level = {at: level_db(heard[round(at * RATE_HZ) :][:4_800]) for at in (0.05, 0.65, 1.45)}
    assert level[0.05] - level[0.65] == pytest.approx(30 * 0.6, abs=1.5)
    assert level[1.45] == pytest.approx(level_db(alone[round(1.45 * RATE_HZ) :][:4_800]), abs=1)


@pytest.mark.parametrize("kind", PLAYERS)
def test_a_shipped_instrument_sounds_as_the_note_itself(kind: str, tmp_path: Path) -> None:
    harp = find_instrument("Concert harp").instrument.with_value("room.mix", 0.0)  # a string alone
    note = note_renderer(load_preset(find_preset(harp.preset)), "model")
    out, seconds = tmp_path / f"harp.{kind}", SECONDS[kind]
    plan = SampledPlan(harp, (52, 53), layers=3, seconds=seconds)
    gain_db = export_sampled(plan, out, note).gain_db
    rendered = [zone.velocity for zone in plan.zones if zone.key == 52]
    part, offsets = {"sfz": slice(480, 5_760), "sf2": slice(2_400, 40_000)}[kind], []
    for key, velocity in [(52, rendered[0]), (52, rendered[2]), (53, rendered[1]), (53, 20), (53, 127)]:
        direct = note(harp, key, velocity, seconds, seconds, RATE_HZ, advanced=lambda _: None).T[:, part]
        heard = PLAYERS[kind](out, [(0, key, velocity)], part.stop / RATE_HZ)[:, part]
        offsets += [level_db(a) - level_db(b) - gain_db for a, b in zip(heard, direct, strict=True)]
        if velocity in rendered:  # between them, a pluck glides as the one that was rendered
            assert abs(cents(heard[0], players.strongest_hz(direct[0]))) < 0.05
    assert np.ptp(offsets) < 1.0  # half a dB to either side


@pytest.mark.parametrize(("key", "layers"), [(28, 2), (33, 4)])
def test_a_note_starts_within_the_reported_error(key: int, layers: int, tmp_path: Path) -> None:
    """Rendered at the hardest velocity of its layer, a note would start about twice as far off."""
    bass = find_instrument("Electric bass").instrument.model_copy(
        update={"amp": Amp(), "body": BodyChoice(), "room": Room()}
    )
    render, part = note_renderer(load_preset(find_preset(bass.preset)), "model"), slice(480, 12_000)
    plan = SampledPlan(bass, (key, key), layers=layers, seconds=0.5)
    export_sampled(plan, tmp_path / "a.sf2", render)
    softest, hardest = plan.zones[-1].velocities
    live = {
        velocity: render(bass, key, velocity, 0.5, 0.5, RATE_HZ, advanced=lambda _: None)[part, 0]
        for velocity in (softest, 100, hardest)
    }
    errors, at_hardest = [], []
    for velocity, sound in live.items():
        own_hz, heard = players.strongest_hz(sound), PLAYERS["sf2"](tmp_path / "a.sf2", [(0, key, velocity)], 0.5)
        errors.append(abs(cents(heard[0, part], own_hz)))
        at_hardest.append(abs(cents(live[hardest], own_hz)))
    assert max(errors) < plan.pitch_error_cents
    assert max(at_hardest) > 1.6 * max(errors) > 3

"""Files for samplers as two samplers play them, and what names in them become."""

import re
import struct
from pathlib import Path

import numpy as np
import pytest

from app.export.sampled.job import export_sampled, note_renderer, plain_stem, planned, sample_folder
from app.export.sampled.plan import SampledPlan
from app.export.sampled.sf2 import ZEROS_BEHIND, release_timecents
from app.export.sampled.sfz import release_s
from app.instruments.library import find_instrument
from engine.parameters import OF_INSTRUMENTS
from engine.presets import find_preset, load_preset
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
def test_it_sounds_as_the_instrument_in_pitch_and_level(kind, fields, choices, spread_db, tmp_path):
    instrument, out, offsets = instrument_of(**fields), tmp_path / f"a.{kind}", []
    seconds, part = SECONDS[kind], PARTS[kind]
    report = export_sampled(small(instrument, seconds=seconds, **choices), out, render)
    loudest_db = 20 * np.log10(np.abs(render(instrument, 60, 127, seconds, seconds, RATE_HZ)).max())
    assert report.peak_db - report.gain_db == pytest.approx(loudest_db, abs=0.3)
    assert kind == "sf2" or report.gain_db == pytest.approx(min(0, -1 - loudest_db), abs=0.3)
    for key, velocity in NOTES:
        heard = PLAYERS[kind](out, [(0, key, velocity)], part.stop / RATE_HZ)
        direct = render(instrument, key, velocity, seconds, seconds, RATE_HZ)[part]
        off = abs(cents(direct[:, 0], players.hz_of(key)))
        assert abs(cents(heard[0, part], players.hz_of(key))) < (1 if choices else 0.1 + off)
        for side, own in zip(heard, (direct[:, 0], direct[:, -1]), strict=True):
            offsets.append(level_db(side[part]) - level_db(own) - report.gain_db)
    assert np.ptp(offsets) < spread_db  # one level for all: the player's own
    pan_db = -3.01 if kind == "sf2" and fields.get("pickup") != STEREO else 0.0
    assert np.mean(offsets) - pan_db == pytest.approx(OWN_DB[kind], abs=0.3)


@pytest.mark.parametrize("kind", PLAYERS)
def test_a_released_key_falls_by_60_db_in_the_damping_time(kind, tmp_path):
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


def test_strings_that_ring_on_end_where_they_are_plucked_again(tmp_path):
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
def test_a_shipped_instrument_sounds_as_the_note_itself(kind, tmp_path):
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


# Readings


def opcodes(text: str, name: str) -> list[str]:
    return re.findall(rf"(?:^|\s){name}=(\S+)", text)


def chunk(font: Path, name: bytes) -> bytes:
    """The content of a chunk of a SoundFont."""
    behind = font.read_bytes().partition(name)[2]
    return behind[4:][: int.from_bytes(behind[:4], "little")]


def test_an_sfz_bends_as_the_instrument_and_names_samples_that_are_there(tmp_path):
    out, plan = tmp_path / "An instrument (2).sfz", small(instrument_of(bend_semitones=12.0, **LOUD), every=3)
    export_sampled(plan, out, render)
    text = out.read_text("utf-8")
    (folder,), names = opcodes(text, "default_path"), opcodes(text, "sample")
    assert sorted(names) == sorted(path.name for path in (tmp_path / folder).iterdir())
    assert len(names) == len(plan.zones)
    assert opcodes(text, "bend_up") == ["1200"] and opcodes(text, "bend_down") == ["-1200"]
    assert max(map(float, opcodes(text, "volume"))) <= 0


HOSTILE = (
    "../../etc/passwd",
    "/etc/passwd",
    "C:\\Windows\\x",
    "a\n<region> sample=/etc/passwd",
    "..",
    "$x #define",
    "con\x00",
    "é漢字" * 5_000,
    "",
    "x" * 10_000,
    "a=b // c <global>",
)


def test_no_name_becomes_a_path_or_an_opcode(tmp_path):
    for place, name in enumerate(HOSTILE):
        folder = tmp_path / str(place)
        folder.mkdir()
        assert re.fullmatch(r"[A-Za-z0-9+][A-Za-z0-9_.+-]{0,59}", plain_stem(name))
        hostile = instrument_of().model_copy(update={"name": name, "description": f"{name}\n#include"})
        plan = small(hostile, keys=(60, 60), layers=1)
        fits = name.isprintable() and re.fullmatch(r"[^/\\:<>]{1,50}", name)
        out, font = folder / (f"{name}.sfz" if fits else "a.sfz"), folder / "a.sf2"
        export_sampled(plan, out, render)
        export_sampled(plan, font, render)
        assert sorted(folder.iterdir()) == sorted([out, sample_folder(out), font])
        text = out.read_text("utf-8")
        code = re.sub("//.*", "", text)
        assert opcodes(code, "sample") == [f"{plan.zones[0].stem}.flac"]
        assert re.findall(r"^<\w+>", text, re.M) == ["<control>", "<global>", "<group>", "<region>"]
        assert "#include" not in code
        shown = chunk(font, b"INAM")
        assert len(shown) <= 256 and shown.isascii() and chunk(font, b"phdr")[19] == 0
    assert plain_stem("a b=c$d<e>//f;g") == "a_b_c_d_e_f_g"
    assert sample_folder(Path("x") / "My song.v2.sfz") == Path("x") / "My_song.v2_samples"


def test_samples_of_a_soundfont_lie_apart_and_stereo_ones_are_linked(tmp_path):
    plan, out = small(instrument_of(name="Häärp ñ 琴", pickup=STEREO)), tmp_path / "a.sf2"
    export_sampled(plan, out, render)
    assert chunk(out, b"INAM").rstrip(b"\0") == b"Haarp n _"
    frames = np.frombuffer(chunk(out, b"smpl"), "<i2")
    assert 20 * np.log10(np.abs(frames.astype(int)).max() / 2**15) == pytest.approx(-1, abs=0.02)
    *samples, last = struct.iter_unpack("<20sIIIIIBbHH", chunk(out, b"shdr"))
    assert last[0].rstrip(b"\0") == b"EOS" and len(samples) == 2 * len(plan.zones)
    for number, (_, start, end, loop, loop_end, *_, link, kind) in enumerate(samples):
        assert start < loop < loop_end < end
        assert frames[start:end].any() and not frames[end : end + ZEROS_BEHIND].any()
        assert samples[link][8] == number and {kind, samples[link][9]} == {2, 4}
    assert [a[2] + ZEROS_BEHIND for a in samples] == [b[1] for b in samples[1:]] + [len(frames)]


@pytest.mark.parametrize(
    ("name", "choices", "reported"),
    [
        ("a.sf2", {"rate_hz": 96_000}, "a SoundFont's rate must lie in 400 … 50000 Hz, not 96000; lower it"),
        ("a.sf2", {"keys": (0, 127), "layers": 16, "seconds": 60.0}, "GiB, and a SoundFont holds 4; take fewer"),
        ("a.wav", {}, r"a\.wav: must end with \.sfz or \.sf2"),
    ],
)
def test_plans_that_no_file_can_hold_are_reported_before(name, choices, reported):
    whole = instrument_of(range=(0, 127))
    plan = small(whole, **choices)
    with pytest.raises(ValueError, match=reported):
        planned(plan, Path(name))
    assert planned(plan, Path("a.sfz")) == plan
    assert planned(small(whole, keys=(0, 127), layers=32), Path("a.sf2")).bits == "24"

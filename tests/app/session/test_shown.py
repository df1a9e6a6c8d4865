"""The sound of two slots: voices, levels, the words in which it is shown, and why it is silent."""

from dataclasses import replace

import numpy as np
import pytest

from app.presets.library import Library, PresetEntry, list_presets
from app.rendering import Take
from app.session.choices import Choices
from app.session.monitor import Monitor
from app.session.shown import shown_sources
from app.session.silence import why_difference_silent, why_ran_away, why_silent
from engine.pluck import Pluck
from engine.presets import find_string, read_info
from engine.presets.finding import SHIPPED
from engine.presets.of_string import read_string
from engine.values.ear import Ear
from tests.app.monitors import hears
from tests.app.takes import append_to

MATCH = {"model": 2.0, "truth": 1.0}
B = "preset:b"


@pytest.mark.parametrize(
    ("monitor", "match", "gains"),
    [
        (hears("model"), None, {"model": 1, "truth": 0, B: 0}),
        (hears("truth"), MATCH, {"model": 0, "truth": 1, B: 0}),
        (hears("model", level_match=True), None, {"model": 1, "truth": 0, B: 0}),
        (hears("model", level_match=True), MATCH, {"model": 2, "truth": 0, B: 0}),
        (hears(B, level_match=True), MATCH, {"model": 0, "truth": 0, B: 1}),
        (hears("preset:gone"), None, {"model": 1, "truth": 0, B: 0}),
        (hears("difference", "", True, 20.0), MATCH, {"model": 10, "truth": -10, B: 0}),
        # a note that began without a part of the difference
        (Monitor(a=B, difference=True), None, {B: 1, "truth": 0}),
        (hears("difference"), None, {"model": 1, B: 0}),
    ],
)
def test_gains_of_what_is_heard(monitor, match, gains):
    assert {source: monitor.gain(source, gains.keys(), match) for source in gains} == pytest.approx(gains)


def test_each_slot_is_reported_with_its_title_and_gain_and_one_source_once(small_preset):
    info = replace(read_info(small_preset), title="Steel E4, bright")
    library = Library([PresetEntry("steel_e4", small_preset, info)])
    choices = Choices(a="difference", b="preset:steel_e4", heard="b", difference_gain_db=30)
    difference, other = shown_sources(choices, library)
    assert (difference.slots, difference.title, difference.remark) == ("A", "difference", " +30 dB")
    assert difference.gain == pytest.approx(31.6, rel=1e-2)
    assert (other.slots, other.title, other.remark, other.gain) == ("B", "Steel E4, bright", " · heard", 1.0)
    (only,) = shown_sources(Choices(a="truth", b="truth", heard="b"), library)
    assert (only.slots, only.heard) == ("A B", True)


STRINGS = {name: read_string(find_string(name)) for name in ("nylon_e2", "piano_c4")}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, ""),
        ({"amplitude_mm": 0}, "amplitude is 0"),
        ({"volume_db": -60}, "volume"),
        ({"listen": 0.0}, "listening point is at a fixed end"),
        ({"listen": 0.0, "stereo": True}, "left silent"),
        ({"listen_right": 1.0}, ""),
        ({"listen_right": 1.0, "stereo": True}, "right silent"),
        ({"listen": 0.0, "listen_right": 1.0, "stereo": True}, "both listening points are at a fixed end"),
        ({"solo": 2}, ""),
        ({"solo": 2, "listen": 0.5}, "a node of mode 2"),
        ({"solo": 11}, "this string has 10"),
        ({"solo": 2, "position": 0.5}, "does not excite mode 2"),
        ({"a": "preset:gone"}, "gone was not found"),
        ({"b": "preset:gone"}, ""),
        # modes are those of the string that is plucked, not of the one that a preset of many was measured with
        ({"single": "studio_any_string", "string": STRINGS["nylon_e2"], "solo": 60, "position": 0.113}, ""),
        ({"single": "studio_any_string", "string": STRINGS["piano_c4"], "solo": 55}, "this string has 53"),
    ],
)
def test_the_reason_is_named(small_preset, changes, words):
    library = Library([*list_presets(small_preset.parent)[0], *list_presets(SHIPPED)[0]])
    found = why_silent(Choices(**{"single": "small", **changes}), library)
    assert words in found
    assert bool(found) == bool(words)


def test_a_difference_of_next_to_nothing_is_named(small_preset, hear):
    choices = Choices()
    take = Take("small", read_info(small_preset), Pluck(), 0.5, choices.ear)
    rest = np.zeros((take.frames, take.info.grid_points), np.float32)
    assert why_difference_silent(choices, take) == ""  # nothing is known yet
    append_to(take, rest, rest)
    hear(take, choices.ear)
    assert "are identical" in why_difference_silent(choices, take)
    assert why_difference_silent(choices.changed({"listen": 0.2}), take) == ""  # of there nothing is known
    for off_m, gain_db, words in ((1e-7, 20, "raise its gain"), (1e-7, 60, ""), (1e-3, 0, "")):
        take = Take("small", take.info, Pluck(), 0.5, choices.ear)
        append_to(take, rest + np.float32(off_m), rest)
        hear(take, choices.ear)
        found = why_difference_silent(Choices(difference_gain_db=gain_db), take)
        assert words in found
        assert bool(found) == bool(words)


def test_a_model_that_runs_away_is_reported_with_the_reason(small_preset):
    take = Take("small", read_info(small_preset), Pluck(amplitude_mm=20.0), 0.5, Ear((0.5,)))
    assert why_ran_away(take) == ""
    take.model_ends_s = 0.0
    at_once = why_ran_away(take)
    assert "cannot play this pluck" in at_once
    assert "amplitude 20 mm is outside" in at_once
    take.model_ends_s = 0.25
    assert "0.25 s after the pluck" in why_ran_away(take)

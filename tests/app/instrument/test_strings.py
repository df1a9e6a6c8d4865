from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from app.instrument.string_keys import on_string
from app.instrument.strings import KNOBS, Strings, decay_rates
from app.patches.library import SHIPPED, read_patch
from app.patches.patch import Knobs, OpenString, Patch, StringSet
from app.patches.tuning import TuningChoice
from app.shared.parameters import OF_PATCHES
from engine.kernels import strings as law
from engine.kernels.constants import D1, LENGTH, TENSION
from engine.resonators import string as of_law
from engine.resonators.family import inharmonicity
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters

STEEL = StringParameters(0.65, 5e-7, 2e-14, 7850.0, 2e11, 4e-4, 4e-7, 75.0)


def made(string: StringParameters, place: int, value: float) -> StringParameters:
    """The string with another value, by its place in the row."""
    return replace(string, **{fields(string)[place].name: value})


def cents(one_hz: float, other_hz: float) -> float:
    return 1200 * math.log2(one_hz / other_hz)


@pytest.mark.parametrize("key", range(28, 89))
def test_every_key_has_its_pitch_by_length_alone(patch: Patch, key: int) -> None:
    found = Strings(patch).of_key(key)
    assert found is not None
    assert abs(cents(found.parameters.pitch_hz, 440 * 2 ** ((key - 69) / 12))) < 1e-3
    assert replace(found.parameters, length_m=STEEL.length_m) == STEEL
    assert 1 <= found.modes <= 99


def test_a_set_frets_the_highest_string_at_or_below_and_slackens_the_lowest(guitar: Patch) -> None:
    strings = Strings(Patch.model_validate({**dict(guitar), "tuning": TuningChoice(a4_hz=443.0)}))
    for key in (30, 40, 44, 45, 64, 80):
        found = strings.of_key(key)
        assert found is not None
        assert abs(cents(found.parameters.pitch_hz, 443 * 2 ** ((key - 69) / 12))) < 1e-3
    low, lowest = strings.of_key(30), strings.of_key(40)
    assert low is not None
    assert lowest is not None
    assert low.parameters.tension_n < 0.5 * lowest.parameters.tension_n
    assert abs(low.parameters.length_m / lowest.parameters.length_m - 1) < 1e-3


def test_a_key_that_no_tension_reaches_says_so(guitar: Patch) -> None:
    rod = OpenString(note=60, string=replace(STEEL, second_moment_m4=1e-9))
    strings = Strings(Patch.model_validate({**dict(guitar), "strings": StringSet(strings=(rod,))}))
    with pytest.raises(ValueError, match="key 31: no tension slackens its string so far; choose a higher key"):
        strings._stopped(31, None, 440 * 2 ** ((31 - 69) / 12))


def test_a_set_may_be_reported_on_which_string(guitar: Patch) -> None:
    strings = [
        OpenString(note=note, string=replace(STEEL, tension_n=tension_n))
        for note, tension_n in ((50, 60.0), (55, 70.0), (59, 80.0))
    ]
    found = Strings(Patch.model_validate({**dict(guitar), "strings": StringSet(strings=tuple(strings))}))

    def tension_n(key: int, string: int | None) -> float:
        of_key = found.of_key(key, string)
        assert of_key is not None
        assert abs(cents(of_key.parameters.pitch_hz, 440 * 2 ** ((key - 69) / 12))) < 1e-3
        return of_key.parameters.tension_n

    assert [tension_n(64, string) for string in (None, 0, 1, 2, 3)] == [80.0, 80.0, 70.0, 60.0, 80.0]
    assert [tension_n(53, string) for string in (None, 0, 2)] == [60.0, 60.0, 60.0]  # 0 is too far above
    assert tension_n(57, 0) == pytest.approx(80 * 2 ** (-4 / 12), rel=0.01)  # it is slackened


def test_a_key_beyond_the_range_is_none(patch: Patch) -> None:
    assert Strings(patch).of_key(27) is None
    assert Strings(patch).of_key(89) is None


@pytest.mark.parametrize("semitones", [-2, -0.5, 0.3, 2, 12])
def test_bends_and_slides_reach_the_pitch(semitones: float) -> None:
    ratio = 2 ** (semitones / 12)
    by_tension = made(STEEL, TENSION, law.bent(STEEL.row, ratio))
    by_length = made(STEEL, LENGTH, law.slid(STEEL.row, ratio))
    for changed in (by_tension, by_length):
        assert abs(cents(changed.pitch_hz, ratio * STEEL.pitch_hz)) < 1e-3
    assert by_tension.length_m == STEEL.length_m
    assert by_length.tension_n == STEEL.tension_n


def test_a_bend_below_what_stiffness_alone_gives_needs_a_tension_below_zero() -> None:
    assert law.bent(replace(STEEL, second_moment_m4=1e-9).row, 0.05) < 0


def test_a_damper_adds_its_decay_to_every_partial() -> None:
    added = of_law.decay_rates(made(STEEL, D1, law.damped(STEEL.row, 0.2)), 20) - of_law.decay_rates(STEEL, 20)
    assert added.tolist() == pytest.approx([math.log(1000) / 0.2] * 20)


def turned(**knobs: float) -> StringParameters:
    law.turned(STEEL.row, [getattr(Knobs(**knobs), name) for name in KNOBS], out := [0.0] * 8)
    return StringParameters(*out)


def test_gauge_and_density_leave_pitch_and_decay_and_change_how_stiff_it_is() -> None:
    thick = turned(gauge=1.5, density=1.2)
    assert abs(cents(made(thick, LENGTH, law.fretted(thick.row, 220.0)).pitch_hz, 220.0)) < 1e-3
    assert thick.decay_rate(1) == pytest.approx(STEEL.decay_rate(1))
    assert thick.second_moment_m4 == pytest.approx(1.5**4 * STEEL.second_moment_m4)
    assert turned() == STEEL


def test_tension_and_length_go_together_at_a_keys_pitch(patch: Patch, guitar: Patch) -> None:
    for played, key in ((patch, 57), (guitar, 57), (guitar, 30)):
        own = Strings(played).of_key(key)
        tight = Strings(played.with_value("knobs.tension", 4.0)).of_key(key)
        long = Strings(played.with_value("knobs.length", 2.0)).of_key(key)
        same = Strings(played.with_values({"knobs.tension": 4.0, "knobs.length": 0.5})).of_key(key)
        assert own is not None and tight is not None and long is not None and same is not None
        for found in (tight, long):
            assert abs(cents(found.parameters.pitch_hz, own.pitch_hz)) < 1e-3
            assert found.parameters.tension_n == pytest.approx(4 * own.parameters.tension_n, rel=5e-3)
            assert found.parameters.length_m == pytest.approx(2 * own.parameters.length_m, rel=5e-3)
            assert found.shortened == pytest.approx(own.shortened, rel=5e-3)  # pulled as far
            assert inharmonicity(found.parameters) == pytest.approx(inharmonicity(own.parameters) / 16, rel=1e-2)
            left = replace(found.parameters, length_m=1.0, tension_n=1.0)
            assert left == replace(own.parameters, length_m=1.0, tension_n=1.0)
        assert same.parameters.tension_n == pytest.approx(own.parameters.tension_n)
        assert same.parameters.length_m == pytest.approx(own.parameters.length_m)


def test_a_tight_string_rises_less_in_tension_when_it_is_plucked_hard(patch: Patch) -> None:
    rises = []
    for played in (patch, patch.with_value("knobs.tension", 2.0)):
        found = Strings(played).of_key(57)
        assert found is not None
        resonator = resonator_of(found.parameters, found.modes)
        pluck = on_string(found, played.pluck.pluck(127))
        rises.append(float(resonator.relative_tension_rise(resonator.to_modes(pluck.displacement(101)))))
    assert rises[0] / rises[1] == pytest.approx(4.0, rel=0.02)  # 1 / T₀ℓ²


def test_an_impossible_key_is_named(patch: Patch) -> None:
    from app.patches.patch import Fretted

    heavy = replace(patch.strings.string, tension_n=1e-3, second_moment_m4=0.0)  # type: ignore[union-attr]
    bad = Patch.model_validate({**dict(patch), "strings": Fretted(string=heavy)})
    with pytest.raises(ValueError, match=r"key 88 of test.*length_m"):
        Strings(bad).of_key(88)


def test_each_tenth_of_the_mute_knob_shortens_a_string_alike() -> None:
    patch = read_patch(SHIPPED / "steel_string_acoustic.json")
    string = Strings(patch).of_key(40)
    assert string is not None
    own, modes, knob = string.parameters, string.modes, OF_PATCHES["damping.mute"]
    squares = np.array([own.undamped_frequency(mode) ** 2 for mode in range(1, modes + 1)])
    energies, times_s, t60_s = np.arange(1.0, modes + 1) ** -2, np.geomspace(0.01, 20, 2000), []
    for tenth in range(11):
        out = np.concatenate([squares, decay_rates(patch, own, modes)])
        law.mute(own.row, modes, 0, knob.value(tenth / 10), out)
        left = (energies / out[modes:] * np.exp(-2 * np.outer(times_s, out[modes:]))).sum(1)
        t60_s.append(3 * times_s[np.argmax(left < 0.01 * (energies / out[modes:]).sum())])
    ratios = np.array(t60_s[1:]) / t60_s[:-1]
    assert t60_s[0] > 20 * t60_s[-1]
    assert 0.6 < ratios.min() < ratios.max() < 0.8

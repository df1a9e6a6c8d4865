"""Parameters and the names of keys: values, steps, words, and numbers as they are typed anywhere."""

import random

import pytest

from app.shared.key_names import key_named, note_name
from app.shared.parameters import OF_CHOICES
from app.shared.typed_number import begins_number, typed_number, typed_value
from engine.parameters import OF_INSTRUMENTS

ALL = {**OF_INSTRUMENTS, **OF_CHOICES}.values()
UNDERSTOOD = {  # by value and unit
    (2.5, ""): ("2.5", "2,5"),
    (2.5, "s"): ("2.5 s", "2,5s"),
    (20, "%"): (" 20 % ", "20%"),
    (3, "mm"): ("3 mm",),
    (440, "Hz"): ("440 hz",),
    (-3, "dB"): ("\u22123\u00a0dB",),
    (6, "dB"): ("+ 6 dB",),
    (7, "kg/m³"): ("7 kg/m\u00b3", "7 kg/m3"),
    (5, "µm"): ("5 \u03bcm",),
    (0.5, ""): (".5", ",5"),
    (5, ""): ("5.",),
    (1, ""): ("1.000", "1,000"),
    (1000.5, ""): ("1.000,5", "1,000.5", "1 000,5", "1'000.5"),
    (1000, ""): ("1\u202f000", "1e3"),
    (1234567, ""): ("1.234.567",),
    (0.015, ""): ("1,5E\u22122",),
}
MARKS = ("", ".", "-", "--3", "3-", "1/2", "1 0", "20 %", "10\u00b2", "\u2460", "1\u2082", "\u00bd", "\u0663", "0x10")
REFUSED = {  # by unit
    "": (*MARKS, "1.2.3", "1,2,3", "1,000,5", "12.3456,7", "0.123,5", "nan", "inf", "1e999", "1_000", "9" * 400),
    "s": ("s", "3 ms", "2 s s"),
    "m": ("0.3 cm",),
    "mm": ("0.3 cm", "3 m"),
    "Hz": ("3 kHz",),
    "kg/m³": ("2\u00b3 kg/m\u00b3",),
}


def test_numbers_with_either_decimal_sign_groups_and_units_are_understood_and_other_texts_refused():
    for (value, unit), texts in UNDERSTOOD.items():
        for text in texts:
            assert typed_number(text, unit) == pytest.approx(value), text
            assert all(begins_number(text[:end], unit) for end in range(len(text) + 1)), text
    for unit, texts in REFUSED.items():
        assert [text for text in texts if typed_number(text, unit) is not None] == []


@pytest.mark.parametrize("parameter", ALL, ids=lambda parameter: parameter.id)
def test_a_knob_goes_through_its_whole_range_and_back_and_reads_what_it_shows(parameter):
    low, high = parameter.limits
    values = [parameter.value(share / 10) for share in range(11)]
    assert (values[0], values[-1]) == (low, pytest.approx(high))
    assert values == sorted(set(values))
    assert [parameter.share(value) for value in values] == pytest.approx([share / 10 for share in range(11)])
    assert (parameter.value(-1), parameter.value(2)) == (pytest.approx(low), pytest.approx(high))
    assert parameter.stepped(values[5], -1) < values[5] < parameter.stepped(values[5], 1)
    assert parameter.stepped(high, 5) == high
    step = parameter.stepped(parameter.default, -1)
    assert parameter.default == low or parameter.stepped(step, 1) == pytest.approx(parameter.default)
    if parameter.words:  # each whole value has its own
        assert parameter.whole and len(set(parameter.words)) == len(parameter.words) == high - low + 1
        assert tuple(parameter.shown(low + step) for step in range(len(parameter.words))) == parameter.words
        assert all(" " not in word for word in parameter.words)  # plug-ins keep them with spaces between
    draw = random.Random(0)
    for _ in range(50):
        value = parameter.value(draw.random())
        shown = parameter.shown(round(value) if parameter.whole else value)
        for text in (shown, shown.replace(".", ","), shown.replace("-", "\u2212"), shown.replace(" ", "\u00a0")):
            typed = typed_value(parameter, text)
            assert typed is not None and parameter.shown(typed) == shown, text
        number = shown.removeprefix("× ").partition(" ")[0].removesuffix("%")
        assert parameter.words or typed_value(parameter, number) == typed_value(parameter, shown), number


def test_shares_are_typed_in_per_cent_and_words_by_word_or_number():
    mix = OF_INSTRUMENTS["room.mix"]
    assert [typed_value(mix, text) for text in ("20", "20%", "20 %", "100", "0.5")] == [0.2, 0.2, 0.2, 1.0, 0.005]
    assert typed_value(OF_INSTRUMENTS["tuning.transpose"], "2.5") is None
    assert (
        typed_value(OF_INSTRUMENTS["technique.strokes"], "both")
        == typed_value(OF_INSTRUMENTS["technique.strokes"], "2")
        == 2
    )


def test_names_of_keys_are_read_as_they_are_written_and_in_other_spellings():
    assert [key_named(note_name(key)) for key in range(128)] == list(range(128))
    spellings = {"e2": 40, "F#3": 54, "Gb3": 54, "G♭3": 54, " 54 ": 54, "C-1": 0}
    assert {text: key_named(text) for text in spellings} == spellings
    assert [text for text in ("H2", "E", "", "9" * 5_000) if key_named(text) is not None] == []

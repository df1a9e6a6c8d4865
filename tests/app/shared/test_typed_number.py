"""Numbers as they are typed anywhere: both decimal signs, groups, units; and texts that are none."""

from __future__ import annotations

import random

import pytest

from app.shared.parameters import OF_CHOICES, OF_INSTRUMENTS
from app.shared.typed_number import begins_number, typed_number


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("2.5", "", 2.5),
        ("2,5", "", 2.5),
        ("2.5 s", "s", 2.5),
        ("2,5s", "s", 2.5),
        (" 20 % ", "%", 20),
        ("20%", "%", 20),
        ("3 mm", "mm", 3),
        ("440 hz", "Hz", 440),
        ("\u22123\u00a0dB", "dB", -3),
        ("+ 6 dB", "dB", 6),
        ("7 kg/m\u00b3", "kg/m³", 7),
        ("7 kg/m3", "kg/m³", 7),
        ("5 \u03bcm", "µm", 5),
        (".5", "", 0.5),
        (",5", "", 0.5),
        ("5.", "", 5),
        ("1.000", "", 1),
        ("1,000", "", 1),
        ("1.000,5", "", 1000.5),
        ("1,000.5", "", 1000.5),
        ("1 000,5", "", 1000.5),
        ("1\u202f000", "", 1000),
        ("1'000.5", "", 1000.5),
        ("1.234.567", "", 1234567),
        ("1e3", "", 1000),
        ("1,5E\u22122", "", 0.015),
    ],
)
def test_what_is_understood(text: str, unit: str, value: float) -> None:
    assert typed_number(text, unit) == pytest.approx(value)
    for end in range(len(text) + 1):
        assert begins_number(text[:end], unit), text[:end]


@pytest.mark.parametrize(
    ("text", "unit"),
    [("", ""), (".", ""), ("-", ""), ("s", "s"), ("1.2.3", ""), ("1,2,3", ""), ("1,000,5", ""), ("12.3456,7", ""),
     ("0.123,5", ""), ("1 0", ""), ("--3", ""), ("3-", ""), ("nan", ""), ("inf", ""), ("1e999", ""), ("1_000", ""),
     ("0x10", ""), ("\u0663", ""), ("0.3 cm", "m"), ("0.3 cm", "mm"), ("3 ms", "s"), ("3 kHz", "Hz"), ("20 %", ""),
     ("3 m", "mm"), ("2 s s", "s"), ("1/2", ""), ("9" * 400, ""), ("10\u00b2", ""), ("2\u00b3 kg/m\u00b3", "kg/m³"),
     ("\u2460", ""), ("1\u2082", ""), ("\u00bd", "")],
)  # fmt: skip
def test_what_is_refused(text: str, unit: str) -> None:
    assert typed_number(text, unit) is None


def test_every_parameter_reads_what_it_shows_with_either_sign() -> None:
    draw = random.Random(0)
    for parameter in {**OF_INSTRUMENTS, **OF_CHOICES}.values():
        for _ in range(50):
            value = parameter.value(draw.random())
            if parameter.whole:
                value = round(value)
            shown = parameter.shown(value)
            for text in (shown, shown.replace(".", ","), shown.replace("-", "\u2212"), shown.replace(" ", "\u00a0")):
                typed = parameter.typed(text)
                assert typed is not None, (parameter.id, text)
                assert parameter.shown(typed) == shown, (parameter.id, text)
            number = shown.removeprefix("× ").partition(" ")[0].removesuffix("%")
            if not parameter.words:
                assert parameter.typed(number) == parameter.typed(shown), (parameter.id, number)


def test_a_share_in_per_cent_is_typed_so() -> None:
    mix = OF_INSTRUMENTS["room.mix"]
    assert [mix.typed(text) for text in ("20", "20%", "20 %", "100", "0.5")] == [0.2, 0.2, 0.2, 1.0, 0.005]
    assert OF_INSTRUMENTS["tuning.transpose"].typed("2.5") is None
    assert OF_INSTRUMENTS["technique.strokes"].typed("both") == OF_INSTRUMENTS["technique.strokes"].typed("2") == 2

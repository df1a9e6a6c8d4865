"""Scala's files against an independent reading, hostile text, and generated scales against formulas of each pitch."""

import math
import random
import re
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from app.instruments.scala import parse_scale
from app.instruments.scales import SCALES
from app.instruments.tuning import Tuning, TuningChoice, read_scala

REMARKS = [
    *("", "", "", " ", "\t", " cents", " E\\", "\tD 294.33", " ! a fifth", "!5/4", "  by ear, 1998", " 3/2.", "C#"),
    *(", a fifth", ": 3/2, or so", "; 9", "*", "\\ E", "^ by ear"),
]


@dataclass
class Made:
    """A mapping as its text, and what it was made from."""

    text: str
    numbers: list[int]
    hz: float
    pattern: list[int | None]


def noisy(lines: list[str], draw: random.Random, first: int) -> str:
    """The lines with comments, empty lines and white space between them, from a line on."""
    end = draw.choice(("\n", "\r\n", "\r"))
    out: list[str] = []
    for number, line in enumerate(lines):
        while draw.random() < 0.2:
            out.append(draw.choice(("! a comment", "!", "! 3/2", "!100.0")))
        if number >= first and draw.random() < 0.1:
            out.append(draw.choice(("", "  ", "\t")))
        out.append(line)
    return end.join(out) + draw.choice(("", end, end + end))


def pitch(draw: random.Random) -> tuple[str, float]:
    """The text of a pitch, and its cents by fractions."""
    kind = draw.randrange(6)
    if kind == 0:
        number = draw.randrange(1, 9)
        return str(number), 1200 * math.log2(number)
    if kind == 1:  # beyond 64 bits
        ratio = Fraction(3 ** draw.randrange(40, 90), 2 ** draw.randrange(63, 140))
        bits = ratio.numerator.bit_length() - ratio.denominator.bit_length()
        rest = ratio / Fraction(2) ** bits
        return f"{ratio.numerator}/{ratio.denominator}", 1200 * (bits + math.log2(rest))
    if kind == 2:
        ratio = Fraction(draw.randrange(1, 200), draw.randrange(1, 200))
        blank = draw.choice(("", "", " "))
        return f"{ratio.numerator}{blank}/{blank}{ratio.denominator}", 1200 * math.log2(ratio)
    if kind == 3:
        whole = draw.randrange(-1300, 2600)
        return f"{whole}.", float(whole)
    thousandths = draw.randrange(-200_000, 1_300_000)
    sign = "-" if thousandths < 0 else draw.choice(("", "+", ""))
    return f"{sign}{abs(thousandths) // 1000}.{abs(thousandths) % 1000:03d}", thousandths / 1000


def made_scale(draw: random.Random) -> tuple[str, list[float]]:
    notes = [pitch(draw) for _ in range(draw.choice((0, 1, 2, 5, 7, 12, 12, 19, 31)))]
    lines = [
        draw.choice(("", "a scale", "12", "3/2 and more", "p\u00e9log")),
        f"{draw.choice(('', ' ', chr(9)))}{len(notes)}{draw.choice(('', ' ', ' notes', ' ! of an octave'))}",
        *(draw.choice(("", " ", "\t", "   ")) + text + draw.choice(REMARKS) for text, _ in notes),
        *(["this is text below"] if draw.random() < 0.1 else []),
    ]
    return noisy(lines, draw, 2), [cents for _, cents in notes]


def made_mapping(draw: random.Random) -> Made:
    size = draw.choice((0, 0, 1, 2, 4, 7, 10, 12, 12, 19, 24, 61, 128))
    pattern: list[int | None] = [draw.choice((None, draw.randrange(-5, 40), place)) for place in range(size)]
    low, high = sorted((draw.randrange(128), draw.randrange(128)))
    if draw.random() < 0.6:
        low, high = 0, 127
    middle, reference = draw.randrange(128), draw.randrange(128)
    if size and pattern[(reference - middle) % size] is None:
        pattern[(reference - middle) % size] = draw.randrange(24)
    hz = round(draw.uniform(20, 900), draw.randrange(7))
    numbers = [size, low, high, middle, reference, draw.choice((0, 7, 12, size, 24, -5))]
    listed = list(pattern)
    while listed and listed[-1] is None and draw.random() < 0.7:
        listed.pop()
    entries = [draw.choice("xX") if degree is None else str(degree) for degree in listed]
    lines = [
        draw.choice(("", " ", "\t")) + str(line) + draw.choice(("", "", " ", "\t! a remark", " (more)"))
        for line in (*numbers[:5], hz, numbers[5], *entries)
    ]
    return Made(noisy(lines, draw, 0), numbers, hz, pattern)


def cents_of_degree(degree: int, cents: list[float]) -> float:
    """The pitch of a degree, one period after another."""
    if not cents:
        return 0.0
    found, steps = 0.0, [0.0, *cents]
    while degree >= len(cents):
        degree, found = degree - len(cents), found + cents[-1]
    while degree < 0:
        degree, found = degree + len(cents), found - cents[-1]
    return found + steps[degree]


def degree_of_key(key: int, made: Made, notes: int) -> int | None:
    """The degree of a key, one pattern after another."""
    size, _, _, middle, _, octave = made.numbers
    if size == 0:
        return key - middle
    place, moved = key - middle, 0
    while place >= size:
        place, moved = place - size, moved + (octave or notes)
    while place < 0:
        place, moved = place + size, moved - (octave or notes)
    degree = made.pattern[place]
    return None if degree is None else degree + moved


def held_to(choice: TuningChoice, expected: dict[int, float | None]) -> None:
    tuning = Tuning(choice)
    for key, cents in expected.items():  # above 440 Hz
        assert tuning.mapped(key) == (cents is not None), key
        if cents is not None and abs(cents) < 228_000:
            assert 1200 * math.log2(tuning.hz(key) / 440) == pytest.approx(cents, abs=1e-5), key


def test_random_scales_and_mappings():
    for seed in range(60):
        draw = random.Random(seed)
        text, cents = made_scale(draw)
        base = cents_of_degree(9, cents)
        held_to(TuningChoice(scale=text), {key: cents_of_degree(key - 60, cents) - base for key in range(128)})
        made = made_mapping(draw)
        if draw.random() < 0.3:
            text, cents = "", [100.0 * step for step in range(1, 13)]
        reference = degree_of_key(made.numbers[4], made, len(cents))
        assert reference is not None
        base = 1200 * math.log2(made.hz / 440) - cents_of_degree(reference, cents)
        expected: dict[int, float | None] = {}
        for key in range(128):
            degree = degree_of_key(key, made, len(cents))
            expected[key] = None if degree is None else base + cents_of_degree(degree, cents)
            if not made.numbers[1] <= key <= made.numbers[2]:
                expected[key] = 100.0 * (key - 69)
        held_to(TuningChoice(scale=text, keymap=made.text), expected)


TEXT = Path(__file__).with_name("scala.txt").read_text(encoding="utf-8")
LONG = re.sub(r"NINES(\d+)", lambda many: "9" * int(many[1]), TEXT)
TABLES = dict(part.split("]\n", 1) for part in LONG.split("\n[")[1:])


def rows(name: str) -> list[list[str]]:
    return [line.split(" | ") for line in TABLES[name].splitlines()[1:] if line]


JUST = [Fraction(a, b) for a, b in ((9, 8), (5, 4), (4, 3), (3, 2), (5, 3), (15, 8), (2, 1))]


def scale(*tones: object, name: str = "a scale") -> str:
    return "\n".join(["! made.scl", "!", name, f" {len(tones)}", "!", *(f" {tone}" for tone in tones)]) + "\n"


def keymap(*keys: object, middle: int = 60, reference: int = 69, hz: float = 440, octave: int = 0) -> str:
    return "\n".join(str(line) for line in (len(keys), 0, 127, middle, reference, hz, octave, *keys)) + "\n"


def test_pitches_of_keys_and_between_them():
    for a4_hz in (415.0, 443.5):
        for note in (-5.0, 0.0, 60.0, 69.0, 69.31, 140.5):
            assert Tuning(TuningChoice(a4_hz=a4_hz)).hz(note) == pytest.approx(a4_hz * 2 ** ((note - 69) / 12), 1e-12)
    assert Tuning(TuningChoice(transpose=-12)).hz(69) == pytest.approx(220)
    just = Tuning(TuningChoice(scale=scale(*JUST)))
    moved = Tuning(TuningChoice(scale=scale(*JUST), transpose=3))
    assert moved.hz(60) == pytest.approx(just.hz(63), rel=1e-12)
    assert just.hz(60.25) == pytest.approx(just.hz(60) * (9 / 8) ** 0.25, rel=1e-9)
    far = Tuning(TuningChoice(scale=scale(*JUST), keymap="0\n0\n127\n60\n60\n300.\n0\n", transpose=48))
    assert far.hz(88) == pytest.approx(300 * 2**10 * 15 / 8)  # key 136, degree 76
    wide = Tuning(TuningChoice(scale="wide\n1\n18446744073709551616/1\n"))
    assert wide.hz(70) == pytest.approx(440 * 2.0**64), "no string has it, and it does not spoil the others"
    assert all(0 < wide.hz(key) < math.inf for key in range(-128, 256))


def test_keys_that_a_mapping_leaves_out_are_reported_and_lie_between():
    """White keys play the seven notes; black keys are silent."""
    white = keymap(0, "x", 1, "x", 2, 3, "x", 4, "x", 5, "x", 6, octave=7)
    tuned = Tuning(TuningChoice(scale=scale(*JUST), keymap=white))
    mapped = [key for key in range(60, 73) if tuned.mapped(key)]
    assert mapped == [60, 62, 64, 65, 67, 69, 71, 72]
    for key, ratio in zip(mapped, [Fraction(1), *JUST], strict=True):
        assert tuned.hz(key) == pytest.approx(440 / (5 / 3) * float(ratio), rel=1e-9)
    assert tuned.hz(61) == pytest.approx((tuned.hz(60) * tuned.hz(62)) ** 0.5, rel=1e-9)
    with pytest.raises(ValueError, match="keymap"):
        TuningChoice(keymap="12\n")
    moved = Tuning(TuningChoice(scale=scale(*JUST), keymap=white, transpose=1))
    assert not moved.mapped(60) and moved.mapped(61)


@pytest.mark.parametrize(("line", "cents"), rows("lines"))
def test_lines_of_the_formats_text(line, cents):
    tuning = Tuning(TuningChoice(scale=f"one\n1\n{line}\n"))
    assert 1200 * math.log2(tuning.hz(70) / tuning.hz(69)) == pytest.approx(float(cents), abs=1e-3)


def test_descriptions_of_any_encoding(tmp_path):
    path = tmp_path / "a.scl"
    for raw in (b"\xef\xbb\xbfp\xc3\xa9log", b"p\xe9log \x96 d\xe9j\xe0\xa0vu\x85", b"caf\xe9", b""):
        path.write_bytes(raw + b"\r\n 1\r\n 3/2\r\n\x1a")
        assert Tuning(TuningChoice(scale=read_scala(path))).hz(70) == pytest.approx(660)


def test_what_is_no_scale_is_one_line_that_names_the_file(tmp_path):
    bad = {scale(line): r"a\.scl: scale: " for (line,) in rows("none")}
    bad |= dict.fromkeys(("nothing", scale(*(f"{n}." for n in range(1, 1100)))), r"scale")
    for said, listed in ((7, 12), (12, 7), (7, 6), (10**4000, 7), (3, 0)):
        tones = "".join(f" {100 * n}. ! a note\n" for n in range(1, listed + 1))
        words = f"says {str(said)[:20]} notes and lists {listed}; correct its count or its list of notes"
        bad[f"! wrong.scl\na scale\n {said}\n!\n{tones}"] = re.escape(f"a.scl: scale: {words}")
    for text, words in bad.items():
        (tmp_path / "a.scl").write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=words) as caught:
            read_scala(tmp_path / "a.scl")
        assert str(caught.value).isprintable() and len(str(caught.value)) < 300


@pytest.mark.parametrize(("place", "line", "words"), rows("mapping"))
def test_a_mapping_names_the_number_that_is_wrong(place, line, words):
    lines = ["4", "0", "60", "60", "60", "440.0", "7", "0", "x", "4", "5"]
    TuningChoice(keymap="\n".join(lines))
    lines[int(place)] = line
    with pytest.raises(ValueError, match=words):
        TuningChoice(keymap="\n".join(lines))


Q, E, V = 5**0.25, 2**0.25, 2 ** (13 / 6) / 3


@pytest.mark.parametrize("name", SCALES)
def test_a_scale_has_the_pitches_of_its_formula_and_tunes_keys_from_c_with_a4_where_it_was(name):
    (formulas,) = (wanted for key, wanted in rows("scales") if name.startswith(key))
    ratios = [eval(formula, {"Q": Q, "E": E, "V": V}) for formula in formulas.split()]
    np.testing.assert_allclose(1200 * np.array(parse_scale(SCALES[name]).octaves), 1200 * np.log2(ratios), atol=1e-5)
    tuning = Tuning(TuningChoice(a4_hz=432.0, scale=SCALES[name]))
    assert tuning.hz(69) == pytest.approx(432.0)
    found = np.array([tuning.hz(61 + step) for step in range(len(ratios))]) / tuning.hz(60)
    np.testing.assert_allclose(found, ratios, rtol=1e-8)
    assert SCALES[name].splitlines()[0] == name, "which the bar shows"

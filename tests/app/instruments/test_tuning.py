"""Pitches against closed forms, and scales that can be none."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import pytest

from app.instruments.tuning import Tuning, TuningChoice, read_scala

C4_HZ = 440 * 2 ** (-9 / 12)
JUST = [Fraction(a, b) for a, b in ((9, 8), (5, 4), (4, 3), (3, 2), (5, 3), (15, 8), (2, 1))]


def scale(*tones: object, name: str = "a scale") -> str:
    return "\n".join(["! made.scl", "!", name, f" {len(tones)}", "!", *(f" {tone}" for tone in tones)]) + "\n"


def keymap(*keys: object, middle: int = 60, reference: int = 69, hz: float = 440, octave: int = 0) -> str:
    return "\n".join(str(line) for line in (len(keys), 0, 127, middle, reference, hz, octave, *keys)) + "\n"


@pytest.mark.parametrize("a4_hz", [415.0, 440.0, 443.5])
@pytest.mark.parametrize("note", [-5.0, 0.0, 21.0, 60.0, 69.0, 69.31, 108.0, 140.5])
def test_twelve_equal_steps(a4_hz: float, note: float) -> None:
    assert Tuning(TuningChoice(a4_hz=a4_hz)).hz(note) == pytest.approx(a4_hz * 2 ** ((note - 69) / 12), rel=1e-12)


def test_transposition_moves_all_keys() -> None:
    assert Tuning(TuningChoice(transpose=-12)).hz(69) == pytest.approx(220)
    just = TuningChoice(scale=scale(*JUST))
    moved = just.model_copy(update={"transpose": 3})
    assert Tuning(moved).hz(60) == pytest.approx(Tuning(just).hz(63), rel=1e-12)


def test_between_two_keys_the_interval_is_divided_evenly() -> None:
    tuned = Tuning(TuningChoice(scale=scale(*JUST)))
    assert tuned.hz(60.25) == pytest.approx(tuned.hz(60) * (9 / 8) ** 0.25, rel=1e-9)


def test_keys_that_a_mapping_leaves_out_are_reported_and_lie_between() -> None:
    """White keys play the seven notes; black keys are silent."""
    white = keymap(0, "x", 1, "x", 2, 3, "x", 4, "x", 5, "x", 6, octave=7)
    tuned = Tuning(TuningChoice(scale=scale(*JUST), keymap=white))
    mapped = [key for key in range(60, 73) if tuned.mapped(key)]
    assert mapped == [60, 62, 64, 65, 67, 69, 71, 72]
    first_hz = 440 / (5 / 3)
    for key, ratio in zip(mapped, [Fraction(1), *JUST], strict=True):
        assert tuned.hz(key) == pytest.approx(first_hz * float(ratio), rel=1e-9)
    assert tuned.hz(61) == pytest.approx((tuned.hz(60) * tuned.hz(62)) ** 0.5, rel=1e-9)
    moved = Tuning(TuningChoice(scale=scale(*JUST), keymap=white, transpose=1))
    assert not moved.mapped(60) and moved.mapped(61)


@pytest.mark.parametrize(
    ("field", "choice"),
    [
        ("scale", {"scale": "nothing"}),
        ("scale", {"scale": scale("3/2", "0/1")}),
        ("scale", {"scale": "! \n\nname\n 5\n 3/2\n"}),
        ("scale", {"scale": scale("-3/2", "2/1")}),
        ("scale", {"scale": scale("1e400.0", "2/1")}),
        ("scale", {"scale": scale("100.", "90000000.")}),
        ("scale", {"scale": scale(*(f"{n}." for n in range(1, 1_100)))}),
        ("keymap", {"keymap": "12\n"}),
        ("keymap", {"keymap": keymap(hz=0)}),
        ("keymap", {"keymap": keymap(hz=-440)}),
        ("keymap", {"keymap": keymap(0, "x")}),
        ("keymap", {"keymap": keymap(0, 2_000_000_000)}),
        ("keymap", {"keymap": keymap(0, middle=2_000_000_000)}),
        ("keymap", {"keymap": keymap(0, reference=2_000_000_000)}),
        ("keymap", {"keymap": keymap("nan")}),
        ("keymap", {"keymap": keymap(0, 1, "α")}),
    ],
)
def test_what_gives_no_pitch_is_refused(field: str, choice: dict[str, str]) -> None:
    with pytest.raises(ValueError, match=field):
        TuningChoice.model_validate(choice)


@pytest.mark.parametrize(("said", "listed"), [(7, 12), (12, 7), (7, 6), (10**4000, 7), (3, 0)])
def test_a_scale_that_miscounts_its_notes_is_refused(tmp_path: Path, said: int, listed: int) -> None:
    path = tmp_path / "wrong.scl"
    tones = "".join(f" {100 * n}. ! a note\n" for n in range(1, listed + 1))
    path.write_text(f"! wrong.scl\na scale\n {said}\n!\n{tones}")
    message = (
        f"wrong.scl: scale: says {str(said)[:20]} notes and lists {listed}; correct its count or its list of notes"
    )
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        read_scala(path)
    assert len(str(caught.value)) < 300

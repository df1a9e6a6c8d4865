"""The programs of General MIDI, and the factory instruments that play them.

Source: General MIDI System Level 1 (MMA RP-003). Its 128 programs come in families of eight.
"""

from __future__ import annotations

DRUMS = 9  # channel 10
KIT = "concert_toms"  # which plays that channel
_NONE = 8 * ("",)
_NECK = "electric_guitar_neck_pick_up"
_BRIDGE = "electric_guitar_bridge_pick_up"

# Of each family, the file of the instrument for each of its eight programs; "": none is like it.
FAMILIES = {
    "piano": (*6 * ("piano_wires_plucked",), "harpsichord", "clavichord"),
    "chromatic percussion": ("thin_bars", "thin_bars", "toy_wires", *3 * ("thin_bars",), "stiff_rods", "cimbalom"),
    "organ": _NONE,
    "guitar": ("classical_guitar", "steel_string_acoustic", "jazz_guitar", *2 * (_NECK,), *3 * (_BRIDGE,)),
    "bass": ("upright_bass", "electric_bass", "picked_bass", "fretless_bass", *4 * ("electric_bass",)),
    "strings": (*5 * ("",), "damped_harp", "concert_harp", "timpani"),  # pizzicato, harp and timpani
    "ensemble": _NONE,
    "brass": _NONE,
    "reed": _NONE,
    "pipe": _NONE,
    "synth lead": _NONE,
    "synth pad": _NONE,
    "synth effects": _NONE,
    "ethnic": ("sitar", "banjo", "shamisen", "koto", "thumb_piano_of_wires", "", "", ""),
    "percussive": ("thin_bars", "", "soft_plate", "", *3 * ("tuned_toms",), ""),
    "sound effects": _NONE,
}


def instrument_of(program: int) -> str:
    """The file of the factory instrument for a program, 0 … 127; "" where none is like it."""
    return list(FAMILIES.values())[program // 8][program % 8]


def program_words(program: int) -> str:
    """A program for people, who count from 1, with its family."""
    missing = "" if instrument_of(program) else "; no such instrument"
    return f"program {program + 1} ({list(FAMILIES)[program // 8]}{missing})"

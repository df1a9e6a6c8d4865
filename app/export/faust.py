"""A patch's quiet string as a Faust program: a bank of its modes, whose standard parameters are freq, gain and gate.

What depends on the key stands in tables, and the modes follow from them by the stiff string's law: with η = μπ/ℓ,
ω² = (T₀η² + EIη⁴) / ρA and σ = (d₁ + d₃η²) / 2ρA are polynomials of μ². Losses by mode are no such polynomial: then
σ is right for the first partial and for the one near 3 kHz.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.instrument.facts import by_two_numbers
from app.instrument.loud_keys import LoudKey, LoudKeys
from app.instrument.strings import HIGHEST_HZ
from app.patches.patch import Amp, Body, Patch, Room
from app.patches.tuning import A4_KEY
from app.shared.version import PROGRAM, program_version
from engine.pluck import LARGEST_AMPLITUDE_MM
from engine.presets import PresetInfo
from engine.resonators.sine_transform import mode_shapes, to_modes
from engine.result_file import whole_file
from engine.voices import Ear
from engine.voices.ear import FULL_SCALES
from engine.voices.voice import ATTACK_S

WIDTHS = 9  # of plucks whose width follows the velocity: so many are in the table, and those between are interpolated
HIGHEST_SHARE_OF_RATE = 0.49
DAMPER_S = 0.003  # in which a damper comes down
LONGEST_RING_S = 10.0  # of a string without a damper
VOICES = 16
NUMBERS_A_LINE = 8


def write_faust(path: Path, patch: Patch, preset: PresetInfo, most_modes: int | None = None) -> int:
    """Writes the program, and returns how many modes it has.

    Args:
        preset: that plays the patch.
        most_modes: the lowest of them, for a program that costs less; default all below 20 kHz.

    Raises:
        ValueError: no key has a string.
        WriteError: the file cannot be written.
    """
    text, modes = faust_program(patch, preset, most_modes)
    with whole_file(path) as file:
        file.write(text.encode())
    return modes


def faust_program(patch: Patch, preset: PresetInfo, most_modes: int | None = None) -> tuple[str, int]:
    """The program's text and how many modes it has, as `write_faust` writes it. Raises ValueError as it does."""
    patch = Patch.model_validate({**dict(patch), "amp": Amp(), "body": Body(), "room": Room()})
    ear = Ear(tuple(patch.pickup.points), patch.pickup.kind)
    if preset.recorded is not None:
        raise ValueError(
            f"{patch.name}: its string was learned from a recording, which a Faust program has no modes for"
        )
    grid_points = preset.grid_points
    loud = LoudKeys(patch, ear, preset)
    low, high = patch.range
    keys = [_possible(loud, key) for key in range(low, high + 1)]
    sounding = [key for key in keys if key is not None]
    if not sounding:
        raise ValueError(f"{patch.name}: none of its keys has a possible string; change its range, strings or tuning")
    modes = min(max(key.string.modes for key in sounding), most_modes or grid_points)
    bridge = patch.pickup.kind == "bridge"
    moving = loud.polarisations
    lost = 0.0 if moving is None else patch.knobs.decay * moving.conductance_s_kg
    tables = key_tables(keys, bridge, lost, patch)
    pulls = _pulls(patch, modes, grid_points)
    ears = [[1.0] * modes if bridge else mode_shapes(np.array([point]), modes)[:, 0].tolist() for point in ear.points]
    lines = [
        *_comments(patch, modes),
        f'declare name "{patch.name}";',
        f'declare author "{patch.author.replace(chr(34), "").replace(chr(92), "") or PROGRAM}";',
        f'declare options "[midi:on][nvoices:{VOICES}]";',
        'import("stdfaust.lib");',
        "",
        f'freq = nentry("freq[unit:Hz]", 440, 1, {HIGHEST_HZ:g}, 0.001);',
        'gain = nentry("gain", 0.7, 0, 1, 0.001);',
        'gate = button("gate");',
        "",
        "// The key, and how far the pitch is from its own as the host bends it",
        f"note = {A4_KEY} + 12 * log(max(1, freq) / 440) / log(2);",
        "key = int(floor(note + 0.5));",
        "bent = pow(2, (note - key) / 12);",
        f"place = max(0, min({high - low}, key - {low}));",
        f"plays = (key >= {low}) & (key <= {high});",
        "",
        "// Of each key: ω² = μ²(t + b μ²) in rad²/s², σ = c + d μ² in 1/s, and how loudly it is struck",
        *(
            line
            for name, values in zip(("t", "b", "c", "d", "loud"), tables, strict=True)
            for line in _table(name, values, "place")
        ),
        "",
        "// The pluck: its share of the velocities, and what a millimetre of it gives each mode",
        "share = pow(max(0, min(1, (127 * gain - 1) / 126)), " + f"{_number(4**-patch.pluck.curve)});",
        f"millimetres = min({LARGEST_AMPLITUDE_MM:g}, {_number(patch.pluck.softest_mm)} * "
        f"pow({_number(patch.pluck.hardest_mm / patch.pluck.softest_mm)}, share));",
        "edge = gate > gate';",
        "strike = edge * plays * loud * millimetres;",
        *_pull_lines(pulls),
        "",
        "// A key that is released: its damper",
        *_damper_lines(patch),
        "",
        f"// Out of rest it begins within {1000 * ATTACK_S:g} ms",
        "up = gate <= 0;",
        "strikes = + (edge) ~ _;",
        "idle = (+ (1) : * (up)) ~ _;",
        f"fresh = edge & ((strikes' == 0) | (idle' > {_rest_s(patch):g} * ma.SR));",
        "age = (+ (1) : * (1 - fresh)) ~ _;",
        f"attack = 0.5 - 0.5 * cos(ma.PI * min(1, (age + 0.5) / ({ATTACK_S:g} * ma.SR)));",
        "",
        "// A mode: what is struck turns by ω / rate and shrinks by σ / rate in a frame",
        "turning(r, angle, x) = loop ~ (_, _) with {",
        "  loop(a, b) = r * (a * cos(angle) - b * sin(angle)) + x, r * (a * sin(angle) + b * cos(angle));",
        "};",
        "mode(i) = strike * pull(i) * alive : turning(exp(0 - sigma / ma.SR) * damped, omega / ma.SR) : heard with {",
        "  m2 = (i + 1) * (i + 1);",
        "  w2 = m2 * (t + b * m2) * bent * bent;",
        "  sigma = c + d * m2;",
        "  omega = sqrt(max(1, w2 - pow(sigma + damper, 2)));",
        f"  alive = w2 < pow(2 * ma.PI * min({HIGHEST_HZ:g}, {HIGHEST_SHARE_OF_RATE} * ma.SR), 2);",
        f"  heard(a, b) = {_heard(patch)};",
        "};",
        "",
        "// Where it is heard",
        *(line for n, values in enumerate(ears) for line in _constants(f"ear{n}", values)),
        "process = "
        + ", ".join(f"attack * sum(i, {modes}, mode(i) * ba.take(i + 1, ear{n}))" for n in range(len(ears)))
        + (" <: _, _;" if len(ears) == 1 else ";"),
    ]
    return "\n".join(lines) + "\n", modes


def _comments(patch: Patch, modes: int) -> list[str]:
    return [
        f"// {patch.name}, of {PROGRAM} {program_version()}: its quiet string, {modes} modes.",
        "// Quiet: each mode rings by itself. Not in it: what a hard pluck's tension does (pitch that glides, modes",
        "// that trade energy), the second polarisation, how plucks take time and vary, body, room, pedal, macros.",
        "// freq, gain and gate are Faust's; a voice is a string.",
        "// To compile, as an example:  faust2jaqt -midi -nvoices 16 FILE.dsp",
    ]


def key_tables(
    keys: list[LoudKey | None], bridge: bool = False, conductance_s_kg: float = 0.0, patch: Patch | None = None
) -> list[list[float]]:
    """t, b, c, d and loudness of each key; a silent one has its neighbour's string and no loudness.

    Args:
        bridge: the force at the bridge is heard, ρA ω²/η of each mode; ρAℓ/π of it is in the loudness.
        conductance_s_kg: of the bridge, to which the first polarisation loses energy.
        patch: whose losses by mode count; None: there are none.
    """
    rows: list[list[float]] = []
    for key in keys:
        if key is None:
            rows.append([math.nan] * 4 + [0.0])
            continue
        string = key.string.parameters if patch is None else by_two_numbers(patch, key.string.parameters)
        mass, eta2 = string.mass_per_length_kg_m, (math.pi / string.length_m) ** 2
        steady, rising = string.damping_d1_kg_m_s / (2 * mass), string.damping_d3_kg_m_s / (2 * mass) * eta2
        rows.append(
            [
                string.tension_n / mass * eta2,
                string.youngs_modulus_pa * string.second_moment_m4 / mass * eta2**2,
                steady + conductance_s_kg * string.tension_n / string.length_m,
                rising,
                key.gain * key.string.shortened * (mass / math.sqrt(eta2) if bridge else 1.0),
            ]
        )
    table = np.array(rows)
    sounds = np.flatnonzero(~np.isnan(table[:, 0]))
    for row in np.flatnonzero(np.isnan(table[:, 0])):
        table[row, :4] = table[sounds[np.abs(sounds - row).argmin()], :4]
    return [[float(value) for value in column] for column in table.T]


def _pulls(patch: Patch, modes: int, grid_points: int) -> list[list[float]]:
    """What a pluck of 1 mm gives each mode, of full scale: a row for each width."""
    shares = np.linspace(0, 1, WIDTHS) if patch.pluck.shape != "triangular" else [0.0]
    full_scale = FULL_SCALES[patch.pickup.kind]
    found = []
    for share in shares:
        width = patch.pluck.width * (patch.pluck.width_hard / patch.pluck.width) ** float(share)
        pluck = replace(patch.pluck.pluck(1), amplitude_mm=1.0, width=width)
        found.append((to_modes(pluck.displacement(grid_points), modes) / full_scale).tolist())
    return found


def _pull_lines(pulls: list[list[float]]) -> Iterable[str]:
    if len(pulls) == 1:
        yield from _constants("pulls", pulls[0])
        yield "pull(i) = ba.take(i + 1, pulls);"
        return
    modes = len(pulls[0])
    yield f"row = min({len(pulls) - 2}, int(share * {len(pulls) - 1}));"
    yield f"between = share * {len(pulls) - 1} - row;"
    yield from _table("pulls(n)", [value for row in pulls for value in row], "n")
    yield f"pull(i) = pulls(row * {modes} + i) * (1 - between) + pulls((row + 1) * {modes} + i) * between;"


def _damper_lines(patch: Patch) -> Iterable[str]:
    if patch.damping.let_ring:
        yield "damper = 0;"
        yield "damped = 1;"
        return
    rate = math.log(1000) / patch.damping.release_t60_s
    yield f"damper = {_number(rate)} * up;"
    yield f"damped = exp(0 - damper * (up : si.smooth(ba.tau2pole({DAMPER_S}))) / ma.SR);"


def _rest_s(patch: Patch) -> float:
    """So long after a key was released its string is at rest."""
    return LONGEST_RING_S if patch.damping.let_ring else patch.damping.release_t60_s


def _heard(patch: Patch) -> str:
    """Displacement of a mode that is released at rest, its velocity, or its force at the bridge less a factor."""
    if patch.pickup.kind == "velocity":
        return "0 - b * w2 / omega"
    displacement = "a + b * sigma / omega"
    return displacement if patch.pickup.kind == "displacement" else f"({displacement}) * w2 / (i + 1)"


def _table(name: str, values: list[float], index: str) -> Iterable[str]:
    yield f"{name} = waveform{{"
    yield from _rows(values)
    yield f"}}, int({index}) : rdtable;"


def _constants(name: str, values: list[float]) -> Iterable[str]:
    yield f"{name} = ("
    yield from _rows(values)
    yield ");"


def _rows(values: list[float]) -> Iterable[str]:
    for start in range(0, len(values), NUMBERS_A_LINE):
        last = start + NUMBERS_A_LINE >= len(values)
        yield "  " + ", ".join(map(_number, values[start : start + NUMBERS_A_LINE])) + ("" if last else ",")


def _number(value: float) -> str:
    return f"{value:.9g}"


def _possible(loud: LoudKeys, key: int) -> LoudKey | None:
    try:
        return loud.of_key(key)
    except ValueError:
        return None

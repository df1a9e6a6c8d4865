"""The laws of a string, of its modes, and of how a key, a bend, a slide, a damper or a knob changes it.

They are plain functions: Python calls them as they are, and compiled functions call them compiled, without fast
mathematics (`engine.kernels.compiled.LAWS`). A string is a row of eight numbers, the fields of `StringParameters`.
Pitch is that of the first partial of a quiet pluck, √(ω₁² - σ₁²)/2π. The source of ω, σ and k is in
`engine.resonators.string`, that of losses by mode in `engine.resonators.losses`.

What takes a `Mode` takes the number of one, from 1, or an array of numbers; only Python gives arrays.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from engine import bounds
from engine.kernels import constants as of

if TYPE_CHECKING:  # what has strings does without NumPy
    from collections.abc import MutableSequence, Sequence

    import numpy as np

    Row: TypeAlias = Sequence[float] | np.ndarray
    Out: TypeAlias = MutableSequence[float] | np.ndarray
Mode = TypeVar("Mode", float, "np.ndarray")

_BOUNDS = tuple(bounds.STRING.values())
ROUNDS = 4  # σ₁ depends on the length, a little
MUTED_M = 0.05
MUTED_SHARE = 0.25
MUTED_SIGMA = 300.0  # of a palm mute: m, of the string at most, 1/s
TOUCH_RESISTANCE = 1.0  # of a finger that touches a string, over the string's own √(TρA): an estimate


def possible(string: Row) -> bool:
    """Return True if all numbers are finite and within bounds, as `StringParameters` checks them."""
    for place in range(of.STRING):
        value = string[place]
        low, high = _BOUNDS[place]
        if not low <= value <= high:
            return False
    return True


def mass(string: Row) -> float:
    """ρA in kg/m."""
    return string[of.DENSITY] * string[of.AREA]


def wavenumber(string: Row, mode: Mode) -> Mode:
    """η = μπ/ℓ in rad/m."""
    return mode * math.pi / string[of.LENGTH]


def decay_rate(string: Row, mode: Mode) -> Mode:
    """σ = (d₁ + d₃η²) / 2ρA in 1/s: a free mode decays as exp(-σt)."""
    eta = wavenumber(string, mode)
    return (string[of.D1] + string[of.D3] * eta * eta) / (2 * mass(string))


def omega_squared(string: Row, mode: Mode) -> Mode:
    """ω² = (EIη⁴ + T₀η²) / ρA in 1/s²."""
    eta = wavenumber(string, mode)
    squared = eta * eta
    return (string[of.MODULUS] * string[of.MOMENT] * squared * squared + string[of.TENSION] * squared) / mass(string)


def coupling(string: Row, mode: Mode) -> Mode:
    """k = EAη² / 4ρA in 1/s²: a mode has the additional acceleration -k q Σ η_m² q_m²."""
    eta = wavenumber(string, mode)
    return string[of.MODULUS] * string[of.AREA] / (4 * mass(string)) * eta * eta


def bridge_force(string: Row, mode: Mode) -> Mode:
    """Force of a mode at amplitude 1 m on the support at x = 0, in N: T₀η + EIη³.

    The transverse force that a stiff string exerts on its support is T₀ ∂y/∂x - EI ∂³y/∂x³ (N. H. Fletcher,
    T. D. Rossing, "The Physics of Musical Instruments", 2nd ed., sections 2.12 and 2.18).
    """
    eta = wavenumber(string, mode)
    return string[of.TENSION] * eta + string[of.MODULUS] * string[of.MOMENT] * eta**3


def modes_below(string: Row, frequency_hz: float) -> int:
    """The number of modes whose undamped frequency lies below."""
    omega = 2 * math.pi * max(frequency_hz, 0.0)
    count = int(string[of.LENGTH] / math.pi * math.sqrt(_eta_squared(string, mass(string) * omega * omega)))
    # rounding may put it one beside the mode that lies at the frequency itself
    while count > 0 and math.sqrt(omega_squared(string, count)) >= omega:
        count -= 1
    while math.sqrt(omega_squared(string, count + 1)) < omega:
        count += 1
    return count


def _eta_squared(string: Row, load: float) -> float:
    """η² of EIη⁴ + T₀η² = load, without the difference of near numbers."""
    tension, bending = string[of.TENSION], string[of.MODULUS] * string[of.MOMENT]
    return 2 * load / (tension + math.sqrt(tension * tension + 4 * bending * load))


def pitch_hz(string: Row) -> float:
    """The frequency of the first partial of a quiet pluck; 0 where it does not oscillate."""
    sigma = decay_rate(string, 1)
    return math.sqrt(max(0.0, omega_squared(string, 1) - sigma * sigma)) / (2 * math.pi)


def turned(string: Row, knobs: Row, out: Out) -> None:
    """The string with multipliers, those of an instrument's knobs; pitch and decay rates stay, nearly.

    Each number stays within its bounds: a knob turns no string into an impossible one.
    """
    area = knobs[of.VALUE.knobs_gauge] ** 2
    heavier = area * knobs[of.VALUE.knobs_density]
    out[of.LENGTH] = string[of.LENGTH] * knobs[of.VALUE.knobs_length] * math.sqrt(knobs[of.VALUE.knobs_tension])
    out[of.AREA] = string[of.AREA] * area
    out[of.MOMENT] = string[of.MOMENT] * knobs[of.VALUE.knobs_stiffness] * knobs[of.VALUE.knobs_gauge] ** 4
    out[of.DENSITY] = string[of.DENSITY] * knobs[of.VALUE.knobs_density]
    out[of.MODULUS] = string[of.MODULUS] * knobs[of.VALUE.knobs_modulus]
    out[of.D1] = string[of.D1] * knobs[of.VALUE.knobs_decay] * heavier
    out[of.D3] = string[of.D3] * knobs[of.VALUE.knobs_brightness_decay] * heavier
    out[of.TENSION] = string[of.TENSION] * heavier * knobs[of.VALUE.knobs_tension] * knobs[of.VALUE.knobs_length] ** 2
    for place in range(of.STRING):
        low, high = _BOUNDS[place]
        out[place] = min(max(out[place], low), high)


def fretted(string: Row, wanted_hz: float) -> float:
    """The length in m that gives the string a pitch."""
    sigma, squared = decay_rate(string, 1), 0.0
    for _ in range(ROUNDS):
        load = mass(string) * ((2 * math.pi * wanted_hz) ** 2 + sigma * sigma)
        squared = _eta_squared(string, load)
        sigma = (string[of.D1] + string[of.D3] * squared) / (2 * mass(string))
    return math.pi / math.sqrt(squared)


def chosen(strings: Any, count: int, key: int) -> int:
    """The string of a set that a key chooses: the highest at or below the key, else the lowest.

    Args:
        strings: records or objects with the key of each open string as its `note`, the highest first.
        count: the number of strings.
    """
    for number in range(count):
        if strings[number].note <= key:
            return number
    return count - 1


def played(strings: Any, count: int, key: int, number: int) -> int:
    """The string of a set on which a key is played.

    Args:
        number: the string that is wanted; -1, or one that the set does not have or that would have to be slackened
            too far: the one that the key chooses.
    """
    if 0 <= number < count and key >= strings[number].note - of.MOST_SLACKENED:
        return number
    return chosen(strings, count, key)


def stop(string: Row, knobs: Row, slackened: float, pitch_hz: float, whole: Out, out: Out) -> bool:
    """Write the whole string with its knobs, and what a key leaves of it; False: that is no possible string.

    Args:
        slackened: ratio of its pitch to that of the whole string as it is; 1: not slackened.
        pitch_hz: of the key.
    """
    turned(string, knobs, whole)
    if slackened != 1.0 and possible(whole):
        whole[of.TENSION] = bent(whole, slackened)
    for place in range(of.STRING):
        out[place] = whole[place]
    if possible(whole):
        out[of.LENGTH] = fretted(whole, pitch_hz)
    return possible(out)


def is_wound(string: Row) -> bool:
    """Return True if it is wound: denser, by volume of core, than metal, or than gut and nylon."""
    return string[of.DENSITY] > (8_900.0 if string[of.MODULUS] > 5e10 else 2_000.0)


def thin(string: Out, pitch_hz: float) -> None:
    """Make it the octave string of its course: half as thick, equally tight, with twice the pitch by its length."""
    for place in (of.AREA, of.D1, of.D3):
        string[place] *= 0.25
    string[of.MOMENT] *= 0.0625
    string[of.LENGTH] = fretted(string, 2 * pitch_hz)


def bent(string: Row, ratio: float) -> float:
    """The tension in N that raises the string's pitch by a ratio; not above 0 where there is none."""
    if ratio == 1.0:
        return string[of.TENSION]
    eta, sigma = math.pi / string[of.LENGTH], decay_rate(string, 1)
    wanted = ratio * 2 * math.pi * pitch_hz(string)
    bending, squared = string[of.MODULUS] * string[of.MOMENT], eta * eta
    return (mass(string) * (wanted * wanted + sigma * sigma) - bending * squared * squared) / squared


def slid(string: Row, ratio: float) -> float:
    """The length in m that raises the string's pitch by a ratio."""
    return string[of.LENGTH] if ratio == 1.0 else fretted(string, ratio * pitch_hz(string))


def damped(string: Row, t60_s: float) -> float:
    """d₁ with which each partial decays by 60 dB more in so many seconds."""
    return string[of.D1] + 2 * mass(string) * math.log(1000.0) / t60_s


def overdamped(string: Row, modes: int) -> bool:
    """Return True if the first or the last mode does not swing; otherwise all do."""
    first = decay_rate(string, 1) < math.sqrt(omega_squared(string, 1))
    return not (first and decay_rate(string, modes) < math.sqrt(omega_squared(string, modes)))


def loss(string: Row, partial: Mode, air: float, friction: float, bending: float) -> Mode:
    """σ in 1/s that losses by mode add, see `engine.resonators.losses`."""
    omega, eta = omega_squared(string, partial) ** 0.5, wavenumber(string, partial)
    diameter = 2 * math.sqrt(string[of.AREA] / math.pi)
    drag = (math.pi * of.AIR_VISCOSITY_PA_S * of.AIR_DENSITY_KG_M3 * omega / (2 * math.pi)) ** 0.5
    bent = string[of.MODULUS] * string[of.MOMENT] * eta * eta
    inside = (string[of.TENSION] * friction + bent * bending) / (string[of.TENSION] + bent)
    return air * math.pi * (of.AIR_VISCOSITY_PA_S + diameter * drag) / mass(string) + 0.5 * omega * inside


def mute(string: Row, modes: int, pairs: int, share: float, out: Out) -> None:
    """Add to σ, in `out` as `rows` writes it, the losses to a hand that lies on the string from the bridge on.

    `share`: strength of the mute, 0 … 1.

    A resistance per length from 0 to a gives σ_n = σ∞ (1 - sin(2ηa) / 2ηa): low partials ring on, high ones stop.
    Length and σ∞ are estimates: E2 of a guitar then falls by 60 dB in half a second, its tenth partial in 20 ms.
    """
    covered = min(MUTED_M / string[of.LENGTH], MUTED_SHARE)
    for mode in range(modes):
        turn = 2 * math.pi * partial_of(mode, pairs) * covered
        before, most = out[modes + mode], of.HIGHEST_SIGMA * math.sqrt(out[mode])
        out[modes + mode] = max(before, min(before + share * MUTED_SIGMA * (1 - math.sin(turn) / turn), most))


def touch(string: Row, modes: int, pairs: int, node: int, out: Out) -> None:
    """Add to σ, in `out` as `rows` writes it, the losses to a finger that touches the string at 1/node of its length.

    A resistance R at x gives σ_n = R/(ρAℓ) sin²(nπx/ℓ), to first order (Rayleigh, Theory of Sound, § 102): partials
    with a node there stay as they are. With R = √(TρA) the largest is 2 f₁.
    """
    largest = TOUCH_RESISTANCE * math.sqrt(string[of.TENSION] / mass(string)) / string[of.LENGTH]
    for mode in range(modes):
        moves = math.sin(math.pi * partial_of(mode, pairs) / node) ** 2
        before, most = out[modes + mode], of.HIGHEST_SIGMA * math.sqrt(out[mode])
        out[modes + mode] = max(before, min(before + largest * moves, most))


def stand(string: Row, modes: int, pairs: int, conductance: tuple[float, float], out: Out) -> None:
    """Move what pairs lose to a shared bridge from σ, in `out` as `rows` writes it, to a fifth row behind η².

    `conductance`: the shared part of the bridge's, in both directions, in s/kg.
    """
    pull = string[of.TENSION] / string[of.LENGTH]
    for mode in range(modes):
        lost = pull * conductance[direction_of(mode, pairs)]
        shared = min(lost, out[modes + mode]) if mode < 2 * pairs else 0.0
        out[modes + mode] -= shared
        out[4 * modes + mode] = shared


def partial_of(mode: int, pairs: int) -> int:
    """The partial, from 1, of a mode, from 0: pairs come first, the two polarisations side by side."""
    return (mode // 2 if mode < 2 * pairs else mode - pairs) + 1


def direction_of(mode: int, pairs: int) -> int:
    """0: the first polarisation; 1: the second."""
    return mode % 2 if mode < 2 * pairs else 0


def rows(
    string: Row,
    modes: int,
    pairs: int,
    detuning: float,
    conductance: tuple[float, float],
    losses: tuple[float, float, float],
    out: Out,
) -> None:
    """ω², σ, k and η² of the lowest modes, one after the other, (4 modes,).

    Of two polarisations, see `engine.values.string.Polarisations`.

    Args:
        pairs: partials of two modes, whose ω² are in the ratio `detuning`; 0: there is one direction.
        conductance: of the bridge in both directions, in s/kg.
        losses: by mode, to the air, by friction and by bending; 0 for none.
    """
    pull = string[of.TENSION] / string[of.LENGTH]
    for mode in range(modes):
        partial, direction = partial_of(mode, pairs), direction_of(mode, pairs)
        squared = omega_squared(string, partial)
        if direction == 1:
            squared *= detuning
        sigma = decay_rate(string, partial)
        added = pull * conductance[direction]
        if losses[0] + losses[1] + losses[2] > 0.0:
            added += loss(string, partial, *losses)
        out[mode] = squared
        out[modes + mode] = min(sigma + added, of.HIGHEST_SIGMA * math.sqrt(squared)) if added > 0.0 else sigma
        out[2 * modes + mode] = coupling(string, partial)
        out[3 * modes + mode] = wavenumber(string, partial) ** 2

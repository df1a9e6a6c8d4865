"""Reasons why a pluck is silent, in words for the user; every function returns "" where it found none."""

from __future__ import annotations

import math

import numpy as np

from app.presets.library import Library
from app.rendering import SOURCES, Take
from app.session.choices import Choices
from app.session.slots import info_of, other_preset
from app.shared.parameters import OF_CHOICES
from engine.presets import outside_training
from engine.resonators.sine_transform import to_modes

FAINT_DB = -70.0  # peak, relative to full scale, below which a difference is called too soft to hear
AT_ONCE_S = 0.01  # a model that runs away earlier is said to fail at once


def why_silent(choices: Choices, library: Library) -> str:
    """A reason that is known before anything is rendered: from amplitude, volume, presets, points and modes."""
    if choices.pluck.amplitude_mm == 0:
        return "silent: the amplitude is 0"
    if choices.volume_db <= OF_CHOICES["volume_db"].limits[0]:
        return "silent: the volume is at its minimum"
    if (name := other_preset(choices.source_heard)) and library.find(name) is None:
        return f"silent: the preset {name} was not found"
    return _why_points_silent(choices) or _why_solo_silent(choices, library)


def why_ran_away(take: Take) -> str:
    """The time when a take's model was silenced, because its output grew without bound, and the remedy."""
    if take.model_ends_s is None:
        return ""
    model, outside = f"model of {take.info.title}", "; ".join(outside_training(take.info, take.pluck))
    what = f"The {model} cannot play this pluck and is silent: its output grows without bound at once."
    if take.model_ends_s >= AT_ONCE_S:
        when = f"{take.model_ends_s:.2f} s after the pluck"
        what = f"The output of the {model} grew without bound {when}; it is silent from there."
    if outside:
        return f"{what} It was not trained for such plucks ({outside}). Choose one inside it; the truth plays."
    return f"{what} Choose another pluck or another preset; the truth plays."


def why_difference_silent(choices: Choices, take: Take) -> str:
    """The reason why a take's difference cannot be heard; "" also until its signals are complete."""
    ear, listened = choices.ear, take.listened
    if listened.ear != ear or not listened.complete:
        return ""
    model, truth = (listened.signals[name].read() for name in SOURCES)
    peak = float(np.abs(model - truth).max(initial=0.0)) / ear.full_scale
    if peak == 0:
        return "silent: model and truth are identical here"
    peak_db = 20 * math.log10(peak) + choices.difference_gain_db
    if peak_db < FAINT_DB:
        return f"too soft to hear: the difference peaks at {peak_db:.0f} dB; raise its gain"
    return ""


def _why_points_silent(choices: Choices) -> str:
    """The reason why a listening point is silent: it lies at a fixed end, or on a node of the soloed mode."""
    ear = choices.ear
    silent_points = [point for point in ear.points if ear.is_on_node(point)]
    if not silent_points:
        return ""
    place = "a fixed end" if all(point in (0.0, 1.0) for point in silent_points) else f"a node of mode {ear.solo}"
    if not choices.stereo:
        return f"silent: the listening point is at {place}"
    if len(silent_points) == 2:
        return f"silent: both listening points are at {place}"
    return f"{'left' if ear.is_on_node(choices.listen) else 'right'} silent: its listening point is at {place}"


def _why_solo_silent(choices: Choices, library: Library) -> str:
    """The reason why a soloed mode is silent: the string lacks it, or the pluck does not excite it."""
    entry = library.find(other_preset(choices.source_heard) or choices.preset)
    if choices.solo == 0 or entry is None:
        return ""
    info = info_of(choices, entry)
    if choices.solo > info.modes:
        return f"silent: mode {choices.solo} is soloed, and this string has {info.modes}"
    amplitudes = np.abs(to_modes(choices.pluck.displacement(info.grid_points), choices.solo))
    if float(amplitudes[-1]) < 1e-4 * choices.pluck.amplitude_mm / 1000:
        return f"silent: this pluck does not excite mode {choices.solo}, which is soloed"
    return ""

"""A preset's facts in words for a musician."""

from __future__ import annotations

import math

from engine.presets import PresetInfo

_MODELS = {
    "dmd": ("DMD", "fixed partials fitted to the data: each has one frequency and one decay"),
    "koopman": ("Koopman", "learned partials, each of one frequency and one decay"),
    "koopman_var": ("Koopman, variable", "learned partials whose pitch and decay depend on the amplitude"),
    "koopman_integrated": (
        "Integrated phase",
        "learned partials whose pitch glides down with the tension as the string decays",
    ),
    "koopman_tension": ("Koopman, shared tension", "one model for every string: all partials glide with one tension"),
    "lru": ("LRU", "a deep recurrent network of linear resonances"),
    "s5": ("S5", "a deep state-space network"),
    "fgru": ("Fourier GRU", "a gated recurrent network over the whole string"),
    "frnn": ("Fourier RNN", "a recurrent network over the whole string"),
}


LEAST_SHARE = 1e-5  # smaller ones are shown as less than this
NOTICEABLE = 0.01  # relative error from which a model is called inaccurate


def model_word(model: str) -> str:
    """The name that a model is shown with; its key in `MODELS` where it has no name here."""
    return _MODELS.get(model, (model, ""))[0]


def model_meaning(model: str) -> str:
    """The behaviour of such a model, in one phrase; "" where none is written here."""
    return _MODELS.get(model, ("", ""))[1]


def string_word(tension_modulated: bool) -> str:
    return "pitch glide (tension-modulated)" if tension_modulated else "linear"


def initial_word(initial: str) -> str:
    return {"gaussian": "plucked", "noise": "random shapes", "pluck": "plucked anywhere"}.get(initial, initial)


def shape_word(shape: str) -> str:
    """A pluck's shape within a sentence."""
    return "Gaussian" if shape == "gaussian" else shape.replace("_", " ")


def rate_word(rate_hz: int) -> str:
    return f"{rate_hz / 1000:g} kHz"


def size_word(size_bytes: int) -> str:
    return f"{size_bytes / 2**20:.1f} MB" if size_bytes >= 2**20 else f"{size_bytes / 2**10:.0f} kB"


def error_word(info: PresetInfo) -> str:
    """The relative mean absolute error on validation data, in percent; "–" where it is not known."""
    return "–" if info.rel_mae is None else percent(info.rel_mae)


def why_no_middle(info: PresetInfo) -> str:
    """The reason why no pluck is the middle of a preset's training; "" where there is one."""
    if info.middle_pluck is not None:
        return ""
    if info.recorded is not None:
        return "Its string was learned from a recording, not from plucks"
    if info.family is not None:
        return "It was trained on many strings, each with plucks of its own: what lies outside is hatched"
    return "It was trained on random shapes, and no pluck is like them"


def judged(outside: str, error: float) -> tuple[str, bool]:
    """The part outside the training, in words that its error decides; and True if that is a warning.

    Args:
        outside: as of `outside_training`, joined; "": nothing.
        error: the largest relative error of the pluck; not a number: not measured yet.
    """
    if not outside or math.isnan(error):
        return outside, False
    return (f"inaccurate: {outside}", True) if error >= NOTICEABLE else (f"accurate, although {outside}", False)


def percent(share: float, digits: int = 2) -> str:
    """A share in percent: so many digits below 10 %, as many decimals as `digits` − 2 from there on.

    Shares below LEAST_SHARE are shown as less than that.
    """
    if share < LEAST_SHARE:
        return f"< {100 * LEAST_SHARE:g} %"
    return f"{100 * share:.{digits}g} %" if share < 0.1 else f"{100 * share:.{max(0, digits - 2)}f} %"

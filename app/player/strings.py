"""The string of each key before anybody plays it, by the laws of `engine.kernels.strings`, as the player has it.

Pitch is that of the first partial of a quiet pluck. A key changes the length alone, a slackened string the tension
alone. Both are solved for the pitch in closed form and are exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.instruments.drums import Drums
from app.instruments.instrument import Fretted, Instrument
from app.instruments.tuning import Tuning
from app.player.effects import body_curves
from engine.bounds import LARGEST_AMPLITUDE_MM
from engine.kernels import constants as of
from engine.kernels import strings as law
from engine.kernels.constants import HIGHEST_HZ, LENGTH, MOST_MODES
from engine.parameters import PLAYED
from engine.pluck import Pluck
from engine.presets import PresetInfo
from engine.resonators.base import Array
from engine.resonators.losses import loss_rates
from engine.resonators.string import decay_rates as law_rates
from engine.values.ear import Ear
from engine.values.string import StringParameters

# names of the knobs, in the order of the kernels
KNOBS = tuple(id.removeprefix("knobs.") for id in PLAYED[: of.KNOBS])


@dataclass(frozen=True)
class KeyString:
    """The string that a key plays, before bends, slides and dampers.

    Attributes:
        pitch_hz: frequency of the first partial of a quiet pluck.
        modes: how many it sounds with.
        shortened: its length as a share of the whole string's. Amplitudes are reduced by it, so that the tension
            rises as much as on the whole string.
    """

    key: int
    parameters: StringParameters
    pitch_hz: float
    modes: int
    shortened: float = 1.0


class Strings:
    """The strings of an instrument, by key."""

    def __init__(self, instrument: Instrument) -> None:
        """Raise ValueError: the tuning is impossible."""
        self.instrument = instrument
        self._tuning = Tuning(instrument.tuning)

    def of_key(self, key: int, string: int | None = None) -> KeyString | None:
        """The string of a key; None for a key beyond the instrument's range, or one that its tuning leaves out.

        Args:
            string: on which of a set the key is played, counted from the highest, 0. The key itself chooses where it
                is None, is not in the set, or would have to be slackened too far.

        Raises:
            ValueError: no string has that pitch; the message names the key and what is impossible.
        """
        pitch_hz = self.pitch_hz(key)
        if pitch_hz is None:
            return None
        if isinstance(self.instrument.strings, Drums):
            raise ValueError(
                f"key {key} of {self.instrument.name} is a drum, and no string; choose an instrument of strings"
            )
        try:
            parameters, shortened = self._stopped(key, string, pitch_hz)
            modes = min(parameters.modes_below(HIGHEST_HZ), MOST_MODES)
            if modes < 1:
                raise ValueError(f"it would have no partial below {HIGHEST_HZ:g} Hz; choose a lower key")
        except ValueError as error:
            raise ValueError(f"key {key} of {self.instrument.name}, {pitch_hz:.4g} Hz: {error}") from error
        return KeyString(key, parameters, pitch_hz, modes, shortened)

    def pitch_hz(self, key: int) -> float | None:
        """The pitch of a key; None as in `of_key`."""
        low, high = self.instrument.range
        if isinstance(self.instrument.strings, Drums) and self.instrument.strings.of_key(key) is None:
            return None
        return self._tuning.hz(key) if low <= key <= high and self._tuning.mapped(key) else None

    def open_hz(self, note: int) -> float:
        """The pitch of an open string, which the range does not limit."""
        return self._tuning.hz(note)

    def _stopped(self, key: int, number: int | None, pitch_hz: float) -> tuple[StringParameters, float]:
        """The string of a key with the instrument's knobs, shortened or slackened to a pitch.

        Args:
            number: of the string in a set, from the highest, 0; None: the key chooses.

        Returns:
            The string, and its length as a share of the whole string's.
        """
        strings, slackened = self.instrument.strings, 1.0
        assert not isinstance(strings, Drums)
        if isinstance(strings, Fretted):
            string = strings.string
        else:
            ordered = strings.strings[::-1]
            open_string = ordered[law.played(ordered, len(ordered), key, -1 if number is None else number)]
            string = open_string.string
            if key < open_string.note:
                slackened = pitch_hz / self._tuning.hz(open_string.note)
        knobs = [getattr(self.instrument.knobs, name) for name in KNOBS]
        whole, stopped_row = [0.0] * of.STRING, [0.0] * of.STRING
        law.stop(string.row, knobs, slackened, pitch_hz, whole, stopped_row)
        if not whole[of.TENSION] > 0:
            raise ValueError(f"key {key}: no tension slackens its string so far; choose a higher key")
        parameters = StringParameters(*stopped_row)  # or what is out of bounds is named
        return parameters, parameters.length_m / whole[LENGTH]


def decay_rates(instrument: Instrument, string: StringParameters, modes: int) -> Array:
    """The decay rates σ of the modes of an instrument's string in 1/s, (modes,).

    They follow from its own losses: d₁, d₃, and those by mode.
    """
    rates, knobs = law_rates(string, modes), instrument.knobs
    if instrument.losses is not None:
        rates = rates + loss_rates(instrument.losses, string, modes, knobs.decay, knobs.brightness_decay)
    return rates


class StringKeys(Strings):
    """The strings as played by a preset and heard at `ear`, with their common values. The player computes gains.

    Args:
        near: keys of nearly the same instrument, of which the body's curves are taken instead, in no time.
    """

    def __init__(self, instrument: Instrument, ear: Ear, preset: PresetInfo, near: StringKeys | None = None) -> None:
        """Raise ValueError: the tuning is impossible, or the instrument has drums."""
        if isinstance(instrument.strings, Drums):
            raise ValueError(f"{instrument.name} has drums, and no strings; choose an instrument of strings")
        super().__init__(instrument)
        self.ear = ear
        self.recorded = preset.recorded  # what a recording adds to the string; None: nothing was recorded
        # a recorded string moves as its recording says
        self.polarisations = instrument.polarisations if preset.recorded is None else None
        self.body: Array | None = body_curves(instrument) if near is None else near.body

    def of_key(self, key: int, string: int | None = None) -> KeyString | None:
        """The string of a key, as of `Strings`.

        Raises:
            ValueError: as there; or a mode is overdamped, or a recorded string would be heard at the bridge.
        """
        key_string = super().of_key(key, string)
        if key_string is None:
            return None
        if self.recorded is not None and self.ear.pickup == "bridge":
            raise ValueError(f"{self.instrument.name}: a string learned from a recording has no force at a bridge")
        if law.overdamped(key_string.parameters.row, key_string.modes):
            raise ValueError(f"key {key} of {self.instrument.name}: a mode is overdamped; lower the damping")
        return key_string


def on_string(string: KeyString, pluck: Pluck) -> Pluck:
    """A pluck of the whole string, with its amplitude reduced for the part that a key leaves of the string."""
    return replace(pluck, amplitude_mm=min(pluck.amplitude_mm * string.shortened, LARGEST_AMPLITUDE_MM))

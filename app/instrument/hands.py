"""Where the wheels and pedals of a player's channels stand, and what they do to what was struck on each.

A channel's own wheel and pedal hold for what was struck on it. Those of the first channel hold for the keys of the
computer and the screen too, which have none, and in MPE, as the master's, for every channel.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from app.instrument import events
from app.instrument.events import KEYS, Bend, Controller, Event
from app.patches.patch import Patch, StringSet

FIRST = 0
MPE_BEND_SEMITONES = 48.0  # range of the pitch wheel of a member channel
WIDEST_SEMITONES = 96.0  # that messages may ask for
GUITAR_STRINGS = 8  # at most, of a guitar that sends MIDI
_NONE, _BEND_RANGE = (127, 127), (0, 0)  # registered parameters


@dataclass
class Hand:
    """What came on one channel.

    Attributes:
        bend: of the pitch wheel, -1 … 1.
        slide: of controller 74, 0 … 127; None where it was not moved.
        range_semitones: of the pitch wheel, as messages have set it; None where they have not.
        plays: whether a note has come.
    """

    bend: float = 0.0
    pedal: bool = False
    slide: int | None = None
    range_semitones: float | None = None
    plays: bool = False
    _parameter: tuple[int, int] = _NONE

    def take_parameter(self, event: Controller) -> bool:
        """Follows the controllers that choose a parameter and set it; whether they set the range of bends."""
        coarse, fine = self._parameter
        if event.number in (events.OTHER, events.FINE_OTHER):
            self._parameter = _NONE
        elif event.number == events.REGISTERED:
            self._parameter = event.value, fine
        elif event.number == events.FINE_REGISTERED:
            self._parameter = coarse, event.value
        elif self._parameter == _BEND_RANGE and event.number == events.VALUE:
            self.range_semitones = min(float(event.value), WIDEST_SEMITONES)
            return True
        elif (
            self._parameter == _BEND_RANGE and event.number == events.FINE_VALUE and self.range_semitones is not None
        ):
            self.range_semitones = min(int(self.range_semitones) + event.value / 100, WIDEST_SEMITONES)
            return True
        return False


@dataclass
class Hands:
    """All channels.

    Attributes:
        wheel: the modulation wheel, 0 … 127, which all channels share.
    """

    channels: dict[int, Hand] = field(default_factory=dict)
    wheel: int = 0
    _wheel_by: int = FIRST  # the channel that moved it

    def of(self, channel: int) -> Hand:
        return self.channels.setdefault(channel, Hand())

    def turn_wheel(self, event: Controller) -> None:
        self.wheel, self._wheel_by = event.value, event.channel

    def reset(self, patch: Patch, channel: int) -> None:
        """Leaves the channels for which one speaks as if nobody had played on them."""
        for each in [each for each in self.channels if self.speaks_for(patch, channel, each)]:
            del self.channels[each]
        if self.speaks_for(patch, channel, self._wheel_by):
            self.wheel = 0

    def events(self) -> list[Event]:
        """What brings all of them, which are at rest, where these stand."""
        found: list[Event] = []
        for channel, hand in sorted(self.channels.items()):
            if hand.range_semitones is not None:
                semitones, cents = divmod(round(100 * hand.range_semitones), 100)
                for number, value in (
                    (events.REGISTERED, _BEND_RANGE[0]),
                    (events.FINE_REGISTERED, _BEND_RANGE[1]),
                    (events.VALUE, semitones),
                    (events.FINE_VALUE, cents),
                    (events.REGISTERED, _NONE[0]),
                    (events.FINE_REGISTERED, _NONE[1]),
                ):
                    found.append(Controller(number, value, channel))
            if hand.bend:
                found.append(Bend(hand.bend, channel))
            if hand.pedal:
                found.append(Controller(events.SUSTAIN, 127, channel))
            if hand.slide is not None:
                found.append(Controller(events.SLIDE, hand.slide, channel))
        if self.wheel:
            found.append(Controller(events.MOD_WHEEL, self.wheel, self._wheel_by))
        return found

    def rest(self) -> None:
        """Puts wheels at rest and forgets ranges; feet stay on their pedals."""
        self.wheel = 0
        for number, hand in self.channels.items():
            self.channels[number] = Hand(pedal=hand.pedal, plays=hand.plays)

    def speaks_for(self, patch: Patch, channel: int, other: int) -> bool:
        """Whether "all notes off" and "reset all controllers" on a channel are meant for another: MPE's master's."""
        return channel == other or (patch.mode == "mpe" and channel == FIRST and other != KEYS)

    def act_on(self, patch: Patch, channel: int, other: int) -> bool:
        """Whether wheel and pedal of a channel hold for what was struck on another."""
        return channel == other or (channel == FIRST and (patch.mode == "mpe" or other == KEYS))

    def pedal(self, patch: Patch, channel: int) -> bool:
        """Whether a pedal holds what was struck on a channel."""
        return any(hand.pedal for each, hand in self.channels.items() if self.act_on(patch, each, channel))

    def semitones(self, patch: Patch, channel: int) -> float:
        """How far pitch wheels bend what was struck on a channel."""
        return sum(
            hand.bend * self._range(patch, each)
            for each, hand in self.channels.items()
            if self.act_on(patch, each, channel)
        )

    def _range(self, patch: Patch, channel: int) -> float:
        asked = self.channels[channel].range_semitones
        if asked is not None:
            return asked
        member = patch.mode == "mpe" and channel not in (FIRST, KEYS)
        return MPE_BEND_SEMITONES if member else patch.bend_semitones

    def is_string(self, patch: Patch, channel: int) -> bool:
        """Whether a channel is one string of a guitar. The first one is, once another string has played."""
        if patch.mode != "guitar":
            return False
        strings = GUITAR_STRINGS
        if isinstance(patch.strings, StringSet):
            strings = min(strings, len(patch.strings.strings))
        others = (hand.plays for each, hand in self.channels.items() if FIRST < each < strings)
        return channel < strings and any(others)

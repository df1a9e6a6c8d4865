"""A patch that is played: events become voices, and change those that ring.

Strings are known by their places: a key, or a channel of a guitar, which is one string. What plucks a place again
stops its string first, or, where the patch says so, adds to its motion. A key that is released damps its string,
unless the pedal or the patch lets it ring.

Bends, slides, dampers and knobs change the modes of a string's voices, the model's and the truth's alike.

In guitar mode the first channels are the strings, the highest first, as guitars with MIDI send them. The first of
them alone may as well be a keyboard: until another has played, it plays any key, each on the string that the key
chooses. So do all further channels, and the keys of the computer and the screen (`events.KEYS`) always.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

from app.instrument import events
from app.instrument.events import Bend, Controller, Event, NoteOff, NoteOn, PatchTurned, PluckAt
from app.instrument.hands import GUITAR_STRINGS, Hands
from app.instrument.loud_keys import LoudKeys, on_string, retuned
from app.instrument.strings import KeyString, Strings, bent, chosen_string, damped, fretting, slid
from app.patches.patch import Knobs, Patch, StringSet
from app.shared.parameters import OF_PATCHES
from engine.excitation import release_factor
from engine.pluck import Pluck
from engine.presets import Preset, PresetInfo
from engine.resonators.base import Array, Resonator
from engine.resonators.sine_transform import to_grid, to_modes
from engine.resonators.string import StringParameters
from engine.voices import Ear, Program, Voice
from engine.voices.programs import solver_program, tension_program

SOURCES = ("model", "truth")
MPE_POSITIONS = (0.05, 0.5)  # pluck positions for slide 0 and 127 before the key
DAMPER_S, BEND_S, KNOB_S = 0.012, 0.006, 0.04  # of the glide to other modes
STOP_S = 0.03
PLUCK_STOPS_S = 0.006  # in which a string is stopped by what plucks it again
KEPT_KEYS = 512
GOALS = 8  # values that are tried for a wheel all the way up


@dataclass(frozen=True)
class Key:
    """What a key sounds with. It is kept, so that a strike computes no physics.

    Attributes:
        patch: that it is a key of.
        gain: the factor that makes it as loud as the other keys.
        programs: by source.
    """

    patch: Patch
    string: KeyString
    resonator: Resonator
    gain: float
    programs: dict[str, Program]


Place = tuple[int | None, int | None]  # channel and key, each None where any is the same string


@dataclass(eq=False)
class Struck:
    """A string that was struck, in its present state.

    Attributes:
        place: which string of the instrument it is.
        string: which one of the patch's set, where a guitar's channel says so: see `Strings.of_key`. None: the key
            chooses it.
        gain: the factor of its voices.
        voices: by source.
        parameters: of the string, with bends, slides, dampers and knobs.
        preset: that gives its modes.
        begin_frame: of the mixer, for which it was struck; 0: at once.
        held: whether the key is down.
        kept: whether it was released while the pedal was down.
        damped: whether the damper is on it.
    """

    place: Place
    string: int | None
    event: NoteOn
    key: Key
    pluck: Pluck
    ear: Ear
    gain: float
    voices: dict[str, Voice]
    parameters: StringParameters
    preset: PresetInfo
    begin_frame: int = 0
    held: bool = True
    kept: bool = False
    damped: bool = False
    knobs: Knobs | None = None  # as they are now
    retuning: threading.Lock = field(default_factory=threading.Lock)  # of its voices, by one thread at a time

    @property
    def over(self) -> bool:
        """Whether all its voices have ended."""
        return all(voice.over for voice in self.voices.values())

    @property
    def scheduled(self) -> bool:
        """Whether the frame for which it was struck is still to come."""
        return self.begin_frame > 0 and all(voice.waits for voice in self.voices.values())

    def retune(self, parameters: StringParameters, seconds: float, frame: int = 0) -> None:
        """Lets the voices glide to the modes of other parameters, from a frame on. Any thread; the latest counts."""
        patch = self.key.patch if self.knobs is None else self.key.patch.model_copy(update={"knobs": self.knobs})
        resonator = retuned(self.key.resonator, parameters, patch, self.preset)
        with self.retuning:
            self.parameters = parameters
            for voice in self.voices.values():
                voice.retune(resonator, seconds, frame)


class Player:
    """Plays one patch. Every public method may be called from any thread.

    Args:
        preset: a preset of many strings.
        rate_hz: of the voices.
        deliver: is called with what was struck, whose voices no mixer has yet; in the thread of the event.
        sources: which of "model" and "truth" get voices.
        ear: where strings are heard; None: at the patch's own points.

    Raises:
        ValueError: the preset learned one string only, or the tuning is impossible.
    """

    def __init__(
        self,
        patch: Patch,
        preset: Preset,
        rate_hz: int,
        deliver: Callable[[Struck], None],
        sources: Sequence[str] = SOURCES,
        ear: Ear | None = None,
    ) -> None:
        if not preset.info.of_many_strings:
            raise ValueError(
                f"{preset.path}: its model learned one string only; choose a preset of many, as studio_any_string"
            )
        self._preset, self._rate_hz, self._deliver = preset, rate_hz, deliver
        self._sources = tuple(sources)
        self._lock = threading.RLock()
        self._hands = Hands()
        self._ringing: dict[Place, Struck] = {}
        self._all: list[Struck] = []  # with those whose place was struck again, until they are over
        self._frame = 0  # at which the event counts that is being handled
        self._take(self.loud_keys(patch, ear))

    # What is played

    @property
    def patch(self) -> Patch:
        return self._patch

    @property
    def ear(self) -> Ear:
        """Where strings are heard that are struck now."""
        return self._ear

    @property
    def heard_through(self) -> Patch:
        """With the body and the room as the modulation wheel turns them."""
        return self._wheeled("body.", "room.")

    @property
    def at_hand(self) -> list[Event]:
        """The events that bring wheels and pedals of a new player where they stand."""
        with self._lock:
            return self._hands.events()

    @property
    def preset(self) -> Preset:
        return self._preset

    def set_patch(self, patch: Patch, ear: Ear | None = None) -> None:
        """Plays another patch, or the same with a knob turned; strings that ring glide to it.

        Another patch begins with its wheels at rest, for what they turned may be something else now; pedals stay.

        Args:
            ear: where strings are heard that are struck from now on; None: at the patch's own points.

        Raises:
            ValueError: the tuning is impossible; nothing has changed then.
        """
        self.take(self.loud_keys(patch, ear))
        self.glide()

    def loud_keys(self, patch: Patch, ear: Ear | None = None, nearly: bool = False) -> LoudKeys:
        """What `take` needs of a patch. It takes milliseconds, in which keys are played. Raises as `set_patch`.

        Args:
            nearly: whether body and peaks may be those of the present patch, for which it takes no time.
        """
        heard = ear or Ear(tuple(patch.pickup.points), patch.pickup.kind)
        return LoudKeys(patch, heard, self._preset.info, self._keys if nearly else None)

    def take(self, keys: LoudKeys) -> None:
        """Plays these keys from now on; strings that ring follow with `glide`."""
        with self._lock:
            before = self._patch
            self._take(keys)
            if is_another(keys.patch, before):
                self._hands.rest()

    def glide(self, frame: int = 0) -> None:
        """Lets the strings that ring glide to the patch. The lock is held for moments: keys are played meanwhile."""
        for struck in self.sounding():
            with self._lock:
                parameters = self._with_hands(struck)
            if parameters == struck.parameters:
                continue
            struck.retune(parameters, KNOB_S, frame)
            with self._lock:
                self._retune(struck, KNOB_S)  # where a wheel or a damper has moved meanwhile

    @property
    def rate_hz(self) -> int:
        return self._rate_hz

    def set_rate(self, rate_hz: int) -> None:
        """Sets the rate of voices; strings that ring are forgotten, for their voices have another one."""
        with self._lock:
            if rate_hz != self._rate_hz:
                self._rate_hz = rate_hz
                self._ringing.clear()
                self._all.clear()
                self._take(self._keys)

    def prepare(self, keys: Sequence[int] | None = None) -> None:
        """Computes what keys sound with, so that a strike need not. None: all keys of the patch."""
        low, high = self._patch.range
        for key in keys if keys is not None else range(low, high + 1):
            for string in self._strings_for(key):
                try:
                    self._key(key, string)
                except ValueError:
                    continue  # raised again when it is struck

    # Events

    def handle(self, event: Event, frame: int = 0) -> Struck | None:
        """Plays an event; what it struck, or None. A pluck at a place is none of a key's.

        Args:
            frame: of the mixer, at which it counts: a note begins with it, all else within a quantum after it. Events
                of frames to come must be given in their order. 0: at once.

        Raises:
            ValueError: a key has no possible string.
        """
        if isinstance(event, PatchTurned):
            self.take(self.loud_keys(event.patch))
            self.glide(frame)
            return None
        if isinstance(event, PluckAt):
            return None
        with self._lock:
            self._frame = frame
            try:
                return self._play(event)
            finally:
                self._frame = 0

    def cancel(self) -> None:
        """Ends strings that were struck for frames to come, without a sound; others have their places again."""
        with self._lock:
            for struck in self._all:
                if struck.scheduled:
                    for voice in struck.voices.values():
                        voice.release(STOP_S)
            self._all = [struck for struck in self._all if not (struck.over or struck.scheduled)]
            self._ringing = {struck.place: struck for struck in self._all}

    def stop(self, seconds: float = STOP_S) -> None:
        """Lets all strings fade out, and forgets them."""
        with self._lock:
            for struck in self._all:
                for voice in struck.voices.values():
                    if self._frame > 0:
                        voice.release_at(self._frame)
                    else:
                        voice.release(seconds)
            self._ringing.clear()
            self._all.clear()

    def gain_of(self, struck: Struck) -> float:
        """The factor that its string would be struck with now; the one it has where its key has another string now.

        Raises:
            ValueError: the key has no possible string.
        """
        key = self._key(struck.event.key, self._on(struck))
        return key.gain if key is not None and key.string == struck.key.string else struck.gain

    def sounding(self) -> list[Struck]:
        """The strings that ring, one for each place."""
        with self._lock:
            return list(self._sounding())

    # How it is done

    def _take(self, keys: LoudKeys) -> None:
        rate_hz, preset = self._rate_hz, self._preset

        @lru_cache(maxsize=KEPT_KEYS)
        def key_of(key: int, string: int | None) -> Key | None:
            found = keys.of_key(key, string)
            if found is None:
                return None
            programs: dict[str, Program] = {}
            for source in self._sources:
                programs[source] = (
                    solver_program(found.resonator, rate_hz)
                    if source == "truth"
                    else tension_program(preset.weights, preset.configuration, found.resonator, rate_hz)
                )
            return Key(keys.patch, found.string, found.resonator, found.gain, programs)

        self._keys, self._patch, self._ear, self._key = keys, keys.patch, keys.ear, key_of

    def _sounding(self) -> list[Struck]:
        self._all = [struck for struck in self._all if not struck.over]
        self._ringing = {place: struck for place, struck in self._ringing.items() if not struck.over}
        return list(self._ringing.values())

    def _play(self, event: NoteOn | NoteOff | Bend | Controller) -> Struck | None:
        if isinstance(event, NoteOn):
            return self._note_on(event)
        if isinstance(event, NoteOff):
            self._note_off(event)
        elif isinstance(event, Bend):
            self._hands.of(event.channel).bend = min(max(event.value, -1.0), 1.0)
            self._follow_bend(event.channel)
        else:
            self._controller(event)
        return None

    def _note_on(self, event: NoteOn) -> Struck | None:
        if event.velocity <= 0:
            self._note_off(NoteOff(event.key, event.channel))
            return None
        self._hands.of(event.channel).plays = True
        place, string = self._where(event)
        key = self._key(event.key, string)
        if key is None:
            return None
        pluck = on_string(key.string, self._pluck(event))
        release_s = self._wheeled("pluck").pluck.release_s(event.velocity)
        grid = self._preset.info.grid_points
        pulled = released(pluck.displacement(grid), key.string.parameters, release_s)
        voices = {source: Voice(program, pulled, self._ear) for source, program in key.programs.items()}
        before = self._ringing.get(place)
        if before is not None and before.over:
            before = None
        if before is not None:
            for source, voice in voices.items():
                ringing = before.voices[source]
                if not ringing.over and self._patch.pluck.stops:
                    voice.stops(ringing, PLUCK_STOPS_S)
                elif not ringing.over:
                    voice.continues(ringing)
        for voice in voices.values():
            voice.begin_at(self._frame)
        own = key.string.parameters
        struck = Struck(
            place, string, event, key, pluck, self._ear, key.gain, voices, own, self._preset.info, self._frame
        )
        parameters = self._with_hands(struck)
        if parameters != own:
            struck.retune(parameters, 0.0)
        self._sounding()
        self._ringing[place] = struck
        self._all.append(struck)
        self._deliver(struck)
        return struck

    def _note_off(self, event: NoteOff) -> None:
        for struck in self._sounding():
            if struck.held and (struck.event.key, struck.event.channel) == (event.key, event.channel):
                struck.held = False
                struck.kept = self._hands.pedal(self._patch, event.channel)
                self._damp(struck)

    def _damp(self, struck: Struck) -> None:
        """Puts the damper on a string that nothing holds."""
        if struck.held or struck.kept or struck.damped or self._patch.damping.let_ring:
            return
        struck.damped = True
        self._retune(struck, DAMPER_S)

    def _controller(self, event: Controller) -> None:
        hand = self._hands.of(event.channel)
        if event.number == events.SUSTAIN:
            hand.pedal = event.value >= events.PEDAL_DOWN
            self._damp_unkept()
        elif event.number == events.SLIDE:
            hand.slide = event.value
        elif event.number == events.MOD_WHEEL:
            self._hands.turn_wheel(event)
            self._follow_wheel()
        elif event.number == events.SOUND_OFF:
            self.stop()
        elif event.number == events.NOTES_OFF:
            for struck in self._sounding():
                if self._hands.speaks_for(self._patch, event.channel, struck.event.channel):
                    struck.held = struck.kept = False
                    self._damp(struck)
        elif event.number == events.RESET:
            self._hands.reset(self._patch, event.channel)
            self._damp_unkept()
            self._follow_bend(event.channel)
            self._follow_wheel()
        elif hand.take_parameter(event):
            self._follow_bend(event.channel)

    def _damp_unkept(self) -> None:
        """Puts the damper on strings that a pedal kept, and keeps no longer."""
        for struck in self._sounding():
            if struck.kept and not self._hands.pedal(self._patch, struck.event.channel):
                struck.kept = False
                self._damp(struck)

    def _follow_bend(self, channel: int) -> None:
        """Retunes what the pitch wheel of a channel bends."""
        for struck in self._sounding():
            if self._hands.act_on(self._patch, channel, struck.event.channel):
                self._retune(struck, BEND_S)

    def _follow_wheel(self) -> None:
        """Retunes what the modulation wheel turns."""
        if self._patch.mod_wheel.startswith("knobs."):
            for struck in self._sounding():
                self._retune(struck, KNOB_S)

    def _where(self, event: NoteOn) -> tuple[Place, int | None]:
        """The place of a note, and on which of a set's strings it is played; None where the key chooses it."""
        strings = self._patch.strings
        if not self._hands.is_string(self._patch, event.channel):
            return (event.channel if self._patch.mode == "mpe" else None, event.key), None
        chosen = not isinstance(strings, StringSet) or chosen_string(strings, event.key) == event.channel
        return (event.channel, None), None if chosen else event.channel

    def _strings_for(self, key: int) -> Iterator[int | None]:
        """On which strings a key may be struck, as in `_where`."""
        yield None
        strings = self._patch.strings
        if self._patch.mode == "guitar" and isinstance(strings, StringSet):
            others = fretting(strings, key)[1:]  # without the one that the key chooses
            yield from (number for number in others if number < GUITAR_STRINGS)

    def _on(self, struck: Struck) -> int | None:
        """On which of the present set's strings it rings; None where its key chooses it."""
        return struck.string if self._patch.mode == "guitar" else None

    def _ratio(self, struck: Struck) -> float:
        """The factor of pitch wheels on its frequency."""
        return float(2 ** (self._hands.semitones(self._patch, struck.event.channel) / 12))

    def _pluck(self, event: NoteOn) -> Pluck:
        pluck = self._wheeled("pluck").pluck.pluck(event.velocity)
        slide = self._hands.of(event.channel).slide
        if self._patch.mode == "mpe" and slide is not None:
            low, high = MPE_POSITIONS
            return replace(pluck, position=low + (high - low) * min(max(slide, 0), 127) / 127)
        return pluck

    def _wheeled(self, *parts: str) -> Patch:
        """The patch as the mod wheel turns it, where it turns anything of these parts."""
        name, share = self._patch.mod_wheel, self._hands.wheel / 127
        if share == 0 or not name.startswith(parts):
            return self._patch
        value, parameter = self._patch.value(name), OF_PATCHES[name]
        goal = value * parameter.wheel_factor if parameter.wheel is None else parameter.wheel
        for _ in range(GOALS):
            try:
                self._patch.with_value(name, goal)
            except ValueError:  # beyond its bounds: half as far
                goal = (goal + value) / 2
            else:
                return self._patch.with_value(name, value + share * (goal - value))
        return self._patch

    def _with_hands(self, struck: Struck) -> StringParameters:
        """The string of its key, with the present knobs, wheels and damper."""
        patch = self._wheeled("knobs")
        string, struck.knobs = struck.key.string.parameters, patch.knobs
        on = self._on(struck)
        try:
            strings = self._keys.string_of if patch is self._patch else Strings(patch).of_key
            if (now := strings(struck.event.key, on)) is not None:
                string = now.parameters
            string = (slid if self._patch.bend_by == "length" else bent)(string, self._ratio(struck))
            if struck.damped:
                string = damped(string, self._wheeled("damping").damping.release_t60_s)
        except ValueError:  # no such string: it stays as it is
            return struck.parameters
        return string

    def _retune(self, struck: Struck, seconds: float) -> None:
        parameters = self._with_hands(struck)
        if parameters != struck.parameters:
            struck.retune(parameters, seconds, self._frame)


def released(displacement: Array, string: StringParameters, release_s: float) -> Array:
    """A pluck on the grid as it counts when its string is released within a time."""
    if release_s == 0:
        return displacement
    modes = len(displacement) - 2
    left = release_factor(string.undamped_frequencies(modes), release_s)
    return to_grid(to_modes(displacement, modes) * left, len(displacement))


def is_another(patch: Patch, than: Patch) -> bool:
    """Whether a patch is another instrument: neither the same with a knob turned, nor the same under a new name."""
    return patch.name != than.name and patch.model_copy(update={"name": than.name}) != than

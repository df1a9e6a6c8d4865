"""The stage: all that is chosen, played and shown, as one immutable value, and the step from one to the next.

Nothing here knows the window. A note rings before the stage knows of it, in the window's thread.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from app.instruments.instrument import Instrument, StringSet
from app.player.compiled import is_another
from app.player.drum_keys import DrumKeys
from app.player.events import KEYS, NoteOn, PluckAt
from app.player.strings import KeyString, Strings, on_string
from app.playing.key_note import KeyNote
from app.playing.note import PluckVoices
from app.rendering import BlowTake, NoteSound, Take
from app.rendering.note_sound import Struck
from app.rendering.subject import string_of
from app.session.choices import OBSERVED, Choices
from app.session.slots import other_preset
from engine.pluck import Pluck
from engine.values.string import StringParameters

Note = PluckVoices | KeyNote
Key = tuple[int, int | None]  # of an instrument, and its string of the set, as in `Strings.of_key`


@dataclass(frozen=True)
class Chosen:
    """New values of `Choices`, all or none. With the preset of the instrument that is there, keys play that one.

    Attributes:
        by_user: not by a note or by undo, so that undo can take it back.
    """

    values: Mapping[str, Any]
    by_user: bool = True


@dataclass(frozen=True)
class Begun:
    """A note has begun; or its player has reported the string and the pluck of it."""

    note: Note


@dataclass(frozen=True)
class Turned:
    """The next turn of a loop has begun: a note of what was chosen already."""

    note: Note


@dataclass(frozen=True)
class Asked:
    """The motion that is to be shown is another one; None: there is none."""

    request: NoteSound | None


@dataclass(frozen=True)
class Rendered:
    """The motion that is asked for has its first block, or is complete."""

    take: Take | BlowTake
    complete: bool = False


@dataclass(frozen=True)
class Parked:
    """The playhead was put at a time of the motion, where it stands until the next note."""

    position_s: float


Event = Chosen | Begun | Turned | Asked | Rendered | Parked


@dataclass(frozen=True)
class Stage:
    """The present choices, note, motion and playhead, as one value.

    A motion is what a string or a drum does after a pluck or a blow, as it is drawn; the playhead is a time in it.

    Attributes:
        choices: instrument, string and pluck that are shown, where they are heard, what is compared.
        key: the key of an instrument that was struck or restored last; None before the first.
        note: the note that began last; None before the first.
        known: the player has reported this note.
        request: the motion that is asked for: of the chosen pluck, or of the latest blow; None: there is none.
        take: the motion that is shown.
        ready: `take` is the motion that is asked for.
        complete: all of `take` is rendered.
        lead: the note whose time the playhead follows; None: it stands at `parked_s`.
        parked: the note that the playhead was parked from, and does not follow again.
    """

    choices: Choices = field(default_factory=Choices)
    key: Key | None = None
    note: Note | None = None
    known: bool = True
    request: NoteSound | None = None
    take: Take | BlowTake | None = None
    ready: bool = False
    complete: bool = False
    lead: Note | None = None
    parked: Note | None = None
    parked_s: float = 0.0

    def position_s(self, latency_s: float) -> float:
        """The playhead: the time in the motion that is heard now, or where it stands; `latency_s`: of the output."""
        if self.take is None:
            return 0.0
        heard_s = self.parked_s if self.lead is None else max(self.lead.seconds - latency_s, self.lead.from_s)
        return min(max(heard_s, 0.0), self.take.seconds)

    @property
    def audible(self) -> bool:
        """Return True if the note of the motion rings, which may be longer than the motion."""
        return self.lead is not None and self.take is not None and not self.lead.over

    @property
    def moving(self) -> bool:
        """Return True if the playhead moves."""
        lead, take = self.lead, self.take
        return lead is not None and take is not None and not lead.over and lead.seconds < take.seconds

    @property
    def drum_key(self) -> int | None:
        """The key of the drum that is shown and struck: the latest, or the lowest; None: no drum is played."""
        drums, instrument = self.choices.drums, self.choices.instrument
        if drums is None or instrument is None:
            return None
        (low, high), latest = instrument.range, -1 if self.key is None else self.key[0]
        if low <= latest <= high and drums.of_key(latest) is not None:
            return latest
        return min(max(drums.drums[0].note, low), high)

    def shown_key(self, instrument: Instrument) -> Key:
        """The key whose string is shown: the one struck last, on its string, or the middle of the range."""
        (low, high), latest = instrument.range, self.key
        return latest if latest is not None and low <= latest[0] <= high else ((low + high) // 2, None)

    def shown_string(self, instrument: Instrument) -> KeyString | None:
        """The string of the shown key; None: it has none. Raise ValueError: it is impossible."""
        return Strings(instrument).of_key(*self.shown_key(instrument))

    def by_hand(self, pluck: Pluck | None = None) -> NoteOn | PluckAt:
        """A pluck, by default the chosen one, as a note of the key whose string is shown.

        It is of the string alone where keys do not play it so: of a single string, and beside another preset.
        """
        instrument, pluck = self.choices.played, pluck or self.choices.pluck
        beside_another = any(other_preset(voice) for voice in self.choices.voices)
        if instrument is None or self.choices.drums is not None or pluck.amplitude_mm == 0 or beside_another:
            return PluckAt(pluck)
        with contextlib.suppress(ValueError):  # reported when its key is struck
            if (string := self.shown_string(instrument)) is not None:
                velocity = instrument.pluck.velocity_of(pluck.amplitude_mm / string.shortened)
                return NoteOn(string.key, velocity, KEYS, string=self.shown_key(instrument)[1], pluck=pluck)
        return PluckAt(pluck)

    @property
    def struck(self) -> Struck | None:
        """The key of the instrument that an export and the listening test play: the latest, else the one shown.

        After a pluck by hand it is the pluck that is shown. None: a string is plucked by itself.
        """
        instrument, note, drum_key = self.choices.played, self.note, self.drum_key
        if instrument is None:
            return None
        event: NoteOn | PluckAt
        if isinstance(note, KeyNote) and note.instrument.name == instrument.name and note.event.pluck is None:
            event = note.event
        elif drum_key is not None:
            event = NoteOn(drum_key, self.choices.velocity, KEYS)
        else:
            event = self.by_hand()
        return Struck(instrument, event) if isinstance(event, NoteOn) else None

    @property
    def blow(self) -> NoteSound | None:
        """The motion of the latest blow on the drums that are played, as it is heard now; None: there is none."""
        request, note, instrument = self.request, self.note, self.choices.instrument
        if request is None or request.struck is None or not isinstance(note, KeyNote) or instrument is None:
            return None
        if note.instrument.name != instrument.name:
            return None
        return replace(request, seconds=self.choices.seconds, ear=self.choices.ear)

    @property
    def note_played(self) -> Note | None:
        """The latest note, where it is of the instrument that is played."""
        note, instrument = self.note, self.choices.played
        if not isinstance(note, KeyNote):
            return note
        return note if instrument is not None and not is_another(instrument, note.instrument) else None


NAMES = (*OBSERVED, *(name for name in Stage.__dataclass_fields__ if name != "choices"))


def first_stage(choices: Choices) -> Stage:
    """The stage with remembered choices, before anything is played."""
    return _with_own_string(Stage(choices), None, ())


def next_stage(stage: Stage, event: Event) -> Stage:
    """The stage after an event; the same one where nothing has changed.

    Raises:
        ValueError: a chosen value is out of its range, or the instrument cannot be heard so.
    """
    match event:
        case Chosen():
            return _chosen(stage, event.values)
        case Begun():
            stage = stage if event.note is stage.note and stage.known else _begun(stage, event.note)
        case Turned():
            stage = replace(stage, note=event.note, known=True)
        case Asked():
            stage = _asked(stage, event.request)
        case Rendered():
            stage = _rendered(stage, event)
        case Parked():
            return replace(stage, lead=None, parked=stage.note, parked_s=event.position_s)
    note, request = stage.note, stage.request
    if note is None or request is None or not (stage.ready and stage.known) or note in (stage.lead, stage.parked):
        return stage
    return replace(stage, lead=note) if _is_of(note, request) and not (note.released or note.over) else stage


def changed_names(before: Stage, after: Stage) -> frozenset[str]:
    """The names of what differs, of NAMES; those of `Choices` among them."""
    if after is before:
        return frozenset()
    differs = [name for name in NAMES[len(OBSERVED) :] if getattr(before, name) is not getattr(after, name)]
    if after.choices is not before.choices:
        pairs = ((name, before.choices.value(name), after.choices.value(name)) for name in OBSERVED)
        differs += [name for name, value, other in pairs if value is not other and value != other]
    return frozenset(differs)


def _chosen(stage: Stage, values: Mapping[str, Any]) -> Stage:
    """The stage with new values of its choices; see `Chosen`. Raises ValueError as `Choices.changed`."""
    instrument = stage.choices.instrument
    if instrument is not None and values.get("preset") == instrument.preset:
        values = {**{name: value for name, value in values.items() if name != "preset"}, "single": None}
    chosen = replace(stage, choices=stage.choices.changed(values))
    return _with_own_string(chosen, stage.choices.played, values)


def _begun(stage: Stage, note: Note) -> Stage:
    """The stage with a note that has begun, and with its string and pluck as soon as they are known."""
    stage = replace(stage, note=note, known=not isinstance(note, KeyNote) or note.known)
    drawn = False
    if isinstance(note, KeyNote):
        if not stage.known:
            return replace(stage, key=(note.event.key, note.event.string))
        if stage.note_played is None:  # another instrument or a single string was chosen meanwhile
            return stage
        stage, drawn = replace(stage, key=(note.event.key, note.string)), note.event.pluck is not None
        if note.of_drum:
            return _struck(stage, note)
    if note.request is None:
        return stage
    values: dict[str, Any] = {"string": string_of(note.request.preset)}
    values |= {} if drawn else {"pluck": note.request.pluck}  # else the choices have it already
    return replace(stage, choices=stage.choices.changed(values))


def _struck(stage: Stage, note: KeyNote) -> Stage:
    """The stage that asks for the motion of a blow."""
    keys, choices, event = note.player.keys, stage.choices, note.event
    if not isinstance(keys, DrumKeys) or keys.of_key(event.key) is None:
        return stage
    struck = Struck(note.instrument, event)
    return _asked(stage, NoteSound(note.path, choices.pluck, choices.seconds, choices.ear, struck=struck))


def _asked(stage: Stage, request: NoteSound | None) -> Stage:
    """The stage that asks for a motion; of a string after one of a drum, it shows none until then."""
    struck, struck_before = (asked and asked.struck is not None for asked in (request, stage.request))
    if struck != struck_before:
        stage = replace(stage, take=None, ready=False, lead=None, parked_s=0.0)
    ready = stage.ready and request is not None and request.same_motion(stage.request)
    return replace(stage, request=request, ready=ready)


def _rendered(stage: Stage, event: Rendered) -> Stage:
    """The stage with a motion, at its beginning. Where the playhead was parked after the same blow, it stays."""
    if event.take is stage.take:
        return replace(stage, ready=True, complete=stage.complete or event.complete)
    stays = isinstance(event.take, BlowTake) and stage.note is stage.parked
    parked_s = stage.parked_s if stays else 0.0
    return replace(stage, take=event.take, ready=True, complete=event.complete, lead=None, parked_s=parked_s)


def _is_of(note: Note, request: NoteSound) -> bool:
    """Return True if a note is of the pluck whose motion is asked for; where a blow's is asked for, of any drum."""
    if request.struck is not None:
        return isinstance(note, KeyNote) and note.of_drum
    return note.request is not None and (note.request.preset, note.request.pluck) == (request.preset, request.pluck)


def _with_own_string(stage: Stage, before: Instrument | None, asked: Collection[str]) -> Stage:
    """The stage that shows string and pluck of an instrument before it is played, and its pluck when that is turned.

    Args:
        before: the instrument that was played; None: there was none.
        asked: names of fields that were chosen with the instrument, as by undo or a file; these stay as chosen.
    """
    choices, instrument = stage.choices, stage.choices.played
    if instrument is None or instrument is before or choices.drums is not None:
        return stage
    another = before is not None and is_another(instrument, before)
    takes_string = choices.string is None or (another and "string" not in asked)
    if not takes_string:
        if choices.string is not None and (another or before is None):
            stage = replace(stage, key=_key_of(instrument, choices.string) or stage.key)
        if before is None or instrument.pluck == before.pluck:
            return stage
    with contextlib.suppress(ValueError):  # an impossible string is reported when its key is struck
        if (string := stage.shown_string(instrument)) is not None:
            own = asdict(on_string(string, instrument.pluck.pluck(choices.velocity)))
            values = {name: value for name, value in own.items() if not {name, "pluck"} & {*asked}}
            values |= {"string": string.parameters} if takes_string else {}
            return replace(stage, choices=choices.changed(values))
    return stage


def _key_of(instrument: Instrument, string: StringParameters) -> Key | None:
    """The key with the pitch of a string, and the string of a set on which it has its length. None: there is none."""
    strings, pitch_hz = Strings(instrument), string.pitch_hz
    low, high = instrument.range
    key = next((key for key in range(low, high + 1) if _nearly_equal(strings.pitch_hz(key) or 0.0, pitch_hz)), None)
    if key is None:
        return None
    for number in (None, *range(len(instrument.strings.strings) if isinstance(instrument.strings, StringSet) else 0)):
        with contextlib.suppress(ValueError):  # reported when it is struck
            key_string = strings.of_key(key, number)
            if key_string is not None and _nearly_equal(key_string.parameters.length_m, string.length_m):
                return key, number
    return key, None


def _nearly_equal(value: float, other: float) -> bool:
    """Return True if values are equal within rounding, for the player computes strings too."""
    return math.isclose(value, other, rel_tol=1e-6)

"""A patch that is played in the window: events of keys and MIDI become notes, each in its own thread."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.instrument.effects import body_problem, effects_of
from app.instrument.events import (
    Controller,
    Event,
    NoteOn,
    PatchTurned,
    TimedEvent,
    moves_effects,
    still_down,
)
from app.instrument.player import SOURCES, Player, Struck, is_another
from app.patches.patch import Patch, Pickup
from app.playing.due import Due
from app.playing.notes import Note, Notes
from app.playing.sources import Sources
from app.playing.stroke import Stroke
from app.rendering.subject import StringOf
from engine.effects import Effects
from engine.presets import PresetError
from engine.resonators.string import StringParameters
from engine.voices import Ear

SEEN_DB = 70.0  # below full scale: softer strings do not light their keys
LONGEST_RECORDING = 100_000  # events
FULL = (
    f"The recording is full ({LONGEST_RECORDING} notes, releases and movements of wheels and knobs): what is played "
    "from now on is not in it. End it and save it, then record again."
)


@dataclass(frozen=True, eq=False)
class _Wanted:
    """What keys are to play, and where it is heard."""

    patch: Patch
    ear: Ear


class Live:
    """Every public method may be called from any thread.

    A key waits for no knob. A turned patch is played at once, with the body's loudness and the peaks of the patch
    before; its own are computed in the background. Nothing that takes milliseconds is computed under a lock.

    Args:
        find: the path of a preset by its name; None where there is none.
        report: is called with a message and its details where something cannot be played; in any thread.
        set_effects: sets body and room of all that is heard; called in a background thread.
    """

    def __init__(
        self,
        notes: Notes,
        sources: Sources,
        find: Callable[[str], Path | None],
        report: Callable[[str, str], None],
        set_effects: Callable[[Effects | None], None] = lambda effects: None,
    ) -> None:
        self._set_effects = set_effects
        self._notes, self._sources, self._find, self._report = notes, sources, find, report
        self._lock = threading.RLock()
        self._player: Player | None = None
        self._wanted: _Wanted | None = None
        self._completed: _Wanted | None = None  # the latest wish for which all is computed, or tried
        self._path = Path()
        self._struck_s = 0.0
        self._made: tuple[Struck, Note] | None = None
        self._due: Due | None = None  # of the event that is being handled
        self._recorded: list[TimedEvent] | None = None
        self._recording_began_s = 0.0
        self._told_full = False
        self._effects: Effects | None = None  # as set
        self._dry = False
        self._told_body = ""  # the fault of the body that was reported last
        self._struck: Struck | None = None  # the last one
        self.seconds = 4.0  # how long the motion of a note is shown

    @property
    def ready(self) -> bool:
        """Whether a key would sound."""
        return self._player is not None

    def set_patch(self, patch: Patch | None, ear: Ear) -> None:
        """What keys play from now on, and where it is heard. Strings that ring follow, if the preset is the same.

        Another preset is loaded in the background; until then keys are silent. None: no patch.
        """
        with self._lock:
            player = self._player
            if patch is None or (player is not None and player.patch.preset != patch.preset):
                self._player = None
            self._wanted = None if patch is None else _Wanted(patch, ear)
        self._follow_wish()

    def listen(self, ear: Ear) -> None:
        """Where keys are heard from now on."""
        with self._lock:
            if self._wanted is None:
                return
            self._wanted = _Wanted(self._wanted.patch, ear)
            if self._player is None:  # it is being loaded, or cannot be
                return
        self._follow_wish()

    def _follow_wish(self) -> None:
        """Plays what is wanted; what takes milliseconds of it, in the background."""
        wanted, player = self._wanted, self._player
        if wanted is not None and player is not None:
            self._bring(player, wanted, nearly=not is_another(wanted.patch, player.patch))
        self._notes.in_background(self._complete)

    def _complete(self) -> None:
        """All that keys need to play what is wanted now. In the background."""
        wanted, player = self._wanted, self._player
        if wanted is not None and wanted is not self._completed:
            self._completed = wanted
            if player is None:
                self._begin(wanted)
            else:
                player.glide()
                self._bring(player, wanted)
        self._set_present_effects()
        self._prepare()

    def handle(self, event: Event, due: Due | None = None) -> tuple[Struck, Note] | None:
        """Plays an event, at once or when it is due; what it struck, and the note. None where it struck nothing."""
        struck_s = self._notes.now_s() if due is None else 0.0
        with self._lock:
            player = self._player
            if player is None:
                return None
            if player.rate_hz != self._notes.rate_hz:
                player.set_rate(self._notes.rate_hz)
            self._struck_s, self._due, self._made = struck_s, due, None
            self._note_down(event, time.monotonic() if due is None else due.time_s)
            try:
                player.handle(event, 0 if due is None else due.frame_in(self._notes.mixer))
            except (ValueError, PresetError) as error:
                self._report(str(error), "")
            if isinstance(event, Controller) and moves_effects(event, player.patch):
                self._refresh_effects()
            return self._made

    def cancel(self) -> None:
        """What was handed over and is not due yet is not played."""
        with self._lock:
            if self._player is not None:
                self._player.cancel()
            if self._recorded is not None:
                played_s = time.monotonic() - self._recording_began_s
                self._recorded = [each for each in self._recorded if each.time_s <= played_s]

    def stop(self) -> None:
        """All strings fade out."""
        with self._lock:
            if self._player is not None:
                self._player.stop()

    def sounding(self) -> dict[int, float]:
        """Key -> how loud its string rings: 0 at SEEN_DB below full scale, 1 at full scale."""
        player = self._player
        if player is None:
            return {}
        found: dict[int, float] = {}
        for struck in player.sounding():
            level = max(voice.level_db for voice in struck.voices.values())
            share = min(max(1 + level / SEEN_DB, 0.0), 1.0)
            found[struck.event.key] = max(found.get(struck.event.key, 0.0), share)
        return found

    @property
    def heard_through(self) -> Patch | None:
        """The patch whose body and room are heard, as controllers have turned them."""
        player, wanted = self._player, self._wanted
        if player is not None:
            return player.heard_through
        return None if wanted is None else wanted.patch

    def gain_of(self, string: StringParameters) -> float:
        """The factor of the string that a key played last, so that a pluck by hand is as loud; 1 for any other."""
        struck, player = self._struck, self._player
        if struck is None or struck.key.string.parameters != string:
            return 1.0
        with contextlib.suppress(ValueError):  # told when it is struck
            return struck.gain if player is None else player.gain_of(struck)
        return struck.gain

    def hear_dry(self, dry: bool) -> None:
        """Whether body and room are left out, as while models are compared with the truth."""
        self._dry = dry
        self._refresh_effects()

    def _refresh_effects(self) -> None:
        """Sets body and room in the background: an impulse response takes milliseconds."""
        self._notes.in_background(self._set_present_effects)

    def _set_present_effects(self) -> None:
        """Body and room of what is played now. In the background."""
        patch = self.heard_through
        effects = None if self._dry or patch is None else effects_of(patch)
        if effects != self._effects:
            self._effects = effects
            self._set_effects(effects)
        problem, told = body_problem(patch) if patch is not None else "", self._told_body
        self._told_body = problem
        if problem and problem != told:
            self._report(problem, "")

    def _prepare(self) -> None:
        """Computes keys before they are struck, until something else is wanted. In the background."""
        wanted, player = self._wanted, self._player
        if player is None:
            return
        low, high = player.patch.range
        for key in range(low, high + 1):
            if wanted is not self._wanted:
                return
            player.prepare([key])

    # Recording

    @property
    def recording(self) -> bool:
        return self._recorded is not None

    def begin_recording(self) -> None:
        """Records events from now on; an earlier recording is discarded."""
        with self._lock:
            self._recorded, self._recording_began_s, self._told_full = [], time.monotonic(), False
            if self._player is not None:
                self._note_down_patch(self._player)
                for event in self._player.at_hand:
                    self._note_down(event, time.monotonic())

    def end_recording(self) -> list[TimedEvent]:
        """The events, with times in s from the first note on; empty where there was no note.

        Keys that are down and pedals are let go at its end.
        """
        with self._lock:
            recorded, self._recorded = self._recorded or [], None
            end_s = time.monotonic() - self._recording_began_s
        events = sorted((each for each in recorded if each.time_s <= end_s), key=lambda each: each.time_s)
        events += [TimedEvent(end_s, event) for event in still_down(each.event for each in events)]
        first = next((each.time_s for each in events if isinstance(each.event, NoteOn)), None)
        if first is None:
            return []
        return [TimedEvent(max(0.0, each.time_s - first), each.event) for each in events]

    def _note_down_patch(self, player: Player) -> None:
        """With the pick-up through which it is heard, which is not its own where keys choose places."""
        pickup = Pickup(points=player.ear.points, kind=player.ear.pickup)
        self._note_down(PatchTurned(player.patch.model_copy(update={"pickup": pickup})), time.monotonic())

    def _note_down(self, event: Event, time_s: float) -> None:
        if self._recorded is None:
            return
        if len(self._recorded) < LONGEST_RECORDING:
            self._recorded.append(TimedEvent(time_s - self._recording_began_s, event))
        elif not self._told_full:
            self._told_full = True
            self._report(FULL, "")

    # How it is done

    def _bring(self, player: Player, wanted: _Wanted, nearly: bool = False) -> None:
        """Lets keys play what is wanted, unless something else is by now. `nearly`: as in `Player.loud_keys`."""
        try:
            keys = player.loud_keys(wanted.patch, wanted.ear, nearly)
        except ValueError as error:
            with self._lock:
                if wanted is self._wanted:  # what is played stays
                    self._wanted = self._completed = _Wanted(player.patch, player.ear)
            self._report(str(error), "")
            return
        with self._lock:
            if wanted is self._wanted and player is self._player:
                turned = (player.patch, player.ear) != (wanted.patch, wanted.ear)
                player.take(keys)
                if turned:
                    self._note_down_patch(player)

    def _begin(self, wanted: _Wanted) -> None:
        """Loads the preset of what is wanted."""
        patch, path = wanted.patch, self._find(wanted.patch.preset)
        if path is None:
            self._report(f"{patch.name} is played by the preset {patch.preset}, which was not found.", "")
            return
        try:
            preset, rate_hz = self._sources.load(path).preset, self._notes.rate_hz
            player = Player(patch, preset, rate_hz, self._deliver, SOURCES, wanted.ear)
        except (ValueError, PresetError) as error:
            self._report(str(error), "")
            return
        with self._lock:
            now = self._wanted
            if now is None or now.patch is not patch:
                return
            self._path, self._player = path, player
            self._note_down_patch(player)
        if now is not wanted:  # it is heard elsewhere by now
            self._bring(player, now)

    def _deliver(self, struck: Struck) -> None:
        """In the event's thread, within `handle`."""
        subject = StringOf(self._path, struck.key.string.parameters)
        self._struck = struck
        stroke = Stroke(subject, struck.pluck, struck.ear, self.seconds, SOURCES, gain=struck.gain)
        self._made = struck, self._notes.adopt(stroke, struck.voices, self._struck_s, self._due)

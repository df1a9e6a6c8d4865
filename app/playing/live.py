"""A patch that is played in the window: events of keys and MIDI become notes, each in its own thread."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
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
from app.instrument.player import SOURCES, Player, Struck
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


class Live:
    """Every public method may be called from any thread.

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
        self._wanted: Patch | None = None
        self._path = Path()
        self._ear: Ear | None = None
        self._struck_s = 0.0
        self._made: tuple[Struck, Note] | None = None
        self._due: Due | None = None  # of the event that is being handled
        self._recorded: list[TimedEvent] | None = None
        self._recording_began_s = 0.0
        self._told_full = False
        self._wished: object = None
        self._effects: Effects | None = None  # as set
        self._dry = False
        self._told_body = ""  # the fault of the body that was reported last
        self._preparing: object = None
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
            self._ear = ear
            player = self._player
            self._wanted = patch
            if patch is None:
                self._player = None
                self._wish_effects(None)
                return
            self._note_down_patch(patch)
            if player is not None and player.patch.preset == patch.preset:
                try:
                    player.set_patch(patch)
                    player.listen(ear)
                except ValueError as error:
                    self._report(str(error), "")
                    return
                self._wish_effects(player.heard_through)
                self._prepare(player)
                return
            self._player = None
        self._notes.in_background(lambda: self._begin(patch))  # before the effects: keys should sound soon
        with self._lock:
            self._wish_effects(patch)

    def listen(self, ear: Ear) -> None:
        """Where keys are heard from now on."""
        with self._lock:
            self._ear, player = ear, self._player
            if player is not None:
                self._note_down_patch(player.patch)
        if player is not None:
            player.listen(ear)
            self._prepare(player)

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
                self._wish_effects(player.heard_through)
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
        with self._lock:
            self._dry = dry
            if self._player is not None:
                self._wish_effects(self._player.heard_through)

    def _wish_effects(self, patch: Patch | None) -> None:
        """Sets body and room in the background: an impulse response takes milliseconds. The latest call counts."""
        wish = self._wished = object()
        dry = self._dry

        def work() -> None:
            if wish is not self._wished:
                return
            effects = None if dry or patch is None else effects_of(patch)
            if effects != self._effects:
                self._effects = effects
                self._set_effects(effects)
            problem, told = body_problem(patch) if patch is not None else "", self._told_body
            self._told_body = problem
            if problem and problem != told:
                self._report(problem, "")

        self._notes.in_background(work)

    def _prepare(self, player: Player) -> None:
        """Computes keys in the background, before they are struck; the latest call counts."""
        wish = self._preparing = object()

        def work() -> None:
            low, high = player.patch.range
            for key in range(low, high + 1):
                if wish is not self._preparing:
                    return
                player.prepare([key])

        self._notes.in_background(work)

    # Recording

    @property
    def recording(self) -> bool:
        return self._recorded is not None

    def begin_recording(self) -> None:
        """Records events from now on; an earlier recording is discarded."""
        with self._lock:
            self._recorded, self._recording_began_s, self._told_full = [], time.monotonic(), False
            if self._player is not None:
                self._note_down_patch(self._player.patch)
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

    def _note_down_patch(self, patch: Patch) -> None:
        """With the pick-up through which it is heard, which is not its own where keys choose places."""
        if self._ear is not None:
            pickup = Pickup(points=self._ear.points, kind=self._ear.pickup)
            patch = patch.model_copy(update={"pickup": pickup})
        self._note_down(PatchTurned(patch), time.monotonic())

    def _note_down(self, event: Event, time_s: float) -> None:
        if self._recorded is None:
            return
        if len(self._recorded) < LONGEST_RECORDING:
            self._recorded.append(TimedEvent(time_s - self._recording_began_s, event))
        elif not self._told_full:
            self._told_full = True
            self._report(FULL, "")

    # How it is done

    def _begin(self, patch: Patch) -> None:
        """Loads a patch's preset, unless another patch is wanted by now, or none."""
        if patch is not self._wanted:
            return
        path = self._find(patch.preset)
        if path is None:
            self._report(f"{patch.name} is played by the preset {patch.preset}, which was not found.", "")
            return
        try:
            player = Player(patch, self._sources.load(path).preset, self._notes.rate_hz, self._deliver, SOURCES)
        except (ValueError, PresetError) as error:
            self._report(str(error), "")
            return
        with self._lock:
            if patch is not self._wanted:
                return
            if self._ear is not None:
                player.listen(self._ear)
            self._path, self._player = path, player
        self._prepare(player)

    def _deliver(self, struck: Struck) -> None:
        """In the event's thread, within `handle`."""
        subject = StringOf(self._path, struck.key.string.parameters)
        self._struck = struck
        stroke = Stroke(subject, struck.pluck, struck.ear, self.seconds, SOURCES, gain=struck.gain)
        self._made = struck, self._notes.adopt(stroke, struck.voices, self._struck_s, self._due)

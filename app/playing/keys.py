"""What the keys of a patch sound with, prepared in the background: the patch's preset, its strings, body and room."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.instrument.effects import body_problem, effects_of
from app.instrument.events import Controller, Event, PatchTurned, moves_effects
from app.instrument.player import SOURCES, Player, Struck, is_another
from app.patches.patch import Patch, Pickup
from app.playing.due import Due
from app.playing.note import Note
from app.playing.recorder import EventRecorder
from app.playing.sources import Sources
from app.rendering.subject import StringOf
from engine.effects import Effects
from engine.presets import PresetError
from engine.resonators.string import StringParameters
from engine.voices import Ear, Mixer

SEEN_DB = 70.0  # below full scale: softer strings do not light their keys


@dataclass(frozen=True, eq=False)
class _Wanted:
    """What keys are to play, and where it is heard."""

    patch: Patch
    ear: Ear


class Keys:
    """Every public method may be called from any thread.

    A key waits for no knob. A turned patch is played at once, with the body's loudness and the peaks of the patch
    before; its own are computed in the background. Nothing that takes milliseconds is computed under a lock.

    Args:
        find: the path of a preset by its name; None where there is none.
        mixer: the present one.
        in_background: does work in another thread.
        report: is called with a message and its details where something cannot be played; in any thread.
        set_effects: sets body and room of all that is heard; called in a background thread.

    Attributes:
        recorder: of the events that are played, and of the patch as it is turned.
    """

    def __init__(
        self,
        sources: Sources,
        find: Callable[[str], Path | None],
        mixer: Callable[[], Mixer],
        in_background: Callable[[Callable[[], None]], None],
        report: Callable[[str, str], None],
        set_effects: Callable[[Effects | None], None],
    ) -> None:
        self._sources, self._find, self._mixer = sources, find, mixer
        self._in_background, self._report, self._set_effects = in_background, report, set_effects
        self.recorder = EventRecorder(report)
        self._lock = threading.RLock()
        self._player: Player | None = None
        self._wanted: _Wanted | None = None
        self._completed: _Wanted | None = None  # the latest wish for which all is computed, or tried
        self._path = Path()
        self._struck: Struck | None = None  # the last one
        self._effects: Effects | None = None  # as set
        self._dry = False
        self._told_body = ""  # the fault of the body that was reported last

    @property
    def player(self) -> Player | None:
        """None: no patch, or its preset is not loaded yet."""
        return self._player

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

    def handle(self, event: Event, due: Due | None, ring: Callable[[Struck, StringOf], Note]) -> Note | None:
        """Plays an event, at once or when it is due; the note of what it struck, or None.

        Args:
            ring: makes the note; called under the lock, so that notes of a key keep their order.
        """
        with self._lock:
            player, mixer = self._player, self._mixer()
            if player is None:
                return None
            if player.rate_hz != mixer.rate_hz:
                player.set_rate(mixer.rate_hz)
            self.recorder.take(event, None if due is None else due.time_s)
            struck = None
            try:
                struck = player.handle(event, 0 if due is None else due.frame_in(mixer))
            except (ValueError, PresetError) as error:
                self._report(str(error), "")
            if isinstance(event, Controller) and moves_effects(event, player.patch):
                self._in_background(self._set_present_effects)
            if struck is None:
                return None
            self._struck = struck
            return ring(struck, StringOf(self._path, struck.key.string.parameters))

    def cancel(self) -> None:
        """What was handed over and is not due yet is not played."""
        with self._lock:
            if self._player is not None:
                self._player.cancel()
            self.recorder.cancel()

    def sounding(self) -> dict[int, float]:
        """Key -> how loud its string rings: 0 at SEEN_DB below full scale, 1 at full scale."""
        found: dict[int, float] = {}
        for struck in self._player.sounding() if self._player is not None else ():
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

    def gain_of(self, string: StringParameters | None) -> float:
        """The factor of the string that a key played last, so that a pluck by hand is as loud; 1 for any other."""
        struck, player = self._struck, self._player
        if struck is None or struck.key.string.parameters != string:
            return 1.0
        with contextlib.suppress(ValueError):  # reported when it is struck
            return struck.gain if player is None else player.gain_of(struck)
        return struck.gain

    def begin_recording(self) -> None:
        """Records events from now on, wheels and pedals as they stand; an earlier recording is discarded."""
        with self._lock:
            player = self._player
            self.recorder.begin([] if player is None else [_turned(player), *player.at_hand])

    def hear_dry(self, dry: bool) -> None:
        """Whether body and room are left out, as while models are compared with the truth."""
        if dry != self._dry:
            self._dry = dry
            self._in_background(self._set_present_effects)  # an impulse response takes milliseconds

    # In the background

    def _set_present_effects(self) -> None:
        """Body and room of what is played now."""
        patch = self.heard_through
        effects = None if self._dry or patch is None else effects_of(patch)
        if effects != self._effects:
            self._effects = effects
            self._set_effects(effects)
        problem, told = body_problem(patch) if patch is not None else "", self._told_body
        self._told_body = problem
        if problem and problem != told:
            self._report(problem, "")

    def _follow_wish(self) -> None:
        """Plays what is wanted; what takes milliseconds of it, in the background."""
        wanted, player = self._wanted, self._player
        if wanted is not None and player is not None:
            self._bring(player, wanted, nearly=not is_another(wanted.patch, player.patch))
        self._in_background(self._complete)

    def _complete(self) -> None:
        """All that keys need to play what is wanted now."""
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

    def _prepare(self) -> None:
        """Computes keys before they are struck, until something else is wanted."""
        wanted, player = self._wanted, self._player
        if player is None:
            return
        low, high = player.patch.range
        for key in range(low, high + 1):
            if wanted is not self._wanted:
                return
            player.prepare([key])

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
                    self.recorder.take(_turned(player))

    def _begin(self, wanted: _Wanted) -> None:
        """Loads the preset of what is wanted."""
        patch, path = wanted.patch, self._find(wanted.patch.preset)
        if path is None:
            self._report(f"{patch.name} is played by the preset {patch.preset}, which was not found.", "")
            return
        try:
            preset, rate_hz = self._sources.load(path).preset, self._mixer().rate_hz
            player = Player(patch, preset, rate_hz, lambda struck: None, SOURCES, wanted.ear)
        except (ValueError, PresetError) as error:
            self._report(str(error), "")
            return
        with self._lock:
            now = self._wanted
            if now is None or now.patch is not patch:
                return
            self._path, self._player = path, player
            self.recorder.take(_turned(player))
        if now is not wanted:  # it is heard elsewhere by now
            self._bring(player, now)


def _turned(player: Player) -> PatchTurned:
    """With the pick-up through which it is heard, which is not its own where a single string is played."""
    pickup = Pickup(points=player.ear.points, kind=player.ear.pickup)
    return PatchTurned(player.patch.model_copy(update={"pickup": pickup}))

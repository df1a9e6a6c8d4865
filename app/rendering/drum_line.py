"""A source of a blow on a drum while it is rendered: its modes and its signal, block by block."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from app.player.drum_keys import DrumKeys, on_the_drum
from app.rendering.blow import RATE_HZ, BlowTake, ModalMotion
from app.rendering.note_sound import NoteSound, Struck
from app.rendering.strobe import Strobe
from app.rendering.subject import Loaded, path_of
from app.rendering.take import Signal
from engine.presets import PresetError
from engine.values.ear import Ear
from training.family.drums import StruckDrum
from training.family.motion import Blocks, model_player, true_motion

BLOCK_FRAMES = 1_200  # of 1,600 modes 15 MB


def begin_blow(request: NoteSound, struck: Struck, loaded: Loaded) -> tuple[BlowTake, dict[str, DrumLine]]:
    """A take of a blow and the lines of its sources.

    Raises:
        PresetError: the preset is of one string.
        ValueError: no drum is on the key.
    """
    drum_key = DrumKeys(struck.instrument, request.ear).of_key(struck.event.key)
    if drum_key is None:
        raise ValueError(f"{struck.instrument.name} has no drum on key {struck.event.key}")
    strike, place = drum_key.strike(struck.event.velocity, struck.instrument.pluck.curve), struck.event.place
    if place is not None:
        strike = replace(strike, place=on_the_drum(drum_key.played, place))
    struck_drum = StruckDrum.by(strike, drum_key.modes)
    try:
        play = model_player(loaded.preset.model)
    except ValueError as error:
        raise PresetError(f"{path_of(request.preset)}: {error}") from error
    take = BlowTake(request, drum_key.modes)
    players = {"model": play, "truth": true_motion}
    begin = {name: partial(player, struck_drum, RATE_HZ) for name, player in players.items()}
    return take, {name: DrumLine(take, begin[name], take.motions[name]) for name in begin}


class DrumLine:
    """The rendering of a source into its motion and its signal, with the methods of `SourceLine`.

    Args:
        begin: starts the source at the blow; what it returns gives the next frames, from the one after the blow on.
        motion: is filled with the modes.
    """

    rate_hz = RATE_HZ
    behind = False  # it has no flashes to catch up with
    ends_s: float | None = None  # it never runs away

    def __init__(self, take: BlowTake, begin: Callable[[], Blocks], motion: ModalMotion) -> None:
        self.motion = motion
        self.frames = take.frames
        self.first_frames = self.block_frames = BLOCK_FRAMES
        self._take = take
        self._begin = begin
        self._motion_blocks = self._signal_blocks = begin()  # the same where signal and motion begin together

    @property
    def done(self) -> int:
        return self.motion.ready_frames

    @property
    def complete(self) -> bool:
        return self.done == self.frames and self._signal.complete

    def show(self, strobe: Strobe) -> None:
        """Do nothing: slow motion follows from the modes."""

    def listen(self, ear: Ear) -> Signal:
        """Begin a new signal for these directions, and return it; the present one is not continued."""
        if self.done > 1:
            self._signal_blocks = self._begin()
        # amplitudes in m @ weights (modes, points) = pressure in Pa at 1 m
        radiated = self._take.modes.radiated
        self._weights = np.stack([radiated((2 * point - 1, 0.0)) for point in ear.points], axis=1)
        self._signal = Signal(RATE_HZ, len(ear.points), self._take.seconds)
        self._signal.append(np.zeros((1, len(ear.points)), np.float32))
        return self._signal

    def advance(self, samples: int) -> None:
        """Render the next frames, `samples` of them, of the motion, and a block of the signal."""
        together = self._signal_blocks is self._motion_blocks
        left = self._signal.frames - self._signal.ready_frames
        heard_m = np.zeros((0, len(self._weights)))  # new frames of the signal, (frames, modes)
        if samples:
            self.motion.append(block_m := self._motion_blocks(samples).numpy())
            heard_m = block_m[:left] if together else heard_m
        if left and not together:
            heard_m = self._signal_blocks(min(BLOCK_FRAMES, left)).numpy()
        self._signal.append((heard_m @ self._weights).astype(np.float32))

"""A tour of instruments: each is chosen in the running window's browser, and plays a phrase by keys, recorded.

The phrase is a rising line, a chord, and one key again and again; the settings file shows that it was the instrument.
"""

from __future__ import annotations

import contextlib
import re
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.audio.choices import Buffer, SoundChoice
from app.export.wav import WavSettings, write_wav
from app.instrument.events import KEYS, NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.patches.patch import Patch
from app.session.choices import Choices
from app.window.settings import Settings, load_settings
from engine.presets import SHIPPED, load_preset, preset_files
from tests.bench.machine import Machine
from tests.bench.play import analysis, hands, hearing, program
from tests.bench.play.children import SOUND_AND_SCREEN, need_programs
from tests.bench.play.control import steady_tone
from tests.bench.play.recording import Recording, recording
from tests.bench.play.screen import Screen, private_screen
from tests.bench.play.sound_server import RATE_HZ, sound_server

LINE, CHORD, REPEATS = 8, 4, 6  # keys of the phrase's parts
LINE_S, REPEATS_S, HELD_S = 0.25, 0.125, 1.0  # from key to key; of the chord
REST_S = 0.4  # between parts
STOP = "space"
SILENCE_S, PATIENCE_S, DECAY_PATIENCE_S = 0.3, 2.0, 10.0
CHOSEN_PATIENCE_S = 15.0
BEFORE_S = 0.1  # of sound before the first key
OWN_S, VELOCITY = 1.0, 100  # of a key alone
AFTER_S, SILENT_DB = 0.1, -40.0  # of sound after a key; re the loudest key: below it nothing was heard


@dataclass(frozen=True)
class Visited:
    """What was heard of one instrument.

    Attributes:
        silent: keys after which the level is 40 dB or more below that after the loudest.
        latency_ms: of the first key.
        holes: silences of a millisecond or more while strings ring; fades, clicks: as of `bench play`.
        own_clicks: so many does the same search find in keys of the line that are rendered alone, without a stop or
            another key: waves of low, stiff strings arrive as pulses.
        loudness_db: K-weighted, of the middle key of the line; peak_db: of all. Both re full scale.
        control_holes: of a steady tone that another process plays meanwhile.
    """

    instrument: str
    keys: int
    silent: int
    latency_ms: float
    holes: int
    fades: int
    clicks: int
    own_clicks: int
    loudness_db: float
    peak_db: float
    control_holes: int


@dataclass(frozen=True)
class Tour:
    """The whole tour. `passed`: no key was silent, and none had a hole."""

    machine: Machine
    buffer: Buffer
    seconds: float
    instruments: tuple[Visited, ...]

    @property
    def passed(self) -> bool:
        return all(each.holes == 0 and each.silent == 0 for each in self.instruments)


@dataclass(frozen=True)
class _Stay:
    """When the keys of an instrument were pressed, and until when it was heard, by `time.monotonic`."""

    patch: Patch
    keys_s: list[float]
    line: list[int]  # MIDI keys
    until_s: float


def measure(patches: Sequence[Patch], buffer: Buffer, out: Path | None, report: Callable[..., None]) -> Tour:
    """Play all of them in turn; `out` becomes the recording.

    Raises:
        Missing: a program or library is not there.
        RuntimeError: the app did not open, an instrument could not be chosen, or no sound was recorded.
    """
    need_programs(*SOUND_AND_SCREEN)
    with contextlib.ExitStack() as stack:
        stack.enter_context(program.ended_politely())
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tour")))
        report(0.0, "sound card, screen, window")
        server = stack.enter_context(sound_server(folder))
        screen = stack.enter_context(private_screen())
        recorded = stack.enter_context(recording(server, folder / "recording"))
        first = patches[0]
        choices = Choices(instrument=first, octave=hands.octave_of(first))
        settings = Settings(choices=choices, sound=SoundChoice(rate_hz=RATE_HZ, buffer=buffer))
        control = stack.enter_context(steady_tone(server, folder, buffer))
        started_s = time.monotonic()
        process = stack.enter_context(program.app(folder, settings, server, screen))
        program.open_window(screen, process)
        program.try_keys(screen, recorded, process, started_s, hands.keys_of(first)[0])
        began_s, stays = time.monotonic(), []
        for number, patch in enumerate(patches):
            report(0.05 + 0.9 * number / len(patches), patch.name)
            _silence(screen, recorded)
            if number:
                _choose(screen, folder / "settings.json", patch, process)
                program.try_keys(screen, recorded, process, time.monotonic(), hands.keys_of(patch)[0])
                _silence(screen, recorded)
            stays.append(_play(screen, patch))
        report(0.95, "analysis")
        clock, sound = recorded.clock(), recorded.sound()
        tone_clock, tone = control.clock(), control.sound()[:, 0]
        visited = []
        for stay in stays:
            begin_s, end_s = stay.keys_s[0] - BEFORE_S, stay.until_s
            part = sound[clock.frame(begin_s) : clock.frame(end_s)]
            steady = tone[tone_clock.frame(begin_s) : tone_clock.frame(end_s)]
            keys = [clock.frame(key_s) - clock.frame(begin_s) for key_s in stay.keys_s]
            visited.append(_judged(stay, keys, part, steady))
        if out is not None:
            with out.open("wb+") as file:
                kept = sound[clock.frame(began_s) : clock.frame(stays[-1].until_s)]
                write_wav(file, kept, RATE_HZ, WavSettings(), {"title": "Tour of instruments"})
        return Tour(Machine.here(), buffer, stays[-1].until_s - began_s, tuple(visited))


def _silence(screen: Screen, recorded: Recording) -> None:
    """Wait for silence, and stop what rings on."""
    if not recorded.wait_for_silence(SILENCE_S, PATIENCE_S):
        hands.tap(screen, STOP)  # which in silence would pluck
        recorded.wait_for_silence(SILENCE_S, DECAY_PATIENCE_S)


def _choose(screen: Screen, settings: Path, patch: Patch, process: subprocess.Popen[bytes]) -> None:
    """Choose an instrument in the browser by its name, and the octave in which most of its keys sound."""
    _with_control(screen, "i")
    time.sleep(0.3)
    for letter in re.sub(r"[^a-z0-9]+", " ", patch.name.lower()):
        hands.press(screen, "space" if letter == " " else letter)
    time.sleep(0.2)
    hands.press(screen, "Return")
    octave = _octave_of_chosen(settings, patch, process)
    wanted = hands.octave_of(patch)
    for _ in range(abs(wanted - octave)):
        hands.press(screen, hands.OCTAVE_UP if wanted > octave else hands.OCTAVE_DOWN)


def _octave_of_chosen(path: Path, patch: Patch, process: subprocess.Popen[bytes]) -> int:
    """The octave of the computer's keys, once the settings file has the instrument. Raises RuntimeError: never."""
    deadline_s = time.monotonic() + CHOSEN_PATIENCE_S
    while time.monotonic() < deadline_s and process.poll() is None:
        settings = load_settings(path)[0]
        chosen = None if settings is None else settings.choices.patch
        if settings is not None and chosen is not None and chosen.name == patch.name:
            return settings.choices.octave
        time.sleep(0.1)
    raise RuntimeError(f"{patch.name} could not be chosen in the window's browser")


def _with_control(screen: Screen, key: str) -> None:
    screen.key("Control_L", True)
    hands.press(screen, key)
    screen.key("Control_L", False)


def _play(screen: Screen, patch: Patch) -> _Stay:
    """The phrase, on as many of its keys as sound."""
    keys = hands.keys_of(patch)
    line = [keys[round(place)] for place in np.linspace(0, len(keys) - 1, min(LINE, len(keys)))]
    pressed_s = hands.play_in_turn(screen, line, LINE_S)
    time.sleep(REST_S)
    chord = list(dict.fromkeys(keys[place] for place in range(0, len(keys), 3)))[:CHORD]
    pressed_s += [screen.key(key, True) for key in chord]
    time.sleep(HELD_S)
    for key in chord:
        screen.key(key, False)
    time.sleep(REST_S)
    pressed_s += hands.play_in_turn(screen, [line[len(line) // 2]] * REPEATS, REPEATS_S)
    time.sleep(analysis.SOUNDS_S + 0.1)
    played = [hands.LOWEST + 12 * hands.octave_of(patch) + hands.KEYS.index(key) for key in line]
    return _Stay(patch, pressed_s, played, time.monotonic())


def _judged(stay: _Stay, keys: Sequence[int], part: NDArray[np.float32], tone: NDArray[np.float32]) -> Visited:
    """Args:
    keys: frames at which they were pressed, in the sound of the instrument.
    part, tone: this sound, and that of the steady tone meanwhile.
    """
    first = analysis.onset(part[:, 0], keys[0], RATE_HZ)
    usual = 0 if first is None else first - keys[0]
    part = part.copy()
    part[: keys[0] + usual] = 0  # what rang of the instrument before is no sound of this one
    found = analysis.faults(part, keys, usual, RATE_HZ)
    middle_s = (keys[len(stay.line) // 2] + usual) / RATE_HZ
    levels = levels_db(part[:, 0], [key + usual for key in keys])
    return Visited(
        stay.patch.name,
        len(keys),
        int((levels < levels.max() + SILENT_DB).sum()),
        1000 * usual / RATE_HZ,
        len(found.holes),
        len(found.fades),
        len(found.clicks),
        sum(own_clicks(stay.patch, key) for key in stay.line),
        hearing.loudness(part, middle_s),
        float(20 * np.log10(max(np.abs(part).max(), 1e-9))),
        len(analysis.silences(tone, RATE_HZ)),
    )


def own_clicks(patch: Patch, key: int) -> int:
    """Those of a key alone, without a device."""
    preset = load_preset(next(path for path in preset_files(SHIPPED) if path.stem == patch.preset))
    note, begin = TimedEvent(BEFORE_S, NoteOn(key, VELOCITY, KEYS)), round(BEFORE_S * RATE_HZ)
    sound = np.concatenate(list(render_events(patch, preset, [note], RATE_HZ, seconds=OWN_S)))
    return len(analysis.faults(sound, [begin], 0, RATE_HZ).clicks)


def levels_db(sound: NDArray[np.float32], begins: Sequence[int]) -> NDArray[np.float64]:
    """Levels in dB re full scale of the sound (frames,) from these places on."""
    parts = [sound[begin : begin + round(AFTER_S * RATE_HZ)].astype(np.float64) for begin in begins]
    return np.array([20 * np.log10(max(float(np.sqrt(np.mean(part**2))), 1e-9)) for part in parts])

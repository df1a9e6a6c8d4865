"""The instrument that keys play: chosen, changed, saved; and what its strip shows."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Literal

from PySide6.QtCore import Signal

from app.export.takes import RecordedTake
from app.instruments.drums import Drums
from app.instruments.instrument import ASSIGNABLE, BodyChoice, Instrument, StringSet
from app.instruments.library import (
    SUFFIX,
    InstrumentEntry,
    InstrumentError,
    add_instrument,
    instrument_folders,
    list_instruments,
    own_instruments,
    read_instrument,
    rename_instrument,
    save_instrument,
)
from app.instruments.scales import SCALES
from app.instruments.tuning import SCALA_FILES, TuningChoice, read_scala
from app.player.bodies import body_titles
from app.player.events import KEYS, ControlChange, Event, InstrumentTurned, NoteOff, NoteOn, TimedEvent
from app.player.facts import (
    facts_of,
    facts_of_drum,
    figures_of,
    knob_for,
    outside_of_key,
)
from app.player.midi_file import MidiFileError, read_song
from app.playing.key_note import KeyNote
from app.playing.keyboard import HIGHEST_OCTAVE, LOWEST_C, LOWEST_OCTAVE, letters_of, octave_near, octaves_of
from app.playing.playback import Due, Playback
from app.presets.library import Library
from app.presets.words import judged
from app.rendering import Take
from app.session.monitor import Monitor
from app.session.slots import other_preset, source_title
from app.shared.key_names import note_name
from app.stage.session import Session
from app.views.controls.browser_rows import BrowserRow
from app.views.dialogs.question import ask_text
from app.views.instrument.instrument_card import instrument_browser, instrument_row
from app.window.browsing import BrowserDesk
from app.window.inputs import Inputs
from app.window.main_window import MainWindow
from app.window.panels.string import outside_of_shown
from app.window.performance import Performance
from app.window.recordings import Recordings
from app.window.song import SongPlayer
from engine.kernels.midi import HARMONICS, LEGATO, PORTAMENTO, SLIDE_TIME, STRUM, TREMOLO
from engine.plain_text import name_text, one_line
from engine.schema import explained
from engine.whole_file import WriteError

AUDITION_VELOCITY, AUDITION_S = 90, 0.6  # of the note that lets an instrument be heard
SCREEN_SLIDE = 90  # of the time of slides, 0 … 127: 0.3 s
C_OF_OCTAVE_0 = LOWEST_C // 12 - 1  # C3 is the lowest of the computer's keys at octave 0
NO_INSTRUMENT = "The computer's keys pluck the chosen preset at ten places; choose an instrument to play pitches"
MIDI_FILES = (".mid", ".midi", ".kar", ".rmi", ".smf")
TAKEN_FILES = (*MIDI_FILES, SUFFIX, *SCALA_FILES)


class InstrumentDesk(BrowserDesk):
    """The controller of instruments: of their browser, their files, and the strip that plays one.

    A `RecordedTake` is a recording of this session; a `Take` is the rendered motion of one note, for the views.

    Attributes:
        recordings: of what is played.
    """

    _knob_turned = Signal(object)  # an instrument, in a take that is played; emitted in the playback's thread

    def __init__(
        self,
        window: MainWindow,
        session: Session,
        library: Library,
        performance: Performance,
        inputs: Inputs,
        favourites: Iterable[str] = (),
    ) -> None:
        super().__init__(window, window.instrument.bar, instrument_browser(window), favourites)
        self._window = window
        self._session = session
        self._library = library
        self._performance = performance
        self._inputs = inputs
        self._panel = window.instrument
        self._entries: list[InstrumentEntry] = []
        self._sounding = frozenset[int]()  # MIDI keys of the instrument for which the octave was judged last
        self._reported_other = ""  # the source that a notice reported as not heard from keys
        self._playback = Playback(self._play_event, performance.notes.sound, performance.notes.cancel)
        self._song = SongPlayer(self._playback, window.song)
        self._judged: object = None  # all that the words about the training depend on, as they are
        # an instrument, and what begins as soon as it can be played; None: nothing waits
        self._waiting: tuple[Instrument, Callable[[], None]] | None = None
        self._turned = False  # keys play the instrument as a knob was turned in the take, not the chosen one
        self.recordings = Recordings(window, session, performance.notes, library)
        self.reload()
        self._connect()

    def _connect(self) -> None:
        session = self._session
        panel = self._panel
        bar = self._panel.bar
        browser = self.browser
        panel.pressed.connect(self._press)
        panel.released.connect(lambda key, string: self._inputs.play(NoteOff(key, KEYS, string)))
        panel.touch_chosen.connect(self._choose_touch)
        panel.technique_switched.connect(self._switch_technique)
        panel.keys_play_asked.connect(
            lambda plays: session.play_instrument() if plays == "pitch" else session.play_string()
        )
        panel.knobs.changed.connect(self.change)
        panel.knobs.figure_asked.connect(self.turn_to)
        bar.save_asked.connect(self.save)
        bar.rename_asked.connect(self.rename)
        bar.revert_asked.connect(self.revert)
        bar.compare_asked.connect(self.compare)
        bar.scale_asked.connect(self.choose_scale)
        bar.scala_file_asked.connect(self._window.action["open"].trigger)
        bar.octave_asked.connect(self._move_octave)
        bar.macro_turned.connect(self._turn_macro)
        bar.changed.connect(self.change)
        bar.body_chosen.connect(self._choose_body)
        self._knob_turned.connect(self._hear_turned)
        self.recordings.play_asked.connect(self.play_take)
        browser.played.connect(self.audition)
        browser.delete_asked.connect(self.delete)
        browser.rename_asked.connect(self.rename)

    # What there is

    @property
    def instrument(self) -> Instrument | None:
        """The instrument that is there, played or not."""
        return self._session.choices.instrument

    @property
    def entry(self) -> InstrumentEntry | None:
        """The saved instrument whose name the present one has."""
        if self.instrument is None:
            return None
        name = self.instrument.name
        return next((entry for entry in self._entries if entry.instrument.name == name), None)

    @property
    def chosen(self) -> str:
        return "" if self.entry is None else self.entry.name

    def _update(self, **fields: object) -> None:
        """Give the instrument that is there other values."""
        if self.instrument is not None:
            self._session.update(instrument=self.instrument.model_copy(update=fields))

    def _find(self, name: str) -> InstrumentEntry | None:
        return next((entry for entry in self._entries if entry.name == name), None)

    def _rows(self) -> Sequence[BrowserRow]:
        return [instrument_row(entry) for entry in self._entries]

    def _folder(self) -> Path:
        return own_instruments()

    def reload(self) -> None:
        """Read instruments and bodies again: the user may have added files."""
        if self._panel.bar.compare.isChecked():  # the saved instrument may have changed
            self.compare(False)
        self._entries, problems = list_instruments()
        for problem in problems:
            self._notices.report(problem)
        self._panel.bar.set_bodies(body_titles())
        self.show_rows()
        self._show_instrument()

    # Intents

    def choose(self, name: str) -> None:
        """Make an instrument, by the name of its entry, the one that keys play."""
        if (entry := self._find(name)) is not None:
            self._session.update(played=entry.instrument)

    def audition(self, name: str) -> None:
        """Choose an instrument, unless it is there already, maybe changed, and play a note amid its range."""
        if self.chosen != name:
            self.choose(name)
        self._session.play_instrument()
        if self.instrument is not None:
            drum = self._session.stage.drum_key
            key = sum(self.instrument.range) // 2 if drum is None else drum
            self.stop()
            self._begin_when_playable(lambda: self._playback.play(_note(key)))

    def change(self, field: str, value: float | str) -> None:
        """Change a field of the instrument, by its path; a value beyond its bounds is ignored."""
        instrument = self.instrument
        if instrument is None:
            return
        try:
            if field in ASSIGNABLE:
                changed = instrument.with_knob(field, float(value))
            else:
                part, _, name = field.partition(".")
                inner = {**dict(getattr(instrument, part)), name: value} if name else value
                changed = Instrument.model_validate({**dict(instrument), part: inner})
        except (ValueError, AttributeError):  # a knob at its end asks for slightly more than the bound
            self._show_instrument()
            return
        self._session.update(instrument=changed)

    def turn_to(self, field: str, figure: float) -> None:
        """Turn a knob of the string until the shown string has a figure, or as near as it goes.

        Args:
            field: the knob's parameter.
            figure: the wanted value, in the parameter's `figure_unit`.
        """
        instrument = self.instrument
        if instrument is None:
            return
        try:
            self.change(field, knob_for(instrument, self._session.stage.shown_key(instrument), field, figure))
        except ValueError as error:
            self._notices.report(one_line(str(error)))

    def save(self) -> None:
        """Save the instrument: under its name where it is the user's own, else asks for one."""
        instrument, entry = self.instrument, self.entry
        if instrument is None:
            return
        if entry is not None and entry.own:
            self._write(lambda: self._save(instrument, entry.path))
        else:
            self._ask(
                "Save instrument",
                "Name of the instrument:",
                f"{instrument.name} 2",
                lambda name: self._save(Instrument.model_validate({**dict(instrument), "name": name})),
            )

    def save_as(self) -> None:
        """Save the instrument as a file anywhere, by whose name it is called there."""
        instrument = self.instrument
        if instrument is None:
            return
        suggested, filters = Path(f"{instrument.name}{SUFFIX}"), f"Instrument (*{SUFFIX})"
        file = self._window.places.ask_to_save(self._panel, "instrument", "Save instrument as", filters, suggested)
        if file is None:
            return
        try:
            named = Instrument.model_validate({**dict(instrument), "name": name_text(file.stem)})
            self._write(lambda: self._save(named, file))
        except ValueError as error:
            self._notices.report(f"{file}: {one_line(explained(error))}; choose another name.")

    def _ask(self, title: str, question: str, name: str, do: Callable[[str], None]) -> None:
        ask_text(self._panel, title, question, name, lambda name: self._write(lambda: do(name)))

    def _write(self, do: Callable[[], None]) -> None:
        """Do what writes a file; report that it cannot be written."""
        try:
            do()
        except WriteError as error:
            self._notices.report(one_line(str(error)))

    def _save(self, instrument: Instrument, file: Path | None = None) -> None:
        """Save the instrument; in the user's own folder it is played from now on."""
        saved = save_instrument(instrument, file)
        self.reload()
        if saved.path.parent in instrument_folders():
            self._session.update(instrument=instrument)
            self._show_instrument()
            self.browser.reveal(saved.name)
        self._notices.inform(f"{instrument.name} was saved as {saved.path}.", file=saved.path)

    def rename(self, name: str = "") -> None:
        """Ask for a new name of one of the user's own instruments, by default the present one."""
        entry = self._find(name) or self.entry
        if entry is None or not entry.own:
            self._notices.report("Only instruments of your own can be renamed: save this one first.")
            return
        self._ask("Rename instrument", "New name:", entry.instrument.name, lambda new: self._rename(entry, new))

    def _rename(self, entry: InstrumentEntry, name: str) -> None:
        """Rename an instrument and its file. Favourites, which are names of files, and the present one follow."""
        renamed = rename_instrument(entry, name)
        if entry.name in self.favourites:
            self.favourites ^= {entry.name, renamed.name}
        if self.instrument is not None and self.instrument.name == entry.instrument.name:
            self._update(name=renamed.instrument.name)
        self.reload()
        self.browser.reveal(renamed.name)

    def delete(self, name: str) -> None:
        """Delete one of the user's own instruments."""
        entry = self._find(name)
        if entry is None or not entry.own:
            return
        try:
            entry.path.unlink()
        except OSError as error:
            self._notices.report(f"{entry.path}: cannot be deleted ({error.strerror}).")
        else:
            self.favourites.discard(entry.name)
        self.reload()

    def revert(self) -> None:
        """Go back to the instrument as it was saved."""
        if (entry := self.entry) is not None:
            self._session.update(played=entry.instrument)

    def compare(self, saved: bool) -> None:
        """Let keys play the instrument as it was saved, or as it is now. The choices stay; any change ends it."""
        entry = self.entry if saved else None
        self._performance.hear_instrument(None if entry is None else entry.instrument)
        self._panel.bar.show_comparing(entry is not None)

    def take_file(self, file: Path) -> None:
        """Take a dropped file of TAKEN_FILES: add and choose an instrument, play a MIDI file, tune by a scale."""
        try:
            if file.suffix.lower() in MIDI_FILES:
                self._play_file(file)
            elif file.suffix.lower() in SCALA_FILES:
                self._tune(file)
            else:
                self._add(file)
        except (MidiFileError, InstrumentError, OSError, ValueError) as error:
            self._notices.report(one_line(str(error)))

    def _add(self, file: Path) -> None:
        """Add an instrument's file to the library, and choose it; where it cannot be added, it is only chosen."""
        try:
            entry, added = add_instrument(file)
        except WriteError as error:
            self._session.update(played=read_instrument(file))
            self._notices.report(f"{file.name} can be played, but not added to your library: {one_line(str(error))}")
            return
        self.reload()
        self._session.update(played=entry.instrument)
        self.browser.reveal(entry.name)
        if added:
            self._notices.inform(f"{file.name} was added to your library as {entry.instrument.name}.")

    def _play_file(self, file: Path) -> None:
        song = read_song(file, self.instrument)
        if song.left_out:
            self._notices.inform(f"{song.left_out}.")
        self._session.play_instrument()
        self._song.load(file.name, song.events)

    def play_take(self, take: RecordedTake) -> None:
        """Play a take through its instrument as it was, which is chosen, once that can be played."""
        self.stop()
        self._session.play_instrument()
        if self.instrument != take.played.instrument:
            self._session.update(played=take.played.instrument)
        self._begin_when_playable(lambda: self._song.load(one_line(take.name), take.played.events))

    def _begin_when_playable(self, begin: Callable[[], None]) -> None:
        """Begin what plays the instrument that is there: now, or once it is loaded if it is still there then."""
        if self.instrument is not None:
            self._waiting = self.instrument, begin
            self._play_waiting()

    def _play_waiting(self) -> None:
        """Begin the take or the note that waits, once its instrument is loaded; drop it for another instrument.

        Where nothing waits and a recording in which a knob was turned has ended, let keys play the chosen instrument.
        """
        if self._waiting is not None:
            instrument, begin = self._waiting
            if self.instrument != instrument:
                self._waiting = None  # another was chosen meanwhile
            elif self._performance.notes.keys.player is not None:
                self._waiting = None
                begin()
        elif self._turned and not self._playback.playing:
            self._turned = False
            self._performance.hear_instrument(None)

    def _play_event(self, event: Event, due: Due | None = None) -> None:
        """Play an event of a file or a take. In the playback's thread."""
        if isinstance(event, InstrumentTurned):
            self._knob_turned.emit(event.instrument)
        else:
            self._inputs.play(event, due)

    def _hear_turned(self, instrument: Instrument) -> None:
        self._turned = True
        self._performance.hear_instrument(instrument)

    def _tune(self, file: Path) -> None:
        """Tune the instrument by a Scala file."""
        self._tune_by(file.name, "keymap" if file.suffix.lower() == ".kbm" else "scale", read_scala(file))

    def _tune_by(self, name: str, field: Literal["scale", "keymap"], text: str) -> None:
        """Tune the instrument by a Scala text: a mapping joins the scale that it has, and a scale its mapping."""
        instrument = self.instrument
        if instrument is None:
            self._notices.report(f"{name} tunes an instrument, and none is chosen; choose one first.")
            return
        before = instrument.tuning
        other, kind = (before.keymap, "keyboard mapping") if field == "scale" else (before.scale, "scale")
        self._update(tuning=TuningChoice.model_validate({**dict(before), field: text}))
        joined = f", with the {kind} that it had" if other else ""
        self._notices.inform(f"{name} tunes {instrument.name}{joined}.")

    def choose_scale(self, name: str) -> None:
        """Tune the instrument by one of SCALES; "": in twelve equal steps again, without a mapping."""
        if name:
            self._tune_by(name, "scale", SCALES[name])
        elif (instrument := self.instrument) is not None:
            self._update(tuning=TuningChoice(a4_hz=instrument.tuning.a4_hz, transpose=instrument.tuning.transpose))

    def take_body(self, name: str) -> None:
        """Give the instrument one of the user's own bodies, which was just installed."""
        self._panel.bar.set_bodies(body_titles())
        if self.instrument is None:
            self._notices.inform(f"The body {name} was added; choose an instrument, then this body in its bar.")
            return
        if self.instrument.body.name == name:  # its file was missing
            self._performance.choices_changed(frozenset({"instrument"}))
        self._choose_body(name)
        self._notices.inform(f"{self.instrument.name} now has the body {name}.")

    def stop(self) -> None:
        """Stop the MIDI file or the take that is played, or the note of an audition."""
        self._waiting = None
        self._song.stop()
        self._playback.stop()

    @property
    def playing(self) -> bool:
        """Return True if a MIDI file is played."""
        return self._playback.playing

    # What is shown

    def choices_changed(self, names: frozenset[str]) -> None:
        """Show in the strip what has changed; `names`: the fields of `Choices` that have other values."""
        if names & {"instrument", "preset"}:
            self._show_instrument()
        if "instrument" in names:
            self._panel.bar.show_comparing(False)
        if names & {"octave", "instrument"}:
            self._keep_octave_in_range("octave" in names)
        if names & {"octave", "velocity", "instrument", "single"}:
            choices, pitches = self._session.choices, self._session.choices.plays_instrument
            self._panel.bar.show_octave(*(C_OF_OCTAVE_0 + octave for octave in (choices.octave, *self._octaves)))
            self._panel.bar.show_velocity(choices.velocity)
            self._panel.show_keys_play("pitch" if pitches else "place", choices.instrument is not None)
            self._panel.keys.show_letters(letters_of(choices.octave) if pitches else {})
        if names & {"instrument", "single", *Monitor.model_fields}:
            self._show_source()

    @property
    def _octaves(self) -> tuple[int, int]:
        """The lowest and the highest octave at which one of the computer's keys sounds."""
        return (LOWEST_OCTAVE, HIGHEST_OCTAVE) if self.instrument is None else octaves_of(*self.instrument.range)

    def _keep_octave_in_range(self, by_user: bool) -> None:
        """Move the octave of the computer's keys to one in which a key sounds; say why.

        Where other keys sound than before, it is the nearest octave in which nearly as many sound as in any. A knob
        changes no keys, and moves nothing.

        Args:
            by_user: whether the octave was to change; otherwise another instrument made it change.
        """
        instrument = self.instrument
        octave = self._session.choices.octave
        lowest, highest = self._octaves
        within = min(max(octave, lowest), highest)
        before, self._sounding = self._sounding, frozenset() if instrument is None else _keys_of(instrument)
        if self._sounding and not by_user and self._sounding != before:
            within = octave_near(octave, self._sounding)
        if instrument is None or within == octave:
            return
        end = "Lowest octave" if octave < lowest else "Highest octave"
        low, high = map(note_name, instrument.range)
        self._session.update(octave=within)
        self._panel.bar.say_octave(f"{end if by_user else 'Octave moved'}: {instrument.name} has {low} to {high}")

    def _show_source(self) -> None:
        """Light keys in the colour of the source that is heard.

        Where that is another preset's model, which keys do not play, a notice says so once.
        """
        choices, heard_source = self._session.choices, self._session.choices.source_heard
        other = heard_source if choices.plays_instrument and other_preset(heard_source) else ""
        if self._reported_other not in (choices.a, choices.b):
            self._reported_other = ""
        self._panel.show_source("model" if other else heard_source)
        if other and other != self._reported_other:
            self._notices.inform(
                f"Keys sound with the model of their instrument, not with {source_title(other, self._library)}: that "
                "preset is heard when you pluck the string by hand, or where keys choose the place."
            )
            self._reported_other = other

    def judge(self) -> None:
        """Show the string of the latest note, and what of it lies outside the training with the knobs as they are.

        Called a few times a second: of a chord, of fast notes or of a knob once, as it takes milliseconds.
        """
        stage, choices, instrument = self._session.stage, self._session.choices, self.instrument
        subject = stage.note, stage.known, instrument, choices.single, stage.complete, stage.request
        if subject == self._judged:
            return
        self._judged = subject
        if instrument is not None:
            self._show_string(instrument)
        note, entry = stage.note_played, self._library.find(choices.preset)
        is_turned = isinstance(note, KeyNote) and note.instrument != instrument
        outside = ""
        if entry is not None and isinstance(note, KeyNote) and instrument is not None and is_turned:
            outside = "; ".join(outside_of_key(entry.info, instrument, note.event, note.string))
        elif entry is not None and note is not None and choices.string is not None:
            outside = outside_of_shown(choices, entry)
        measured = stage.take if isinstance(stage.take, Take) and stage.complete and not is_turned else None
        self._window.show_outside(*judged(outside, math.nan if measured is None else measured.error))

    def _show_string(self, instrument: Instrument) -> None:
        """Show the string or the drum in figures, or why there is none."""
        facts: dict[str, str] = {}
        figures: dict[str, str] = {}
        if isinstance(instrument.strings, Drums):
            key = self._session.stage.drum_key
            drum = (None if key is None else instrument.strings.of_key(key)) or instrument.strings.drums[0]
            facts = facts_of_drum(drum)
        else:
            try:
                key_string = self._session.stage.shown_string(instrument)
            except ValueError as error:
                facts = {"string": str(error)}
            else:
                if key_string is not None:
                    facts, figures = facts_of(key_string), figures_of(key_string.parameters, instrument)
        self._panel.knobs.facts.show_facts(facts)
        self._panel.knobs.show_figures(figures)

    def tick(self) -> None:
        """Show the MIDI file's position and which keys sound; called by the window's timer."""
        self._song.tick()
        self._play_waiting()
        self.recordings.tick(time.monotonic())
        if not self._panel.isVisible():
            return
        keys = self._performance.notes.keys
        self._panel.show_sounding(keys.sounding(), keys.sounding_notes())
        self._panel.bar.show_voices(self._performance.notes.ringing)

    def close(self) -> None:
        """End the playback and a recording, which is kept; may be called again."""
        self.browser.dismiss()  # or it would play what is selected after a rest, without a device
        self.stop()
        self.recordings.close()

    def _show_instrument(self) -> None:
        """Show the instrument that is there in bar, knobs, keys and browser; where none is, that there is none."""
        instrument = self.instrument
        entry = self.entry
        panel = self._panel
        panel.bar.show_note("" if instrument is not None else NO_INSTRUMENT)
        if instrument is None:
            return
        saved = entry.instrument if entry is not None else None
        panel.bar.show_instrument(instrument, own=entry is not None and entry.own, changed=saved != instrument)
        panel.knobs.show_instrument(instrument, saved)
        self._show_string(instrument)
        panel.set_range(*instrument.range)
        strings = instrument.strings
        panel.set_drums(isinstance(strings, Drums))
        if isinstance(strings, StringSet):
            panel.neck.set_strings([(note_name(string.note), string.note) for string in strings.strings])
        else:
            panel.neck.set_strings([(note_name(instrument.range[0]), instrument.range[0])])
        self.browser.set_chosen(self.chosen)

    def _press(self, key: int, velocity: int, string: int | None) -> None:
        """Play a key on the screen, which is one of the instrument, where there is one."""
        self._session.play_instrument()
        self._inputs.play(NoteOn(key, velocity, KEYS, string=string))

    def _choose_touch(self, touch: str) -> None:
        """Choose the effect of a key on the screen or of the computer while another is held."""
        for number, down in ((LEGATO, touch != "pluck"), (PORTAMENTO, touch == "slide")):
            self._inputs.play(ControlChange(number, 127 * down, KEYS))
        self._inputs.play(ControlChange(SLIDE_TIME, SCREEN_SLIDE, KEYS))

    def _switch_technique(self, name: str, on: bool) -> None:
        """Switch a technique on or off for keys of the screen and of the computer."""
        number = {"strum": STRUM, "tremolo": TREMOLO, "harmonics": HARMONICS}[name]
        self._inputs.play(ControlChange(number, 127 * on, KEYS))

    def _move_octave(self, octaves: int) -> None:
        octave = min(max(self._session.choices.octave + octaves, LOWEST_OCTAVE), HIGHEST_OCTAVE)
        self._session.update(octave=octave)

    def _turn_macro(self, number: int, value: float) -> None:
        if self.instrument is not None:
            self._session.update(instrument=self.instrument.turned(number, value))

    def _choose_body(self, name: str) -> None:
        """Give the instrument another body; where its body was mixed to 0, all but its size is the default."""
        if self.instrument is not None:
            kept = dict(self.instrument.body) if self.instrument.body.mix > 0 else {"size": self.instrument.body.size}
            self._update(body=BodyChoice.model_validate({**kept, "name": name}))


def _note(key: int) -> list[TimedEvent]:
    return [TimedEvent(0.0, NoteOn(key, AUDITION_VELOCITY, KEYS)), TimedEvent(AUDITION_S, NoteOff(key, KEYS))]


def _keys_of(instrument: Instrument) -> frozenset[int]:
    """The MIDI keys that sound."""
    low, high = instrument.range
    keys = range(low, high + 1)
    drums = instrument.strings if isinstance(instrument.strings, Drums) else None
    return frozenset(key for key in keys if drums is None or drums.of_key(key) is not None)

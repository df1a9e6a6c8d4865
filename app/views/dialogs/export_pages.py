"""The pages of the export dialog: a note, a performance, an instrument for samplers, and one as a plug-in."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import disk_usage
from typing import Any, ClassVar, Literal

from PySide6.QtCore import QSignalBlocker

from app.export.choices import Chosen, ExportChoices
from app.export.compared import TABLE, ComparedExport, check_new
from app.export.job import ExportJob
from app.export.note import HeardNote, NoteExport, paths_of
from app.export.played import Played, PlayedExport, recorded_files
from app.export.plugin.formats import PluginError, check_compiler, install_folder, this_target
from app.export.plugin.job import PluginExport
from app.export.recipe import source_words
from app.export.sampled.choices import SampledChoices
from app.export.sampled.job import SampledExport, plain_stem, planned
from app.export.sampled.plan import MOST_LAYERS, SECONDS_RANGE, WIDEST_STEP, SampledPlan
from app.export.sampled.words import counted, megabytes, needed_bytes, number_of, pitch_words, size_words
from app.export.wav import DECAY_RANGE_DB, LONGEST_S
from app.instruments.instrument import Instrument
from app.player.effects import added_words, body_problem
from app.player.events import NoteOn
from app.presets.library import PresetEntry
from app.rendering.note_sound import NoteSound
from app.shared.vocabulary import DIFFERENCE_GAIN_RANGE_DB, FORMATS, WRITTEN_ENDINGS, Format, Source
from app.views.controls.form import FilePicker, Form, check_box
from app.views.controls.number_box import NoteBox
from app.views.controls.parts import faint, label
from app.views.file_places import FileKind, FilePlaces
from engine.whole_file import WriteError, explain

Kind = Literal["note", "performance", "models", "sampler", "plugin"]
SOURCE_NAMES: tuple[tuple[str, Chosen], ...] = (
    ("Model", "model"),
    ("Truth", "truth"),
    ("Difference: model minus truth", "difference"),
    ("Both, in two files", "files"),
)
RATES_HZ = (44_100, 48_000, 96_000)
FORMAT_NAMES: dict[Format, str] = {
    "wav 16": "WAV, 16-bit PCM, dithered",
    "wav 24": "WAV, 24-bit PCM",
    "wav 32f": "WAV, 32-bit floating point",
    "flac 16": "FLAC, 16 bits, dithered",
    "flac 24": "FLAC, 24 bits",
}
FORM_NAMES = (("SFZ with FLAC samples", "flac"), ("SFZ with WAV samples", "wav"), ("SoundFont 2", "sf2"))
Remembered = tuple[ExportChoices, SampledChoices]  # choices from one dialog to the next
PLUGIN_NAMES = {"clap": "CLAP", "vst3": "VST3", "lv2": "LV2"}
SYSTEM_NAMES = {
    "linux-x64": "Linux",
    "linux-arm64": "Linux (ARM)",
    "windows-x64": "Windows",
    "macos-arm64": "macOS",
    "macos-x64": "macOS (Intel)",
}
MOST_OF_A_NAME = 100  # folders of models
PLUGIN_NOTE = "The first one takes one to three minutes, later ones some seconds."
RECIPE_NOTE = "Drop the file on the window to restore its instrument, or its preset and pluck."
MIDI_NOTE = "The notes are saved in the same folder, as a MIDI file."


@dataclass(frozen=True)
class HeardPerformance:
    """A performance, the file of the preset that plays its instrument (None: that is gone), and the take's name."""

    played: Played
    preset: Path | None
    name: str

    def export(self, choices: ExportChoices, folder: Path, name: str = "") -> PlayedExport:
        """The export of what is played, by default to a file of its name. Raises ValueError: nothing plays it."""
        if self.preset is None:
            missing = self.played.instrument.preset
            raise ValueError(f"The preset {missing}, which plays the instrument, was not found.")
        name = name or f"{self.name}{choices.ending}"
        return PlayedExport(self.played, self.preset, folder / name, choices.wav)


@dataclass(frozen=True)
class HeardInstrument:
    """An instrument and the preset that plays it."""

    instrument: Instrument
    preset: PresetEntry


class WavForm(Form):
    """Sample rate, format and level of sound files; notes and performances share it."""

    TIPS: ClassVar = {
        "rate_hz": "A rate above the model's own adds no bandwidth",
        "format": "16 bits are dithered; floating point, of WAV alone, never clips; FLAC is lossless and smaller",
        "normalise": "One gain for model and truth. Off: as loud as at a volume of 0 dB; of a string alone, 10 mm "
        "are full scale",
    }

    def __init__(self, export: ExportChoices) -> None:
        super().__init__(export, self.TIPS)
        self.note = faint()
        rates = [("The model's rate", 0), *((f"{rate / 1000:g} kHz", rate) for rate in RATES_HZ)]
        self.row("Sample rate", self.combo("rate_hz", "Sample rate", rates), self.note)
        self.row("Format", self.combo("format", "Format", [(words, form) for form, words in FORMAT_NAMES.items()]))
        self.row("Level", self.check("normalise", "Normalise to −1 dBFS"))

    @property
    def ending(self) -> str:
        """The ending of the chosen format, as ".wav"."""
        return f".{self['format'].currentData().split()[0]}"

    def follow(self, file: FilePicker) -> None:
        """Choose the format of an ending that the user has typed, and give the file the ending of the chosen one."""
        typed, box = Path(file.edit.text().strip()).suffix.lower(), self["format"]
        if typed in WRITTEN_ENDINGS and typed != file.suffix:
            file.suffix = typed
            same_bits = f"{typed[1:]} {box.currentData().split()[1]}"
            box.setCurrentIndex(box.findData(same_bits if same_bits in FORMATS else f"{typed[1:]} 24"))
        file.suffix = self.ending


class ExportPage(Form):
    """A page with the subject and the settings of an export; a further kind is a further subclass.

    Attributes:
        title, window_title: of its tab, and of the dialog while it is shown.
        missing: why there is nothing to export.
        writes_wav: whether the form for sound files belongs to it.
        subject: what the window plays of this kind; None: nothing.
        what, file: the words of the subject, and where it is written.
    """

    title = missing = ""
    window_title = "Export"
    writes_wav = True
    TIPS: ClassVar[dict[str, str]]

    def __init__(self, choices: object, places: FilePlaces, kind: FileKind) -> None:
        super().__init__(choices, self.TIPS)
        self.subject: Any = None
        self.what, self.file = label("faint"), self.file_picker(places, kind)
        self.row("Sound", self.what)

    def show_subject(self, subject: Any) -> None:
        """Follow what the window plays; None: there is nothing of this kind."""
        self.subject = subject
        self._show()

    @property
    def offered(self) -> Any:
        """The subject. Raises ValueError: there is none."""
        if self.subject is None:
            raise ValueError(self.missing)
        return self.subject

    @abstractmethod
    def _show(self) -> None:
        """Show the subject, if there is one, and what the choices make of it."""

    @abstractmethod
    def job(self) -> ExportJob:
        """The job that would be done. Raises ValueError: the choices cannot be; the message names the field."""

    @abstractmethod
    def offer(self) -> tuple[str, str]:
        """The button's text, and a note on what will be written. Raises ValueError, WriteError or OSError."""


class NotePage(ExportPage):
    """The export of a pluck to one file, or two."""

    title, missing = "Note", "There is no preset to export: choose one first."
    TIPS: ClassVar = {
        "source": "What to save",
        "difference_gain_db": "Gain of the difference, model − truth",
        "until_decayed": "Where the file ends: when the sound has decayed, or after a fixed time",
        "decay_db": "The sound ends where model and truth are this far below their peak",
        "longest_s": "A string that rings longer is faded out at this length",
        "seconds": "The end is faded out within 10 ms",
        "file": "With two files, the source is appended to each name",
    }

    def __init__(self, export: ExportChoices, wav: WavForm, places: FilePlaces) -> None:
        super().__init__(export, places, "note")
        self._wav = wav
        self.through_words, self.names = label(), faint()
        self.through = check_box("On", True, "Off: the string alone, without the instrument")
        self.through.setAccessibleName("Instrument")
        self.through.toggled.connect(self.changed)
        gain, limits = "Gain of the difference", (0.1, LONGEST_S)
        self.row(
            "Source",
            self.combo("source", "Source", SOURCE_NAMES),
            self.number("difference_gain_db", gain, DIFFERENCE_GAIN_RANGE_DB, " dB", step=6, prefix="+"),
        )
        self.row("Instrument", self.through, self.through_words)
        self.row(
            "Length",
            self.combo("until_decayed", "Length", (("Until it has decayed", True), ("Fixed", False))),
            self.number("decay_db", "Decay", DECAY_RANGE_DB, " dB", step=5, prefix="by "),
            self.number("longest_s", "Longest duration", limits, " s", 1, prefix="at most "),
            self.number("seconds", "Duration", limits, " s", 1, 0.5),
        )
        self.row("File", self.file)
        self._names_row = self.row("Saved as", self.names)
        self.changed.connect(self._show)
        wav.changed.connect(self._show)

    def show_subject(self, subject: HeardNote | None) -> None:
        """Follow the note that is heard; where another source is heard, choose it, and the difference's gain."""
        before = self.subject
        if subject is not None and (before is None or before.source != subject.source):
            box = self["source"]
            box.setCurrentIndex(box.findData(subject.chosen(box.currentData())))
            if subject.source == "difference":
                self["difference_gain_db"].setValue(subject.difference_gain_db)
        super().show_subject(subject)

    def choices(self) -> ExportChoices:
        values = {**self.values(), "alone": not self.through.isChecked()}
        return ExportChoices.model_validate({**values, **self._wav.values()})

    def paths(self) -> dict[Source, Path]:
        """The files that will be written, by source. Raises ValueError: no name is given."""
        return paths_of(self.file.path, self["source"].currentData())

    def job(self) -> NoteExport:
        return NoteExport(self.offered.sound, self.paths(), self.choices())

    def offer(self) -> tuple[str, str]:
        there = any(path.is_file() for path in self.job().paths.values())
        return "Replace" if there else "Export", RECIPE_NOTE

    def _show(self) -> None:
        """Show the controls that the choices need, the note's words, and the names of its files."""
        decays = self["until_decayed"].currentData()
        for field, visible in (("decay_db", decays), ("longest_s", decays), ("seconds", not decays)):
            self[field].setVisible(visible)
        if (subject := self.subject) is None:
            return
        sound = subject.sound
        source, rate_hz = self["source"].currentData(), self._wav["rate_hz"].currentData()
        self["difference_gain_db"].setVisible(source == "difference")
        can_be_alone = sound.alone != sound
        alone = can_be_alone and not self.through.isChecked()
        self.through.setVisible(can_be_alone)
        self.through_words.setText(_through_words(sound, alone, source))
        struck = None if alone else sound.struck
        key_words = struck and f"Note: {struck.words}, held, with the present settings"
        self.what.setText(key_words or subject.words)
        beyond = f"adds no bandwidth: the model ends at {subject.preset_rate_hz / 2000:g} kHz"
        model_rate = "" if rate_hz else f"{subject.preset_rate_hz / 1000:g} kHz"
        self._wav.note.setText(beyond if rate_hz > subject.preset_rate_hz else model_rate)
        self._wav.follow(self.file)
        self.file.suggest(subject.file_name(source, self.file.suffix))
        two = source == "files"
        self.names.setText("\n".join(path.name for path in self.paths().values()) if two else "")
        self.rows.setRowVisible(self._names_row, two)


class PerformancePage(ExportPage):
    """The export of what was played, to a sound and a MIDI file of one name."""

    title, missing = "Recording", "Nothing was recorded: click Record, play, and click it again."
    window_title = "Save the recording"
    TIPS: ClassVar = {"file": "The MIDI file has the same name"}

    def __init__(self, wav: WavForm, places: FilePlaces) -> None:
        super().__init__(None, places, "recording")
        self._wav = wav
        self.row("File", self.file)
        for changed in (self.changed, wav.changed):
            changed.connect(self._show)

    def _show(self) -> None:
        """Show what was played, and suggest a file of its name."""
        if (subject := self.subject) is not None:
            played = subject.played
            notes = number_of(sum(isinstance(timed_event.event, NoteOn) for timed_event in played.events), "note")
            source_title = source_words(played.source, played.difference_gain_db)
            seconds = f"{played.events[-1].time_s:.1f} s"
            self.what.setText(f"{played.instrument.name}: {notes} in {seconds}, then until silent; {source_title}")
            self._wav.follow(self.file)
            self.file.suggest(subject.name + self.file.suffix)

    def job(self) -> PlayedExport:
        subject, path = self.offered, self.file.path
        return subject.export(ExportChoices.model_validate(self._wav.values()), path.parent, path.name)

    def offer(self) -> tuple[str, str]:
        there = [path.name for path in recorded_files(self.job().path) if path.exists()]
        return "Replace" if there else "Save", f"Replaces {' and '.join(there)}." if there else MIDI_NOTE


class ModelsPage(ExportPage):
    """The export of all models on one pluck to a folder."""

    title = "Models"
    missing = "Nothing is compared: choose a preset in the Lab, then the view Compare, and Export … above its table."
    window_title = "Export the models"
    TIPS: ClassVar = {
        "level_match": "One gain brings a model to the level of its truth, in the difference too. Off: as they are",
        "file": "The folder that is made",
    }

    def __init__(self, export: ExportChoices, wav: WavForm, places: FilePlaces) -> None:
        super().__init__(export, places, "note")
        self._wav = wav
        self.file.suffix = ""
        self.row("Models", self.check("level_match", "As loud as their truth"))
        self.row("Folder", self.file)

    def _show(self) -> None:
        if (subject := self.subject) is not None:
            self.what.setText(subject.words)
            self.file.suggest(subject.name)
            for number in range(2, MOST_OF_A_NAME):
                if self.file.path.exists():
                    self.file.suggest(f"{subject.name} ({number})")

    def job(self) -> ComparedExport:
        choices = ExportChoices.model_validate({**self.values(), **self._wav.values()})
        return ComparedExport.chosen(self.offered, self.file.path, choices)

    def offer(self) -> tuple[str, str]:
        check_new(self.job().file)
        return "Export", f"Model, truth and difference of each, with their recipes, and a table ({TABLE})."


class SamplerPage(ExportPage):
    """An instrument for samplers: format, keys, layers, length, source, place."""

    title = "Sampler"
    missing = "There is no instrument to export: choose one first."
    writes_wav = False
    TIPS: ClassVar = {
        "form": "An SFZ has a folder of samples beside it; a SoundFont is one file, of 16 bits",
        "bits": "Of each sample",
        "rate_hz": "Of the samples",
        "every": "One sample for so many keys; those between are transposed",
        "layers": "How many velocities are rendered of each key",
        "seconds": "Silent ones end sooner; one that still rings is faded out",
        "source": "What plays the instrument",
        "dry": "A room in the samples ends with the release of each key",
        "file": "Where the instrument is written",
    }

    def __init__(self, choices: SampledChoices, places: FilePlaces) -> None:
        super().__init__(choices, places, "sampler")
        self._chosen_keys = choices.keys  # lowest and highest, as remembered; None: all of the instrument
        self.size_text = label(selectable=True)
        self.size_text.setMinimumHeight(36)  # of two lines
        self.lowest = NoteBox("Lowest key", "The lowest key: a note, as E2, or a MIDI number")
        self.highest = NoteBox("Highest key", "The highest key: a note, as E6, or a MIDI number")
        every = faint("a sample for every"), self.count("every", "Keys a sample", WIDEST_STEP), faint("keys")
        self.row(
            "Format",
            self.combo("form", "Format", FORM_NAMES),
            self.combo("bits", "Bits", [("24-bit", "24"), ("16-bit, dithered", "16")]),
            self.combo("rate_hz", "Sample rate", [(f"{hz / 1000:g} kHz", hz) for hz in RATES_HZ]),
        )
        self.row("Keys", self.lowest, faint("to"), self.highest, *every)
        self.row("Velocity layers", self.count("layers", "Velocity layers", MOST_LAYERS))
        self.row("Length", self.number("seconds", "Longest sample", SECONDS_RANGE, " s", 1, prefix="at most "))
        dry = self.check("dry", "Dry: the room is left to the sampler")
        self.row("Source", self.combo("source", "Source", SOURCE_NAMES[:2]), dry)
        self.row("File", self.file)
        self.row("", self.size_text)
        self["form"].currentIndexChanged.connect(self._show)
        for box in (self.lowest, self.highest):
            box.valueChanged.connect(self.changed)

    def show_subject(self, subject: HeardInstrument | None) -> None:
        """Show another instrument, or the same with other values; chosen keys stay if it has all of them."""
        keys = self.keys()
        super().show_subject(subject)
        if subject is None:
            return
        instrument, preset = subject.instrument, subject.preset
        low, high = instrument.range
        keys_range = keys if keys and low <= keys[0] <= keys[1] <= high else instrument.range
        for box, key in zip((self.lowest, self.highest), keys_range, strict=True):
            with QSignalBlocker(box):
                box.setRange(low, high)
                box.setValue(key)
        self["dry"].setEnabled(instrument.room.mix > 0)
        problem = body_problem(instrument)
        self.what.setText(f"{instrument.name}, played by {preset.title}" + (f"\n{problem}" if problem else ""))

    def keys(self) -> tuple[int, int] | None:
        """The chosen keys; None for all of the instrument."""
        if self.subject is None:
            return self._chosen_keys
        keys = self.lowest.value(), self.highest.value()
        return None if keys == self.subject.instrument.range else keys

    def choices(self) -> SampledChoices:
        return SampledChoices(keys=self.keys(), **self.values())

    def job(self) -> SampledExport:
        """The export of the chosen keys and layers. Raises ValueError: no instrument, or keys the wrong way round."""
        instrument, choices = self.offered.instrument, self.choices()
        if self.lowest.value() > self.highest.value():
            raise ValueError("keys: the lowest is above the highest; exchange them")
        plan = SampledPlan(
            instrument.with_value("room.mix", 0.0) if choices.dry else instrument,
            choices.keys,
            choices.every,
            choices.layers,
            choices.seconds,
            choices.rate_hz,
            source=choices.source,
        )
        if choices.form != "sf2":
            plan = replace(plan, format=choices.form, bits=choices.bits)
        return SampledExport(plan, self.file.path, self.offered.preset.path)

    def offer(self) -> tuple[str, str]:
        """The button's text; also show count, size and pitch error of the samples, and the free room if short."""
        self.size_text.setText("")
        job = self.job()
        plan = job.plan
        out = job.out
        soundfont = job.out.suffix.lower() == ".sf2"
        try:
            planned(plan, out)
            free = disk_usage(out.parent).free
        except OSError as error:
            raise WriteError(explain(out.parent, error)) from error
        short = f"; {megabytes(free)} are free there" if needed_bytes(plan, soundfont) > free else ""
        pitch = pitch_words(plan.pitch_error_cents)
        self.size_text.setText(f"{counted(plan)}, {size_words(plan, soundfont)}{short}; {pitch}")
        return "Replace" if out.is_file() else "Export", ""

    def _show(self) -> None:
        soundfont = self["form"].currentData() == "sf2"
        self["bits"].setVisible(not soundfont)
        self.file.suffix = ".sf2" if soundfont else ".sfz"
        if self.subject is not None:
            self.file.suggest(plain_stem(self.subject.instrument.name) + self.file.suffix)


class PluginPage(ExportPage):
    """An instrument as a plug-in for a DAW: format, system, place."""

    title = "Plug-in"
    missing = "There is no instrument to export: choose one first."
    writes_wav = False

    TIPS: ClassVar = {
        "form": "CLAP and VST3 for most DAWs; LV2 for Ardour, Qtractor and others on Linux",
        "system": "Of the computer that it is for",
        "file": "Where the plug-in is written; hosts look for it where it is suggested",
    }

    def __init__(self, places: FilePlaces) -> None:
        super().__init__(None, places, "plugin")
        formats = self.combo("form", "Format", [(name, form) for form, name in PLUGIN_NAMES.items()])
        systems = self.combo("system", "System", [(name, target) for target, name in SYSTEM_NAMES.items()])
        systems.setCurrentIndex(systems.findData(_this_system()))
        self.row("Format", formats, systems)
        self.row("File", self.file)
        for box in (formats, systems):
            box.currentIndexChanged.connect(self._show)

    def job(self) -> PluginExport:
        instrument, preset = self.offered.instrument, self.offered.preset.path
        check_compiler()
        form, system = self["form"].currentData(), self["system"].currentData()
        return PluginExport(instrument, preset, form, system, self.file.path)

    def offer(self) -> tuple[str, str]:
        replaces = self.job().replaces()
        return ("Replace", f"{replaces} {PLUGIN_NOTE}") if replaces else ("Export", PLUGIN_NOTE)

    def _show(self) -> None:
        """Show instrument and preset, and suggest a file: for this system, where its plug-ins are installed."""
        form, system = self["form"].currentData(), self["system"].currentData()
        self.file.suffix = f".{form}"
        if (subject := self.subject) is not None:
            self.what.setText(f"{subject.instrument.name}, played by {subject.preset.title}")
            name = subject.instrument.name + self.file.suffix
            own = system == _this_system()
            self.file.suggest(str(install_folder(form, system) / name) if own else name)


PAGES: dict[Kind, type[ExportPage]] = {
    "note": NotePage,
    "performance": PerformancePage,
    "models": ModelsPage,
    "sampler": SamplerPage,
    "plugin": PluginPage,
}


def _this_system() -> str:
    """The target of this computer; where there is none, the first."""
    try:
        return this_target()
    except PluginError:
        return next(iter(SYSTEM_NAMES))


def _through_words(sound: NoteSound, alone: bool, source: Chosen) -> str:
    """The parts of an instrument that are in the file."""
    if sound.struck is None:
        return "None: the string alone, as it is heard"
    instrument = sound.struck.instrument
    if alone:
        return f"The string alone, without {instrument.name}"
    if source == "difference":
        return f"{instrument.name}, without amplifier, body and room, as a difference is heard"
    return f"{instrument.name} with {added_words(instrument)}, as it is heard"

"""The export of an instrument for samplers: what the dialog says, writes and keeps."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import soundfile
from PySide6.QtGui import QDesktopServices
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.export.sampled.choices import SampledChoices
from app.export.sampled.plan import SampledPlan
from app.export.sampled.words import pitch_words
from app.instruments.instrument import Instrument
from app.instruments.library import find_instrument
from app.presets.library import PresetEntry, list_presets
from app.views.dialogs.export_dialog import ExportDialog
from app.views.dialogs.export_pages import HeardInstrument
from tests.app.places import choose_files, places_in
from tests.app.questions import answered

SMALL = {"keys": (60, 62), "layers": 2, "seconds": 0.2}
MADE = 3 * 2


class Notes:
    """In place of the instrument: decaying sines. After the `last` one each waits until `gate` is open."""

    def __init__(self) -> None:
        self.rendered: list[tuple] = []
        self.gate = threading.Event()  # never closed again: a note that looks late finds it open
        self.last = 10**6

    def render_note(self, instrument, preset, key, velocity, held_s, seconds, rate_hz, source, advanced):
        assert len(self.rendered) < self.last or self.gate.wait(20)
        advanced(seconds)
        self.rendered.append((instrument, key, velocity, seconds, rate_hz, source))
        time_s = np.arange(round(seconds * rate_hz)) / rate_hz
        sound = velocity / 127 * np.exp(-40 * time_s) * np.sin(2 * np.pi * 440 * 2 ** ((key - 69) / 12) * time_s)
        return np.stack([sound] * len(instrument.pickup.points), axis=1).astype(np.float32)


@pytest.fixture
def notes(monkeypatch: pytest.MonkeyPatch) -> Iterator[Notes]:
    made = Notes()
    monkeypatch.setitem(sys.modules, "app.player.offline", SimpleNamespace(render_note=made.render_note))
    yield made
    made.gate.set()


@pytest.fixture
def instrument() -> Instrument:
    return find_instrument("Classical guitar").instrument


@pytest.fixture
def preset(preset_folder: Path) -> PresetEntry:
    return list_presets(preset_folder)[0][0]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "instruments"
    made.mkdir()
    return made


@pytest.fixture
def made(
    qtbot: QtBot, instrument: Instrument, preset: PresetEntry, notes: Notes, folder: Path
) -> Iterator[Callable[..., ExportDialog]]:
    dialogs = []

    def make(**choices: object) -> ExportDialog:
        remembered = SampledChoices.model_validate({**SMALL, **choices})
        dialog = ExportDialog((ExportChoices(), remembered), places_in(folder))
        dialogs.append(dialog)
        qtbot.addWidget(dialog)
        show(dialog, instrument, preset)
        dialog.open_at("sampler")
        return dialog

    yield make
    notes.gate.set()
    for dialog in dialogs:
        dialog.accept()


def show(dialog: ExportDialog, instrument: Instrument, preset: PresetEntry) -> None:
    dialog.show_subjects({"sampler": HeardInstrument(instrument, preset)})


def says(qtbot: QtBot, dialog: ExportDialog, words: str) -> None:
    """Wait until what the choices mean is shown in these words."""
    qtbot.waitUntil(lambda: words in dialog.sampler.size_text.text())


def run(qtbot: QtBot, dialog: ExportDialog, words: str) -> None:
    dialog.save.click()
    qtbot.waitUntil(lambda: words in dialog.state.text())


def test_an_sfz_is_written_as_it_was_reported(
    qtbot: QtBot, made, folder: Path, notes: Notes, instrument: Instrument, monkeypatch: pytest.MonkeyPatch
) -> None:
    dialog = made(rate_hz=44_100, source="truth", form="wav", bits="16")
    assert "6 samples (3 keys, 2 velocity layers), at most 0.2 MB" in dialog.sampler.size_text.text()
    assert dialog.sampler.what.text().startswith(instrument.name)
    run(qtbot, dialog, "Saved")
    out = folder / "Classical_guitar.sfz"
    assert f"Saved {out} (6 samples, " in dialog.state.text()
    assert "peak -1.0 dBFS" in dialog.state.text()
    assert "softer than the instrument, so that no note clips" in dialog.state.text()
    zones = SampledPlan(instrument, SMALL["keys"], layers=SMALL["layers"]).zones
    assert [note[1:] for note in notes.rendered] == [(z.key, z.velocity, 0.2, 44_100, "truth") for z in zones]
    samples = sorted((folder / "Classical_guitar_samples").glob("*.wav"))
    assert len(samples) == MADE
    assert (soundfile.info(samples[0]).samplerate, soundfile.info(samples[0]).subtype) == (44_100, "PCM_16")
    assert dialog.save.text() == "Replace"
    opened: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: opened.append(url.toLocalFile()) or True)
    dialog.show_folder.click()
    assert opened == [str(folder)]


def test_size_and_error_of_pitch_follow_the_choices_and_nothing_is_written(
    qtbot: QtBot, made, folder: Path, notes: Notes, instrument: Instrument
) -> None:
    dialog = made()
    form = dialog.sampler
    form["layers"].setValue(8)
    says(qtbot, dialog, "24 samples (3 keys, 8 velocity layers)")
    form["every"].setValue(3)
    says(qtbot, dialog, "8 samples (1 key, each for 3 keys, 8 velocity layers)")
    for box, value in ((form.highest, 60), (form["every"], 1), (form["layers"], 1), (form["seconds"], 10)):
        box.setValue(value)
    counted = "1 sample (1 key, 1 velocity layer)"
    pitch = pitch_words(SampledPlan(instrument, (60, 60), layers=1).pitch_error_cents)
    says(qtbot, dialog, f"{counted}, at most 2.9 MB, before FLAC compression; {pitch}")
    form["form"].setCurrentIndex(form["form"].findData("sf2"))
    said = f"{counted}, at most 1.9 MB (16-bit), and up to 2.9 MB more while it is written"
    says(qtbot, dialog, f"{said}; {pitch}")
    assert not form["bits"].isVisible()
    dialog.close_button.click()
    assert not dialog.isVisible()
    assert list(folder.iterdir()) == [] and notes.rendered == []


@pytest.mark.parametrize("form", ["flac", "sf2"])
def test_a_cancelled_export_leaves_nothing(qtbot: QtBot, made, notes: Notes, folder: Path, form: str) -> None:
    notes.last = 3
    dialog = made(form=form)
    dialog.save.click()
    qtbot.waitUntil(lambda: len(notes.rendered) == 3)
    assert dialog.close_button.text() == "Cancel"
    with answered("Cancel export"):
        dialog.close()  # as its cross does: it stays, to report what was written
    assert dialog.isVisible()
    notes.gate.set()
    qtbot.waitUntil(lambda: "Cancelled; nothing was written" in dialog.state.text())
    assert len(notes.rendered) < MADE
    assert list(folder.iterdir()) == []
    assert dialog.save.text() == "Export"


def test_an_export_takes_choices_that_have_not_settled(qtbot: QtBot, made, notes: Notes) -> None:
    dialog = made()
    dialog.sampler["layers"].setValue(1)
    run(qtbot, dialog, "Saved")
    assert len(notes.rendered) == 3
    dialog.sampler.lowest.setValue(63)  # above the highest
    dialog.save.click()
    assert "the lowest is above the highest" in dialog.state.text()
    assert len(notes.rendered) == 3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda form, folder: form.lowest.setValue(63), "the lowest is above the highest"),
        (lambda form, folder: edit(form, ""), "choose where"),
        (lambda form, folder: edit(form, str(folder / "nowhere" / "x.sfz")), "make the folder first"),
        (
            lambda form, folder: (form["form"].setCurrentIndex(2), form["rate_hz"].setCurrentIndex(2)),
            "a SoundFont's rate",
        ),
    ],
)
def test_what_cannot_be_is_reported_before_it_begins(
    qtbot: QtBot, made, folder: Path, change: Callable, words: str
) -> None:
    dialog = made()
    change(dialog.sampler, folder)
    qtbot.waitUntil(lambda: words in dialog.state.text())
    assert dialog.state.objectName() == "warning"
    assert not dialog.save.isEnabled()
    assert dialog.sampler.size_text.text() == ""
    edit(dialog.sampler, str(folder / f"y{dialog.sampler.file.suffix}"))
    dialog.sampler["rate_hz"].setCurrentIndex(1)
    dialog.sampler.lowest.setValue(60)
    qtbot.waitUntil(dialog.save.isEnabled)


def edit(form, text: str) -> None:
    form.file.edit.setText(text)
    form.file.edit.textEdited.emit(text)


def test_its_state_is_remembered(made, folder: Path, instrument: Instrument) -> None:
    dialog = made()
    form = dialog.sampler
    for box, data in (
        (form["form"], "wav"),
        (form["bits"], "16"),
        (form["rate_hz"], 44_100),
        (form["source"], "truth"),
    ):
        box.setCurrentIndex(box.findData(data))
    form["every"].setValue(2)
    form["dry"].setChecked(True)
    choices = dialog.choices()[1]
    assert choices == SampledChoices(
        form="wav", bits="16", rate_hz=44_100, every=2, source="truth", dry=True, **SMALL
    )
    assert made(**choices.model_dump()).choices()[1] == choices
    whole = made(keys=None)
    assert (whole.sampler.lowest.value(), whole.sampler.highest.value()) == instrument.range
    assert whole.choices()[1].keys is None
    assert made(keys=(0, 127)).choices()[1].keys is None  # not of this instrument


def test_the_file_is_named_after_the_instrument_and_ends_as_its_format(
    made, folder: Path, instrument: Instrument, preset: PresetEntry, monkeypatch: pytest.MonkeyPatch
) -> None:
    dialog = made()
    other = find_instrument("Concert harp").instrument
    show(dialog, other, preset)
    assert dialog.sampler.file.path == folder / "Concert_harp.sfz"
    assert dialog.sampler.what.text().startswith("Concert harp")
    assert dialog.choices()[1].keys == (60, 62)
    choose_files(monkeypatch, folder / "mine")
    dialog.sampler.file.browse()
    assert dialog.sampler.file.path == folder / "mine.sfz"
    dialog.sampler["form"].setCurrentIndex(2)
    assert dialog.sampler.file.path == folder / "mine.sf2"
    show(dialog, instrument, preset)
    assert dialog.sampler.file.path == folder / "mine.sf2"


def test_a_instrument_that_is_turned_meanwhile_waits_for_the_next_time(
    qtbot: QtBot, made, notes: Notes, instrument: Instrument, preset: PresetEntry
) -> None:
    notes.last = 1
    dialog = made()
    dialog.save.click()
    qtbot.waitUntil(lambda: len(notes.rendered) == 1)
    show(dialog, instrument.with_value("knobs.decay", 3.0), preset)
    notes.gate.set()
    qtbot.waitUntil(lambda: "6 samples, " in dialog.state.text())
    assert {note[0].knobs.decay for note in notes.rendered} == {instrument.knobs.decay}
    dialog.save.click()
    qtbot.waitUntil(lambda: notes.rendered[-1][0].knobs.decay == 3.0)
    qtbot.waitUntil(lambda: "6 samples, " in dialog.state.text())

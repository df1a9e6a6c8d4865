"""A dropped recording: string or body; the string is learned, compared with the recording, and kept or not."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QRadioButton, QStackedWidget, QVBoxLayout, QWidget

from app.audio.note_file import NoteFileError
from app.audio.sound import Sound
from app.instruments.library import InstrumentError
from app.playing.pair import Pair
from app.shared.worker import Job, Work
from app.views.controls.form import Form
from app.views.controls.parts import NO_MARGINS, filled, label, push_button, read_only_text
from app.views.dialogs.question import ask
from app.views.dialogs.work_dialog import WorkDialog
from engine.plain_text import name_text
from engine.presets import PresetError
from engine.whole_file import WriteError

if TYPE_CHECKING:
    from app.player.learned import Reasons
    from training.recording.learn import Learned

EXPECTED = (NoteFileError, InstrumentError, PresetError, WriteError, ValueError)
KINDS = (("Guitar", "guitar"), ("Bass", "bass"), ("Harp", "harp"), ("Piano", "piano"))
CONTINUE, STOP = "Continue", "Stop learning"
BACK, DISCARD = "Back", "Discard"
LONGEST_M, THICKEST_MM = 5.0, 10.0
ON_KEYS = "Keys will play a plucked string with these partials: close to the learned note, not equal to it."
NOT_FOUND = "No string was found: keys will not sound like the recording. Record one plucked note alone."
HEARD: tuple[tuple[Literal["recording", "learned"], str], ...] = (
    ("recording", "▶  Recording"),
    ("learned", "▶  Learned note"),
)


class LearnDialog(WorkDialog):
    """A dialog that writes nothing before "Keep and play".

    The file is examined: is it one note of a string? The user chooses string or body, an impulse response that
    instruments are played through. A string is learned; the second page compares it with the recording.

    Errors are stated without anything copied from the recording.
    """

    body_chosen = Signal(str)  # the file
    instrument_kept = Signal(object)  # `Kept`
    KNOWN = "Type it where you know it; otherwise it is assumed"
    TIPS: ClassVar = {
        "kind": "For what a sound does not give: density and length",
        "length_m": KNOWN,
        "gauge_mm": KNOWN,
    }

    def __init__(self, file: Path, output: Sound, parent: QWidget | None = None) -> None:
        super().__init__(file.name, 620, "learn", EXPECTED, parent)
        self._file, self._output = file, output
        self._learned: Learned | None = None  # the string, not kept yet; None: nothing was learned
        self._pair: Pair | None = None  # plays recording and learned note; None until it is learned
        self._against: Reasons | None = None  # against the file as a note of a string; None: not examined yet
        self.string, self.body = QRadioButton("A string: learn it from this note"), QRadioButton("A body")
        self.body.setToolTip("The sound becomes an impulse response: instruments are played through it")
        self.string.setToolTip("The note becomes a preset and an instrument over two octaves")
        for choice in (self.string, self.body):
            choice.toggled.connect(self._show_choice)
        self.name = QLineEdit(name_text(file.stem[:60]))
        self.name.setAccessibleName("Name of the instrument")
        self._form = Form(None, self.TIPS)
        self._form.row("Name", self.name)
        self.kind = self._form.combo("kind", "Instrument", KINDS)
        self.length_m = self._form.number("length_m", "Sounding length", (0, LONGEST_M), " m", 3, 0.01)
        self.gauge_mm = self._form.number("gauge_mm", "Diameter", (0, THICKEST_MM), " mm", 2, 0.05)
        for name, control in (("Instrument", self.kind), ("Length", self.length_m), ("Diameter", self.gauge_mm)):
            self._form.row(name, control)
        for box in (self.length_m, self.gauge_mm):
            box.setSpecialValueText("assumed")  # where it is 0
        self.report = read_only_text("Report")
        tip = "Both play on, in a loop; the switch is at the same moment"
        self.heard = {key: push_button(text, tip, checkable=True, autoDefault=True) for key, text in HEARD}
        for key, button in self.heard.items():
            button.clicked.connect(partial(self._hear, key))
        tip = "Learn the string, keep the instrument, or use the sound as a body"
        self.start = push_button("Continue", tip, kind="primary", pressed=self._continue, autoDefault=True)
        self.start.setDefault(True)
        self.close_button = push_button("Cancel", pressed=self.reject, autoDefault=True)
        self._pages = QStackedWidget()
        self._lay_out()
        self._examine()

    def _lay_out(self) -> None:
        question, result = QWidget(), QWidget()
        heading = label(text="String or body?")
        parts = heading, self.string, self._form, self.body, None
        filled(QVBoxLayout(question), *parts, margins=NO_MARGINS)
        sounds = filled(QHBoxLayout(), *self.heard.values())
        for place in range(sounds.count()):
            sounds.setStretch(place, 1)
        filled(QVBoxLayout(result), sounds, self.report, margins=NO_MARGINS)
        for page in (question, result):
            self._pages.addWidget(page)
        buttons = filled(QHBoxLayout(), None, self.close_button, self.start)
        filled(QVBoxLayout(self), self._pages, self.bar, self.state, buttons, spacing=12)

    # String or body

    def _examine(self) -> None:
        """Find in the background the reasons against the file as one note of a string."""
        self.state.setText("Is this one note of a string? …")
        self.start.setEnabled(False)

        def work(job: Job) -> Reasons:
            from app.player.learned import reasons_against

            return reasons_against(self._file)

        self.begin(work, self._show_examined, bar=False)

    def _show_examined(self, against: Reasons) -> None:
        self._against = against
        (self.body if against.refusals else self.string).setChecked(True)
        self._show_choice()

    def _show_choice(self) -> None:
        """Show what will be done with the file, string or body, and the reasons against it as a string."""
        if self.background.busy:
            return
        self._form.setEnabled(self.string.isChecked())
        against = self._against
        refusals, warnings = (against.refusals, against.warnings) if against is not None else ([], [])
        if self.body.isChecked():
            words = "Not one note of a string:" if refusals else "This may be one note of a string."
        elif refusals:
            words = "Learned all the same, although:"
        else:
            words = "Learning takes about five seconds, and shows whether a string was found."
        self.state.setText("\n".join([words, *(f"• {finding}" for finding in (*refusals, *warnings))]))
        self.start.setText("Use as body" if self.body.isChecked() else "Learn")
        self.start.setEnabled(self.body.isChecked() or self.string.isChecked())

    def _continue(self) -> None:
        """Keep what was learned; before that, use the file as a body, or learn its string."""
        if self._learned is not None:
            self._keep()
        elif self.body.isChecked():
            self.body_chosen.emit(str(self._file))
            self.accept()
        elif self._against is not None:
            self._learn()

    # Learning

    def _learn(self) -> None:
        """Learn the string in the background; a length or a diameter of 0 is left to be assumed."""
        choices = {
            "kind": self.kind.currentData(),
            "length_m": self.length_m.value() or None,
            "gauge_mm": self.gauge_mm.value() or None,
            "anyway": self._against is not None and bool(self._against.refusals),
        }
        name, rate_hz = self.name.text(), self._output.rate_hz

        def work(job: Job) -> tuple[Any, Any]:
            from app.player.learned import both_sounds, check_name, learn_files

            check_name(name)
            (learned,) = learn_files([self._file], progress=job.progress, **choices)
            return learned, both_sounds(learned, rate_hz)

        self._work(work, self._show_learned)

    def progress_words(self, text: str, left: str) -> str:
        return f"Learning the string.{left and f' {left.capitalize()}.'}"

    def _show_learned(self, result: tuple[Any, Any]) -> None:
        """Show the second page: `result` is what was learned, and the sounds of recording and learned note."""
        from training.recording.table import as_text

        self._learned, sounds = result
        assert self._learned is not None
        self._pair = Pair(self._output.mixer, sounds)
        self.report.setPlainText("\n".join(as_text(self._learned)))
        self._pages.setCurrentIndex(1)
        has_string = self._learned.verdict.found
        self._show_ready(f"Nothing is written yet. {ON_KEYS if has_string else NOT_FOUND}")
        self.start.setText("Keep and play" if has_string else "Keep all the same")
        self.start.setDefault(has_string)
        self.start.setAutoDefault(has_string)
        self.heard["learned"].setFocus()

    def _hear(self, name: str) -> None:
        """Play the sound of a button, or stop where none is checked."""
        for key, button in self.heard.items():
            button.setChecked(key == name and button.isChecked())
        if self._pair is None:
            return
        if not any(button.isChecked() for button in self.heard.values()):
            self._pair.stop()
            return
        self._pair.select(name)
        self._pair.play()

    # The end

    def _keep(self) -> None:
        """Write preset and instrument in the background, then close."""
        learned = self._learned
        name = self.name.text()
        kind = self.kind.currentData()

        def work(job: Job) -> Any:
            from app.player.learned import keep

            assert learned is not None
            return keep(name, [learned], kind)

        self._work(work, self._show_kept)

    def _work(self, work: Work, then: Callable[[Any], None]) -> None:
        self._pages.setEnabled(False)
        self.start.setEnabled(False)
        self.begin(work, then)

    def _show_kept(self, kept: object) -> None:
        self.instrument_kept.emit(kept)
        self.accept()

    def show_failure(self, message: str) -> None:
        """Show why it failed; where the examination did, the file can only be a body."""
        from app.player.learned import Reasons

        if self._against is None:  # not even examined: it can only be a body
            self.string.setEnabled(False)
            self._against = Reasons([message], [])
            self.body.setChecked(True)
            self._show_choice()
            return
        self._show_ready(message)

    def show_cancelled(self) -> None:
        self._show_ready("Cancelled. Learn continues there.")

    def _show_ready(self, words: str) -> None:
        self.bar.hide()
        self._pages.setEnabled(True)
        self.start.setEnabled(True)
        self.state.setText(words)

    def may_close(self) -> bool:
        """Return True if nothing would be lost, or the user agrees to that."""
        if self.background.busy and self._against is not None:
            question = "The string is being learned. A learning that is stopped continues the next time."
            return ask(self, "Stop learning?", question, CONTINUE, STOP) == STOP
        if self._learned is not None:
            question = "The learned instrument is not kept yet."
            return ask(self, "Discard the instrument?", question, BACK, DISCARD) == DISCARD
        return True

    def reject(self) -> None:
        """Escape or Cancel: ends the learning under way, which can be continued; otherwise closes."""
        if self.background.busy and self._against is not None:
            self.background.stop()
        elif self.may_close():
            super().reject()

    def done(self, result: int) -> None:
        if self._pair is not None:
            self._pair.stop()
        self.background.close()
        super().done(result)

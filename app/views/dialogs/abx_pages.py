"""The pages of the listening test: what is compared, a trial, the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import ClassVar

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QPushButton, QVBoxLayout, QWidget

from app.analysis.abx.record import MEANING, AbxRecord, p_text
from app.analysis.abx.trials import LEVEL, MOST_TRIALS, AbxChoices, needed_correct
from app.views.controls.form import Form
from app.views.controls.parts import NO_MARGINS, filled, label, push_button, show_kind
from app.views.controls.plain import Label

HEAR = "Listen to X, then answer which one it is."
SAY = "Which one is X?"
RULES = (
    "In each trial X is A or B, chosen at random and hidden. Listen to A, B and X as often as you like, "
    "then answer which one X is. Both play at the same level."
)
KEYS = "A  B  X  hear   ·   Space  replay   ·   1 or ←  X is A   ·   2 or →  X is B"
_LARGE = "QPushButton { font-size: 17px; min-height: 74px; min-width: 130px; }"


class SetupPage(QWidget):
    """The page before the test; `show_state` shows whether it can start. `words`: the compared sounds."""

    audition_asked = Signal(str)  # "A" or "B"
    TIPS: ClassVar = {
        "trials": "Fixed before the start: a test that could stop at any time would prove nothing",
        "restart": "Otherwise the switch happens at the playhead, with a cross-fade",
    }

    def __init__(self, words: str, labels: Sequence[str], choices: AbxChoices) -> None:
        super().__init__()
        form = Form(choices, self.TIPS)
        self.trials = form.count("trials", "Number of trials", MOST_TRIALS)
        self.trials.valueChanged.connect(lambda: self._show_trials(self.trials.value()))
        self.restart = form.check("restart", "Restart from the pluck at each switch")
        self._needed, self._warning = label("faint"), label("warning")
        self.start = push_button("Start the test", "Begin the first trial", kind="play")
        self.start.setDefault(True)  # at first it is disabled and cannot have the focus
        self.close_button = push_button("Close", "Close the listening test")
        self._listen = []
        form.row("Note", label(text=words))
        for name, text in zip("AB", labels, strict=True):
            listen = push_button(f"▶  Hear {name}", f"Listen to {name} before the test ({name})")
            listen.clicked.connect(lambda _=False, name=name: self.audition_asked.emit(name))
            self._listen.append(listen)
            form.row(name, listen, Label(text))
        form.row("Trials", self.trials, self._needed)
        form.row("Switch", self.restart)
        self._needed.setMinimumWidth(320)
        buttons = filled(QHBoxLayout(), None, self.close_button, self.start)
        parts = label(text=RULES), form, label("faint", MEANING), None, self._warning, buttons
        filled(QVBoxLayout(self), *parts, spacing=14, margins=NO_MARGINS)
        self._show_trials(choices.trials)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        name = {Qt.Key.Key_A: "A", Qt.Key.Key_B: "B"}.get(Qt.Key(event.key()))
        if name is None or event.modifiers():
            super().keyPressEvent(event)
        else:
            self.audition_asked.emit(name)

    def show_state(self, obstacle: str, advice: str) -> None:
        """Show why the test cannot start, and what to know before it does; "": nothing."""
        for button in (self.start, *self._listen):
            button.setEnabled(not obstacle)
        self._warning.setText(obstacle or advice)
        self._warning.setVisible(bool(obstacle or advice))

    def _show_trials(self, trials: int) -> None:
        needed = needed_correct(trials)
        self._needed.setText(
            f"Too few: even with all of them right, the p-value is not below {LEVEL:g}."
            if needed is None
            else f"{needed} right of {trials} give a p-value below {LEVEL:g}."
        )


class TrialPage(QWidget):
    """A trial, with keys for everything. Nothing here may depend on whether X is A or B.

    The page itself has the focus, not its buttons, so that its keys always work: Space would press a button.
    """

    audition_asked = Signal(str)  # "A", "B" or "X"
    replay_asked = Signal()
    answered = Signal(str)  # "A" or "B"

    def __init__(self, labels: Sequence[str]) -> None:
        super().__init__()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Trial")
        self.setAccessibleDescription(
            "A, B and X: hear them. 1 or left: X is A. 2 or right: X is B. Space: replay. Escape: stop the test."
        )
        self._number = _centred("font-size: 20px; font-weight: 600;")
        self._bar = QProgressBar(textVisible=False)
        self._bar.setFixedHeight(6)
        self._bar.setAccessibleName("Trials answered")
        self._hint = _centred()
        texts = {"A": labels[0], "X": "?", "B": labels[1]}
        self._sounds = {name: self._sound_button(name, text) for name, text in texts.items()}
        self._answers = {
            "A": push_button("←  X is A", "Answer: X is A (1 or ←)"),
            "B": push_button("X is B  →", "Answer: X is B (2 or →)"),
        }
        for name, button in self._answers.items():
            button.setMinimumHeight(42)
            button.clicked.connect(lambda _=False, name=name: self.answered.emit(name))
        self.stop = push_button(
            "Stop the test", "An unfinished test is recorded as incomplete, without p-value (Esc)"
        )
        for button in (*self._sounds.values(), *self._answers.values(), self.stop):
            button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        keys = _centred()
        keys.setText(KEYS)
        sounds, answers = (filled(QHBoxLayout(), *buttons.values()) for buttons in (self._sounds, self._answers))
        for place in range(len(self._sounds)):
            sounds.setStretch(place, 1)
            answers.setStretch(place, 1)
        last = filled(QHBoxLayout(), None, self.stop)
        parts = self._number, self._bar, None, sounds, self._hint, answers, None, keys, last
        filled(QVBoxLayout(self), *parts, spacing=14, margins=NO_MARGINS)
        self._acts: dict[int, Callable[[], object]] = {  # Qt's key -> what it does
            **{getattr(Qt.Key, f"Key_{name}"): partial(self.audition_asked.emit, name) for name in "ABX"},
            **dict.fromkeys((Qt.Key.Key_1, Qt.Key.Key_Left), self._answers["A"].click),  # nothing while disabled
            **dict.fromkeys((Qt.Key.Key_2, Qt.Key.Key_Right), self._answers["B"].click),
            Qt.Key.Key_Space: self.replay_asked.emit,
        }

    def _sound_button(self, name: str, text: str) -> QPushButton:
        kind, spoken = ("", "Hear X") if name == "X" else (text.lower(), f"Hear {name}: {text}")
        button = push_button(f"{name}\n{text}", f"Hear {name} ({name})", spoken, kind, checkable=True)
        button.setStyleSheet(_LARGE)
        button.clicked.connect(lambda _=False, name=name: self.audition_asked.emit(name))
        return button

    def keyPressEvent(self, event: QKeyEvent) -> None:
        act = self._acts.get(event.key())
        if act is None:
            super().keyPressEvent(event)
        elif not event.isAutoRepeat():
            act()

    def show_trial(self, number: int, trials: int) -> None:
        """Show a new trial, in which nothing has been heard."""
        self._number.setText(f"Trial {number} of {trials}")
        self._bar.setRange(0, trials)
        self._bar.setValue(number - 1)
        self.show_sounding(None, x_heard=False)

    def show_sounding(self, sound: str | None, x_heard: bool) -> None:
        """Show the one of "A", "B" and "X" that sounds (None: none).

        `x_heard`: X was heard, so that it can be answered.
        """
        for name, button in self._sounds.items():
            button.setChecked(name == sound)
        for button in self._answers.values():
            button.setEnabled(x_heard)
        self._hint.setText(SAY if x_heard else HEAR)


class ResultPage(QWidget):
    """The page of a result, and of its saving; `save` is to save it elsewhere after a failure."""

    def __init__(self) -> None:
        super().__init__()
        self._score, self._p = _centred("font-size: 26px; font-weight: 600;"), _centred("font-size: 17px;")
        self._marks, self._verdict = _centred(), _centred()
        self._marks.setToolTip("The trials in their order: filled where the answer was right")
        self._meaning, self._saved = label("faint", MEANING), label("faint", selectable=True)
        self.save = push_button("Save elsewhere …", "Choose another folder")
        self.again = push_button("New test", "Back to the first page")
        self.close_button = push_button("Close", "Close the listening test")
        last = filled(QHBoxLayout(), None, self.save, self.again, self.close_button)
        parts = None, self._score, self._marks, self._p, self._verdict, None, self._meaning, self._saved, last
        filled(QVBoxLayout(self), *parts, spacing=14, margins=NO_MARGINS)

    def show_record(self, record: AbxRecord) -> None:
        """Show the score, the mark of each trial, and the p-value; of an incomplete test its number of answers."""
        answered = len(record.trials)
        self._score.setText(f"{record.correct} of {answered} right")
        self._marks.setText(" ".join("●" if trial.correct else "○" for trial in record.trials))
        unfinished = f"{answered} of {record.planned_trials} trials answered"
        self._p.setText(unfinished if record.p_value is None else p_text(record.p_value))
        pair = f"{record.a.label} and {record.b.label} of {record.a.preset}, {record.date:%Y-%m-%d %H:%M}."
        self._verdict.setText(" ".join(filter(None, (record.remark, record.verdict, pair))))
        self._meaning.setVisible(record.complete)
        self.close_button.setFocus()

    def show_saved(self, text: str, failed: bool) -> None:
        """Show where the result was saved; or why it was not, with a button to save it elsewhere."""
        show_kind(self._saved, "warning" if failed else "faint")
        self._saved.setText(text)
        self.save.setVisible(failed)


def _centred(style: str = "") -> QLabel:
    text_label = label("" if style else "faint")
    text_label.setAlignment(Qt.AlignmentFlag.AlignCenter)
    text_label.setStyleSheet(style)
    return text_label

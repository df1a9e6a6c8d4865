"""A trial of the listening test, with keys for everything. Nothing here may depend on whether X is A or B."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QProgressBar, QPushButton, QVBoxLayout, QWidget

from app.analysis.abx.record import Candidate
from app.views.controls.parts import label
from app.views.controls.plain import Label

HEAR = "Listen to X, then answer which one it is."
SAY = "Which one is X?"
_LARGE = "QPushButton { font-size: 17px; min-height: 74px; min-width: 130px; }"


class TrialPage(QWidget):
    """The page itself has the focus, not its buttons, so that its keys always work: Space would press a button."""

    audition_asked = Signal(str)  # "A", "B" or "X"
    replay_asked = Signal()
    answered = Signal(str)  # "A" or "B"

    def __init__(self) -> None:
        super().__init__()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Trial")
        self.setAccessibleDescription(
            "A, B and X: hear them. 1 or left: X is A. 2 or right: X is B. Space: replay. Escape: stop the test."
        )
        self._number = Label(alignment=Qt.AlignmentFlag.AlignCenter)
        self._number.setStyleSheet("font-size: 20px; font-weight: 600;")
        self._bar = QProgressBar(textVisible=False)
        self._bar.setFixedHeight(6)
        self._bar.setAccessibleName("Trials answered")
        self._hint = label("faint")
        self._hint.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._sounds = {name: self._build_sound(name) for name in "AXB"}
        self._answers = {
            "A": self._build_answer("A", "←  X is A", "Answer: X is A (1 or ←)"),
            "B": self._build_answer("B", "X is B  →", "Answer: X is B (2 or →)"),
        }
        self._lay_out()
        keys = Qt.Key
        self._acts: dict[int, Callable[[], None]] = {
            **{getattr(keys, f"Key_{name}"): partial(self.audition_asked.emit, name) for name in "ABX"},
            **dict.fromkeys((keys.Key_1, keys.Key_Left), self._answers["A"].click),  # nothing while it is disabled
            **dict.fromkeys((keys.Key_2, keys.Key_Right), self._answers["B"].click),
            keys.Key_Space: self.replay_asked.emit,
        }

    def keyPressEvent(self, event: QKeyEvent) -> None:
        act = self._acts.get(event.key())
        if act is None:
            super().keyPressEvent(event)
        elif not event.isAutoRepeat():
            act()

    def show_pair(self, a: Candidate, b: Candidate) -> None:
        for name, candidate in (("A", a), ("B", b)):
            button = self._sounds[name]
            button.setText(f"{name}\n{candidate.label}")
            button.setAccessibleName(f"Hear {name}: {candidate.label}")
            button.setObjectName(candidate.source)  # its colour in the style sheet
            button.style().polish(button)

    def show_trial(self, number: int, trials: int) -> None:
        """A new trial, in which nothing has been heard."""
        self._number.setText(f"Trial {number} of {trials}")
        self._bar.setRange(0, trials)
        self._bar.setValue(number - 1)
        self.show_sounding(None, x_heard=False)

    def show_sounding(self, sound: str | None, x_heard: bool) -> None:
        """Which of "A", "B" and "X" sounds (None: none), and whether X was heard, so that it can be answered."""
        for name, button in self._sounds.items():
            button.setChecked(name == sound)
        for button in self._answers.values():
            button.setEnabled(x_heard)
        self._hint.setText(SAY if x_heard else HEAR)

    def _build_sound(self, name: str) -> QPushButton:
        button = QPushButton(f"{name}\n?")
        button.setCheckable(True)
        button.setStyleSheet(_LARGE)
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        button.setAccessibleName(f"Hear {name}")
        button.setToolTip(f"Hear {name} ({name})")
        button.clicked.connect(lambda: self.audition_asked.emit(name))
        return button

    def _build_answer(self, name: str, text: str, tip: str) -> QPushButton:
        button = QPushButton(text)
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        button.setMinimumHeight(42)
        button.setToolTip(tip)
        button.clicked.connect(lambda: self.answered.emit(name))
        return button

    def _lay_out(self) -> None:
        sounds, answers = QHBoxLayout(), QHBoxLayout()
        for row, buttons in ((sounds, self._sounds), (answers, self._answers)):
            row.setSpacing(12)
            for button in buttons.values():
                row.addWidget(button, 1)
        self.stop = QPushButton("Stop the test")
        self.stop.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.stop.setToolTip("An unfinished test is recorded as incomplete and gives no p-value (Esc)")
        keys = label("faint", "A  B  X  hear   ·   Space  replay   ·   1 or ←  X is A   ·   2 or →  X is B")
        keys.setAlignment(Qt.AlignmentFlag.AlignCenter)
        foot = QHBoxLayout()
        foot.addStretch(1)
        foot.addWidget(self.stop)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(16)
        column.addWidget(self._number)
        column.addWidget(self._bar)
        column.addStretch(1)
        column.addLayout(sounds)
        column.addWidget(self._hint)
        column.addLayout(answers)
        column.addStretch(1)
        column.addWidget(keys)
        column.addLayout(foot)

"""The first page of the listening test: what is compared, in how many trials, and what the result will mean."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QButtonGroup,
    QCheckBox,
    QComboBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from app.analysis.abx.record import MEANING, Candidate
from app.analysis.abx.trials import LEVEL, MOST_TRIALS, USUAL_TRIALS, needed_correct
from app.views.controls.parts import combo_box, label, tool_button
from app.views.controls.plain import Label

ROW_HEIGHT = 30


class SetupPage(QWidget):
    """Asks with signals; `show_state` says whether the test can start."""

    audition_asked = Signal(str)  # "A" or "B"
    pair_changed = Signal()

    def __init__(self, candidates: Sequence[Candidate], trials: int, restart: bool, folder: Path) -> None:
        super().__init__()
        self._candidates = candidates
        self.folder = folder
        self._pair = [self._build_choice(name, place) for place, name in enumerate("AB")]
        self._trials = QSpinBox(minimum=1, maximum=MOST_TRIALS, value=trials)
        self._trials.setFixedSize(64, ROW_HEIGHT)
        self._trials.lineEdit().setTextMargins(6, 0, 0, 0)
        self._trials.setAccessibleName("Number of trials")
        self._trials.setToolTip("Fixed before the start: a test that could stop at any time would prove nothing")
        self._trials.valueChanged.connect(self._show_trials)
        self._restart = QCheckBox("Restart from the pluck at each switch")
        self._restart.setChecked(restart)
        self._restart.setMinimumHeight(ROW_HEIGHT)
        self._restart.setToolTip("Otherwise the switch happens at the playhead, with a cross-fade")
        self._needed = label("faint")
        self._folder = label("faint", selectable=True)
        self._warning = label("warning")
        self._warning.hide()
        self.start = QPushButton("Start the test")
        self.start.setObjectName("play")
        self._lay_out()
        self._show_trials(trials)
        self._show_folder()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        name = {Qt.Key.Key_A: "A", Qt.Key.Key_B: "B"}.get(Qt.Key(event.key()))
        if name is None or event.modifiers():
            super().keyPressEvent(event)
        else:
            self.audition_asked.emit(name)

    @property
    def pair(self) -> tuple[Candidate, Candidate]:
        """A and B."""
        a, b = (self._candidates[box.currentIndex()] for box in self._pair)
        return a, b

    @property
    def trials(self) -> int:
        return self._trials.value()

    @property
    def restart(self) -> bool:
        return self._restart.isChecked()

    def show_state(self, obstacle: str, advice: str) -> None:
        """`obstacle`: why the test cannot start, or ""; `advice`: what to know before it does, or ""."""
        self.start.setEnabled(not obstacle)
        for listen in self._listen:
            listen.setEnabled(not obstacle)
        self._warning.setText(obstacle or advice)
        self._warning.setVisible(bool(obstacle or advice))

    def _build_choice(self, name: str, place: int) -> QComboBox:
        box = combo_box(f"Sound {name}", [(c.label, c.source) for c in self._candidates])
        box.setCurrentIndex(place)
        box.setToolTip(f"What {name} is")
        box.currentIndexChanged.connect(self.pair_changed)
        return box

    def _lay_out(self) -> None:
        form = QFormLayout()
        form.setLabelAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        form.setVerticalSpacing(12)
        self._listen = []
        for name, box in zip("AB", self._pair, strict=True):
            listen = tool_button(f"▶  Hear {name}", f"Hear {name}", f"Listen to {name} before the test ({name})")
            listen.clicked.connect(lambda _=False, name=name: self.audition_asked.emit(name))
            self._listen.append(listen)
            row = QHBoxLayout()
            row.setSpacing(10)
            row.addWidget(box, 1)
            row.addWidget(listen)
            form.addRow(_row_name(name), row)
        form.addRow(_row_name("Trials"), self._build_trials())
        form.addRow("", self._needed)
        form.addRow(_row_name("Switch"), self._restart)
        change = tool_button("Change …", "Folder of the results", "Choose where the result is saved")
        change.clicked.connect(self._choose_folder)
        place = QHBoxLayout()
        place.addWidget(self._folder, 1)
        place.addWidget(change)
        form.addRow(_row_name("Result"), place)
        what = label(
            text="In each trial X is A or B, chosen at random and hidden. Listen to A, B and X as often as you like, "
            "then answer which one X is. Both play at the same level."
        )
        self.close_button = QPushButton("Close", autoDefault=False)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(self.close_button)
        buttons.addWidget(self.start)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(14)
        column.addWidget(what)
        column.addLayout(form)
        column.addWidget(label("faint", MEANING))
        column.addStretch(1)
        column.addWidget(self._warning)
        column.addLayout(buttons)

    def _build_trials(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(8)
        self._usual = QButtonGroup(self)
        self._usual.setExclusive(False)  # for any other number none is checked
        for trials in USUAL_TRIALS:
            button = tool_button(str(trials), f"{trials} trials", f"A test of {trials} trials")
            button.setCheckable(True)
            button.clicked.connect(lambda _=False, trials=trials: self._choose_trials(trials))
            self._usual.addButton(button, trials)
            row.addWidget(button)
        row.addWidget(self._trials)
        row.addStretch(1)
        return row

    def _choose_trials(self, trials: int) -> None:
        with QSignalBlocker(self._trials):
            self._trials.setValue(trials)
        self._show_trials(trials)

    def _show_trials(self, trials: int) -> None:
        for button in self._usual.buttons():
            button.setChecked(self._usual.id(button) == trials)
        needed = needed_correct(trials)
        self._needed.setText(
            f"Too few: even with all of them right, the p-value is not below {LEVEL:g}."
            if needed is None
            else f"{needed} right of {trials} give a p-value below {LEVEL:g}."
        )

    def _choose_folder(self) -> None:
        chosen = QFileDialog.getExistingDirectory(self, "Folder of the results", str(self.folder))
        if chosen:
            self.folder = Path(chosen)
            self._show_folder()

    def _show_folder(self) -> None:
        self._folder.setText(str(self.folder))


def _row_name(text: str) -> QLabel:
    """As high as the buttons of its row, so that it is level with them."""
    made = Label(text)
    made.setMinimumHeight(ROW_HEIGHT)
    return made

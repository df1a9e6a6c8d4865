"""The last page of the listening test: the score, what it means, and where it is saved."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from app.analysis.abx.record import MEANING, AbxRecord, p_text
from app.views.controls.parts import label
from app.views.controls.plain import Label


class ResultPage(QWidget):
    """One result, and whether it has been saved; `save` is to save it elsewhere after a failure."""

    def __init__(self) -> None:
        super().__init__()
        self._score = Label(alignment=Qt.AlignmentFlag.AlignCenter)
        self._score.setStyleSheet("font-size: 26px; font-weight: 600;")
        self._p = Label(alignment=Qt.AlignmentFlag.AlignCenter)
        self._p.setStyleSheet("font-size: 17px;")
        self._verdict = label()
        self._verdict.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._marks = label("faint")
        self._marks.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._marks.setToolTip("The trials in their order: filled where the answer was right")
        self._meaning = label("faint", MEANING)
        self._saved = label("faint", selectable=True)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        self.save, self.again, self.close_button = (
            QPushButton(text, autoDefault=False) for text in ("Save elsewhere …", "New test", "Close")
        )
        for button in (self.save, self.again, self.close_button):
            buttons.addWidget(button)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(12)
        column.addStretch(1)
        for widget in (self._score, self._marks, self._p, self._verdict):
            column.addWidget(widget)
        column.addStretch(1)
        column.addWidget(self._meaning)
        column.addWidget(self._saved)
        column.addLayout(buttons)

    def show_record(self, record: AbxRecord) -> None:
        answered = len(record.trials)
        self._score.setText(f"{record.correct} of {answered} right")
        self._marks.setText(" ".join("●" if trial.correct else "○" for trial in record.trials))
        unfinished = f"{answered} of {record.planned_trials} trials answered"
        self._p.setText(unfinished if record.p_value is None else p_text(record.p_value))
        self._verdict.setText(" ".join(filter(None, (record.remark, record.verdict))))
        self._meaning.setVisible(record.complete)
        self.close_button.setFocus()

    def show_saved(self, text: str, failed: bool) -> None:
        """Where the result was saved; or why it was not, with a button to save it elsewhere."""
        self._saved.setObjectName("warning" if failed else "faint")
        self._saved.style().polish(self._saved)
        self._saved.setText(text)
        self.save.setVisible(failed)

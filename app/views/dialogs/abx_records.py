"""Earlier listening tests: the records of a folder, each in words, to be exported as text."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFontDatabase
from PySide6.QtWidgets import (
    QFileDialog,
    QHBoxLayout,
    QListWidget,
    QPlainTextEdit,
    QPushButton,
    QSplitter,
    QVBoxLayout,
    QWidget,
)

from app.analysis.abx.record import AbxRecord, list_records
from app.analysis.abx.text import as_text, score_text
from app.shared.whole_file import WriteError, whole_file
from app.views import theme
from app.views.controls.parts import label, read_only_text


class RecordsPage(QWidget):
    """Shows the records of the folder that `show_folder` reads."""

    back_asked = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._records: list[tuple[Path, AbxRecord]] = []
        self._list = QListWidget()
        self._list.setSpacing(3)
        self._list.setStyleSheet(f"QListWidget::item:selected {{ background: {theme.LINE}; color: {theme.TEXT}; }}")
        self._list.setAccessibleName("Earlier listening tests")
        self._list.currentRowChanged.connect(self._show_row)
        self._text = read_only_text("The record")
        self._text.setLineWrapMode(QPlainTextEdit.LineWrapMode.WidgetWidth)
        self._text.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self._state = label("faint", selectable=True)
        self._export = QPushButton("Export as text …", autoDefault=False)
        self._export.clicked.connect(self._choose_file)
        back = QPushButton("Back", autoDefault=False)
        back.clicked.connect(self.back_asked)
        parts = QSplitter(Qt.Orientation.Horizontal)
        parts.addWidget(self._list)
        parts.addWidget(self._text)
        parts.setChildrenCollapsible(False)
        parts.setSizes([240, 420])
        buttons = QHBoxLayout()
        buttons.addWidget(back)
        buttons.addStretch(1)
        buttons.addWidget(self._export)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(12)
        column.addWidget(parts, 1)
        column.addWidget(self._state)
        column.addLayout(buttons)

    def show_folder(self, folder: Path) -> None:
        """Reads and lists the records of a folder; says which files cannot be read."""
        self._records, problems = list_records(folder)
        self._list.clear()
        for _, record in self._records:
            self._list.addItem(
                f"{record.date:%Y-%m-%d %H:%M}   {record.a.label} / {record.b.label}\n{score_text(record)}"
            )
        self._list.setCurrentRow(0 if self._records else -1)
        self._export.setEnabled(bool(self._records))
        self._text.setVisible(bool(self._records))
        self._tell("\n".join(problems) or ("" if self._records else f"No records in {folder} yet."), bool(problems))
        self._list.setFocus()

    def export(self, path: Path) -> None:
        """Writes the chosen record as text."""
        _, record = self._records[self._list.currentRow()]
        try:
            with whole_file(path) as file:
                file.write(as_text(record).encode("utf-8"))
        except WriteError as error:
            self._tell(str(error), failed=True)
        else:
            self._tell(f"Saved {path}.")

    def _choose_file(self) -> None:
        suggestion = self._records[self._list.currentRow()][0].with_suffix(".txt")
        path, _ = QFileDialog.getSaveFileName(self, "Export as text", str(suggestion), "Text (*.txt)")
        if path:
            self.export(Path(path))

    def _show_row(self, row: int) -> None:
        self._text.setPlainText(as_text(self._records[row][1]) if 0 <= row < len(self._records) else "")

    def _tell(self, text: str, failed: bool = False) -> None:
        self._state.setObjectName("warning" if failed else "faint")
        self._state.style().polish(self._state)
        self._state.setText(text)

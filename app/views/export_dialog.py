"""The export dialog: what to save and how; then progress, which can be cancelled, and the result."""

from __future__ import annotations

import threading
from pathlib import Path

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QDialog,
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.export import (
    LONGEST_S,
    SOURCES,
    ExportCancelled,
    ExportError,
    SoundRequest,
    WavReport,
    WavSettings,
    default_file_name,
    export_sound,
)
from app.library import PresetEntry
from app.session import Choices
from app.settings import ExportChoices
from app.views.parts import combo_box, tool_button
from engine.preset import PresetError, load_preset
from engine.sources import Runaway

RATES_HZ = (0, 44_100, 48_000, 96_000)  # 0: the model's own
BITS_NAMES = {"16": "16-bit PCM (dithered)", "24": "24-bit PCM", "32f": "32-bit floating point"}


class _Job(QObject):
    """Runs one export in a thread of its own; its signals arrive in the window's thread."""

    progressed = Signal(float)
    finished = Signal(object)  # WavReport
    failed = Signal(str)
    cancelled = Signal()

    def __init__(self, preset: Path, choices: Choices, export: ExportChoices, path: Path) -> None:
        super().__init__()
        self._arguments = (preset, choices, export, path)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="export")

    def start(self) -> None:
        self._thread.start()

    def cancel(self) -> None:
        self._stop.set()

    def wait(self) -> None:
        self._thread.join()

    def _run(self) -> None:
        preset, choices, export, path = self._arguments
        try:
            request = SoundRequest(load_preset(preset), choices.pluck, choices.listen, export.seconds, export.source)
            report = export_sound(
                request,
                path,
                wav_settings(export),
                progress=self.progressed.emit,
                cancelled=self._stop.is_set,
            )
        except ExportCancelled:
            self.cancelled.emit()
        except (ExportError, PresetError, Runaway, ValueError) as error:
            self.failed.emit(str(error))
        except Exception as error:  # unforeseen, but the dialog must never wait for ever
            self.failed.emit(f"The export failed: {error!r}. Please report this.")
        else:
            self.finished.emit(report)


class ExportDialog(QDialog):
    """Remembers its last state in `export_choices`."""

    def __init__(
        self, preset: PresetEntry, choices: Choices, export: ExportChoices, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Export WAV")
        self.setMinimumWidth(560)
        self._preset, self._choices = preset, choices
        self._job: _Job | None = None
        self._named_by_user = False
        self._build(export)
        self._suggest_name()

    def export_choices(self) -> ExportChoices:
        """The dialog's state."""
        return ExportChoices(
            folder=str(Path(self._path.text()).parent),
            source=self._source.currentData(),
            rate_hz=self._rate.currentData(),
            bits=self._bits.currentData(),
            seconds=self._seconds.value(),
            normalise=self._normalise.isChecked(),
        )

    def _build(self, export: ExportChoices) -> None:
        self._source = combo_box("Source", [(s, s) for s in SOURCES], export.source)
        rates = [(f"{self._preset.info.rate_hz} Hz (the model's own)" if r == 0 else f"{r} Hz", r) for r in RATES_HZ]
        self._rate = combo_box("Sample rate", rates, export.rate_hz)
        self._rate.setToolTip("A rate above the model's own adds no bandwidth")
        self._bits = combo_box("Format", [(name, bits) for bits, name in BITS_NAMES.items()], export.bits)
        self._seconds = QDoubleSpinBox(minimum=0.1, maximum=LONGEST_S, singleStep=0.5, suffix=" s", decimals=1)
        self._seconds.setAccessibleName("Duration")
        self._seconds.setValue(export.seconds)
        self._normalise = QCheckBox("Normalise to −1 dBFS (one gain for model and truth)")
        self._normalise.setChecked(export.normalise)
        self._folder = export.folder or str(Path.home())
        self._path = QLineEdit()
        self._path.setAccessibleName("File")
        self._path.textEdited.connect(lambda: setattr(self, "_named_by_user", True))
        browse = tool_button("Browse …")
        browse.clicked.connect(self._browse)
        for box in (self._source, self._rate):
            box.currentIndexChanged.connect(self._suggest_name)
        place = QHBoxLayout()
        place.addWidget(self._path, 1)
        place.addWidget(browse)
        form = QFormLayout()
        form.setLabelAlignment(Qt.AlignmentFlag.AlignRight)
        for name, field in (
            ("Source", self._source),
            ("Duration", self._seconds),
            ("Sample rate", self._rate),
            ("Format", self._bits),
            ("", self._normalise),
            ("File", place),
        ):
            form.addRow(name, field)
        self._state = QLabel("The file carries its recipe: preset, pluck, listening point.")
        self._state.setObjectName("faint")
        self._state.setWordWrap(True)
        self._state.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._bar = QProgressBar(maximum=1000)
        self._bar.hide()
        self._save = QPushButton("Export", default=True)
        self._save.clicked.connect(self._start)
        self._close = QPushButton("Close")
        self._close.clicked.connect(self._cancel_or_close)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(self._close)
        buttons.addWidget(self._save)
        column = QVBoxLayout(self)
        column.setSpacing(12)
        column.addLayout(form)
        column.addWidget(self._bar)
        column.addWidget(self._state)
        column.addLayout(buttons)

    def _suggest_name(self) -> None:
        if not self._named_by_user:
            export = ExportChoices(source=self._source.currentData(), rate_hz=self._rate.currentData())
            rate_hz = export.rate_hz or self._preset.info.rate_hz
            name = default_file_name(self._preset.name, self._choices.pluck, rate_hz, export.source)
            self._path.setText(str(Path(self._folder) / name))

    def _browse(self) -> None:
        path, _ = QFileDialog.getSaveFileName(self, "Export WAV", self._path.text(), "WAV (*.wav)")
        if path:
            self._path.setText(path if path.lower().endswith(".wav") else f"{path}.wav")
            self._named_by_user = True

    def _start(self) -> None:
        self._job = _Job(self._preset.path, self._choices, self.export_choices(), Path(self._path.text()))
        self._job.progressed.connect(lambda share: self._bar.setValue(round(1000 * share)))
        self._job.finished.connect(self._tell_result)
        self._job.failed.connect(lambda message: self._end(message, failed=True))
        self._job.cancelled.connect(lambda: self._end("Cancelled; no file was left."))
        self._save.setEnabled(False)
        self._close.setText("Cancel")
        self._bar.setValue(0)
        self._bar.show()
        self._state.setText("Rendering …")
        self._job.start()

    def _tell_result(self, report: WavReport) -> None:
        seconds = report.frames / report.rate_hz
        clipped = f", {report.clipped} samples clipped" if report.clipped else ""
        past = max(0.0, seconds - self._preset.info.horizon_s) if self._source.currentData() != "truth" else 0.0
        note = f" The last {past:.2f} s lie past the model's training." if past else ""
        self._end(f"Saved {report.path} ({seconds:.2f} s, peak {report.peak_db:.1f} dBFS{clipped}).{note}")

    def _end(self, text: str, failed: bool = False) -> None:
        if self._job is not None:
            self._job.wait()
            self._job = None
        self._bar.hide()
        self._save.setEnabled(True)
        self._close.setText("Close")
        self._state.setObjectName("warning" if failed else "faint")
        self._state.style().polish(self._state)
        self._state.setText(text)

    def _cancel_or_close(self) -> None:
        if self._job is not None:
            self._job.cancel()
        else:
            self.accept()

    def reject(self) -> None:
        self._cancel_or_close()

    def closeEvent(self, event: QCloseEvent) -> None:
        if self._job is not None:
            self._job.cancel()
            self._job.wait()
        super().closeEvent(event)


def wav_settings(export: ExportChoices) -> WavSettings:
    """The writer's settings of the dialog's choices."""
    return WavSettings(bits=export.bits, rate_hz=export.rate_hz or None, normalise=export.normalise)

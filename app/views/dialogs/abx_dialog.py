"""The listening test in a dialog: set up, trial by trial, the result.

While it is open nothing else plays, and the window must not show what it plays: level, limiter and source would
give X away.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QMargins, QTimer
from PySide6.QtWidgets import QDialog, QStackedWidget, QVBoxLayout, QWidget

from app.analysis.abx.record import AbxRecord, default_folder, save_record
from app.analysis.abx.sound import Stimuli, make_stimuli
from app.analysis.abx.trials import AbxChoices, Identity, ListeningTest, Sound
from app.audio.sound import Sound as SoundOutput
from app.audio.sound import SoundStatus
from app.playing.pair import Pair
from app.views import theme
from app.views.controls.parts import filled
from app.views.dialogs.abx_pages import ResultPage, SetupPage, TrialPage
from app.views.dialogs.question import ask
from app.views.file_places import FilePlaces
from engine.whole_file import WriteError

Render = Callable[[int], "Future[Mapping[str, NDArray[np.float32]]]"]

WATCH_MS = 200
RENDERING = "The sound is still being rendered."
NO_DEVICE = "No audio output: connect one, or choose another in the audio settings."
SAME = "A and B are identical, sample by sample: there is nothing to compare."
TRIVIAL = (
    "A and B differ so much here that anyone hears it at once: the test would say little. "
    "Choose a pluck within the model's training, or a better preset."
)
DEVICE_CHANGED = "The sound device changed during the test."
CONTINUE, STOP = "Continue", "Stop the test"
CLOSED = "The window was closed during the test."
LARGEST_SEED = 2**32


class AbxDialog(QDialog):
    """The pages, the sound and the result of the test.

    A and B are two sounds of one pluck, model and truth; in each trial X is one of them, drawn from a seed. A run is
    a test under way. Stimuli are A and B as they are played.

    Args:
        material: what is compared: a result without trials.
        render: starts to render model and truth of the pluck at a rate in Hz; gives the future of their samples,
            (frames, channels), by source.
        seed: draws a seed for each test.
    """

    def __init__(
        self,
        output: SoundOutput,
        material: AbxRecord,
        choices: AbxChoices,
        render: Render,
        places: FilePlaces,
        parent: QWidget | None = None,
        seed: Callable[[], int] = lambda: secrets.randbelow(LARGEST_SEED),
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Listening test (ABX)")
        self.resize(theme.px(680), theme.px(470))  # or the rows of the first page are squashed
        self._output = output
        self._material = material
        self._seed = seed
        self._render = render
        self._rendering: Future[Mapping[str, NDArray[np.float32]]] | None = None
        self._rate_hz = 0  # at which it is, or was, rendered
        self._pair: Pair | None = None  # plays the stimuli; None: there are none
        self._stimuli: Stimuli | None = None
        self._silence = RENDERING  # why there are no stimuli; "": there are
        self._run: ListeningTest | None = None  # None: no test is under way
        self._sounding: Sound | None = None  # "A", "B" or "X", as chosen last; None: none since the sound was stopped
        self._through: dict[str, object] | None = None  # the device, and how it is played, during the test
        self._record: AbxRecord | None = None  # the result that is shown; None: none is
        self._places = places
        self._volume_db = float(str(material.through["volume_db"]))
        labels = material.a.label, material.b.label
        self._setup, self._trial = SetupPage(material.words, labels, choices), TrialPage(labels)
        self._result = ResultPage()
        self._pages = QStackedWidget()
        for page in (self._setup, self._trial, self._result):
            self._pages.addWidget(page)
        filled(QVBoxLayout(self), self._pages, margins=QMargins(22, 20, 22, 18))
        self._connect()
        self._watch = QTimer(self, interval=WATCH_MS)
        self._watch.timeout.connect(self._look_at_device)
        self._watch.start()
        self._ask_for_sound()
        self._prepare()
        self._setup.start.setFocus()

    @property
    def testing(self) -> bool:
        return self._run is not None

    def choices(self) -> AbxChoices:
        setup = self._setup
        return AbxChoices(trials=setup.trials.value(), restart=setup.restart.isChecked())

    def abandon(self) -> None:
        """Close without a question; a test under way is recorded as incomplete."""
        if self.testing:
            self._end(CLOSED)
        self._leave()

    def _connect(self) -> None:
        setup = self._setup
        trial = self._trial
        result = self._result
        setup.start.clicked.connect(self._start)
        setup.audition_asked.connect(self._audition)
        trial.audition_asked.connect(self._audition)
        trial.replay_asked.connect(lambda: self._audition(self._sounding or "X", again=True))
        trial.answered.connect(self._answer)
        result.again.clicked.connect(self._show_setup)
        result.save.clicked.connect(self._save_elsewhere)
        for button in (setup.close_button, trial.stop, result.close_button):
            button.clicked.connect(self.reject)

    # Sound

    def _ask_for_sound(self) -> None:
        """Start to render model and truth at the present rate of the output."""
        self._rate_hz = self._output.rate_hz
        self._rendering = self._render(self._rate_hz)

    def _prepare(self) -> None:
        """Make A and B, if the pluck has been rendered."""
        self._hush()
        self._stimuli = self._pair = None
        self._silence = RENDERING
        rendering = self._rendering
        if rendering is not None and rendering.done() and self._rate_hz == self._output.rate_hz:
            try:
                stimuli = make_stimuli(rendering.result(), self._rate_hz, self._volume_db)
            except Exception as error:  # a model that ran away, or silence
                self._silence = str(error)
            else:
                self._stimuli, self._silence = stimuli, ""
                self._pair = Pair(self._output.mixer, {str(name): sound for name, sound in stimuli.samples.items()})
        self._show_state()

    def _audition(self, sound: Sound, again: bool = False) -> None:
        """Play A, B or X, from the start or at the playhead; `again`: from the start. Nothing without stimuli."""
        if self._pair is None:
            return
        identity: Identity = "A" if sound == "A" else "B"
        if self._run is not None:
            identity = self._run.heard_as(sound)
            self._run = self._run.auditioned(sound)
        self._pair.select(identity)
        self._pair.play(restart=again or self._setup.restart.isChecked() or self._sounding is None)
        self._sounding = sound
        if self._run is not None:
            self._trial.show_sounding(sound, self._run.x_heard)

    def _hush(self) -> None:
        if self._pair is not None:
            self._pair.stop()
        self._sounding = None

    # The test

    def _start(self) -> None:
        """Begin a test, if nothing is in its way, and note device, volume and way of switching."""
        status = self._output.status()
        if self._obstacle(status) or status.device is None:
            return
        restarts = self._setup.restart.isChecked()
        self._through = {**_device_of(status), "volume_db": self._volume_db, "restart_at_switch": restarts}
        self._run = ListeningTest(self._seed(), self._setup.trials.value())
        self._pages.setCurrentWidget(self._trial)
        self._trial.setFocus()
        self._begin_trial()

    def _begin_trial(self) -> None:
        assert self._run is not None
        self._hush()
        self._trial.show_trial(len(self._run.trials) + 1, self._run.planned)

    def _answer(self, answer: Identity) -> None:
        """Take the answer, "A" or "B", if X was heard; then begin the next trial, or end the test."""
        if self._run is None or not self._run.x_heard:
            return
        self._run = self._run.answered(answer)
        if self._run.complete:
            self._end()
        else:
            self._begin_trial()

    def _end(self, remark: str = "") -> None:
        """Save the result of the run, complete or not; of one without an answer there is none."""
        run, self._run = self._run, None
        self._hush()
        assert run is not None
        assert self._through is not None
        assert self._stimuli is not None
        if not run.trials:
            self._show_setup()
            return
        gains_db = (round(gain_db, 3) for gain_db in self._stimuli.gains_db)
        a, b = (
            candidate.model_copy(update={"gain_db": gain_db})
            for candidate, gain_db in zip((self._material.a, self._material.b), gains_db, strict=True)
        )
        self._record = AbxRecord(
            a=a,
            b=b,
            pluck=self._material.pluck,
            through=self._through,
            planned_trials=run.planned,
            seed=run.seed,
            trials=run.trials,
            remark=remark,
        )
        self._pages.setCurrentWidget(self._result)
        self._result.show_record(self._record)
        self._save(self._places.folder("test", default_folder()))

    def _save(self, folder: Path) -> None:
        """Save the result in a folder, and show where; or why not, so that another folder can be chosen."""
        assert self._record is not None
        try:
            path = save_record(folder, self._record)
        except WriteError as error:
            self._result.show_saved(str(error), failed=True)
        else:
            self._result.show_saved(f"Saved {path}", failed=False)

    def _save_elsewhere(self) -> None:
        folder = self._places.ask_folder(self, "test", "Folder of the result")
        if folder is not None:
            self._save(folder)

    # What is shown, and leaving

    def _show_setup(self) -> None:
        self._record = None
        self._pages.setCurrentWidget(self._setup)
        self._prepare()

    def _obstacle(self, status: SoundStatus) -> str:
        """The reason why the test cannot start now, or nothing."""
        if status.device is None:
            return NO_DEVICE
        if self._stimuli is None:
            return self._silence
        return SAME if self._stimuli.same else ""

    def _show_state(self) -> None:
        advice = TRIVIAL if self._stimuli is not None and self._stimuli.trivial else ""
        self._setup.show_state(self._obstacle(self._output.status()), advice)

    def _look_at_device(self) -> None:
        """End a test whose device has changed; without a test, render or prepare the sound again where it must be."""
        status = self._output.status()
        if self._run is None or self._through is None:
            if self._rate_hz != self._output.rate_hz:
                self._ask_for_sound()
                self._prepare()
            elif self._silence == RENDERING or (self._pair and self._pair.mixer is not self._output.mixer):
                self._prepare()
            else:
                self._show_state()
            return
        if not _device_of(status).items() <= self._through.items():
            self._end(DEVICE_CHANGED)

    def reject(self) -> None:
        """Escape, the window's cross, "Stop" and "Close": a test under way is ended, the dialog otherwise closed."""
        if self._run is None:
            self._leave()
            return
        answered, planned = len(self._run.trials), self._run.planned
        consequence = "The test would be recorded as incomplete." if answered else "Nothing would be recorded."
        question = f"{answered} of {planned} trials are answered. {consequence}"
        if ask(self, "Stop the test?", question, CONTINUE, STOP) == STOP and self.testing:
            self._end()

    def _leave(self) -> None:
        self._hush()
        self._watch.stop()
        super().reject()


def _device_of(status: SoundStatus) -> dict[str, object]:
    name, host_api = (status.device.name, status.device.host_api) if status.device else ("", "")
    return {"device": name, "host_api": host_api, "rate_hz": status.rate_hz}

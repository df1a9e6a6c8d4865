"""The error map: the error of the chosen preset over position and amplitude, for plucks of the chosen shape."""

from __future__ import annotations

from app.analysis.error_plane import ErrorPlane, PlanePicture
from app.analysis.job import Job
from app.playing.chosen import subject_of
from app.presets.library import Library
from app.rendering import Take
from app.rendering.subject import Subject, load_subject, string_of
from app.session.choices import Session
from app.session.slots import info_of
from app.views.plots.error_plane_view import ErrorPlaneView
from app.window.panels._background import Background
from app.window.panels.base import Moment, Panel
from engine.pluck import Pluck
from engine.presets import preset_digest

FORM_FIELDS = frozenset({"preset", "string", "shape", "width"})  # other ones are another map
SETTLED_S = 0.3  # a width that is still being turned is not computed
MOST_KEPT = 64  # planes of some 13 KB


class ErrorPlanePanel(Panel):
    key = "error_plane"
    title = "Error map"
    help = (
        "The model's error as trained, the first figure in the header, over pluck position and amplitude, computed "
        "in the background. A click plucks there."
    )
    view: ErrorPlaneView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = ErrorPlaneView()
        self.view.pluck_chosen.connect(self._audition)
        self._asked: tuple[object, ...] = ()
        self._unchanged_s = 0.0
        self._moved = False  # the pluck's mark is of choices that have changed since
        self._planes = _Planes()
        self._background = Background("error-map", self)
        self._background.progressed.connect(self._progressed)
        self._background.finished.connect(self._finished)
        self._background.failed.connect(self._failed)

    def choices_changed(self, names: frozenset[str]) -> None:
        entry = self.library.find(self.session.choices.preset)
        self._moved |= bool(names & {"position", "amplitude_mm"})
        if names & FORM_FIELDS and entry is not None:
            info, pluck = info_of(self.session.choices, entry), self.session.choices.pluck
            self.view.set_trained(
                info.trained_range.position, lambda place: info.trained_amplitudes_mm(pluck.moved(position=place))
            )
        if names & FORM_FIELDS and self._wanted() != self._asked:
            self._background.cancel()
            self._asked = ()
            self._unchanged_s = 0.0 if "preset" not in names else SETTLED_S
            self.view.show_picture(None)
            self.view.progress.show_share(None)
            self.view.set_words("")

    def take_started(self, take: Take) -> None:
        self._background.give_way_to(take)

    def show_moment(self, moment: Moment) -> None:
        self._background.look()
        self._unchanged_s += moment.elapsed_s
        if self._moved:
            self.view.set_pluck(self.session.choices.position, self.session.choices.amplitude_mm)
            self._moved = False
        entry = self.library.find(self.session.choices.preset)
        if entry is None or self._asked == self._wanted() or self._unchanged_s < SETTLED_S:
            return
        self._asked = self._wanted()
        subject, pluck = subject_of(self.session.choices, entry.path), self.session.choices.pluck
        self.view.progress.show_share(0.0)
        self.view.set_words("Computing the model's error for plucks of this shape …")
        self._background.start(lambda job: self._planes.compute(subject, pluck, job))

    def close(self) -> None:
        self._background.close()

    def _wanted(self) -> tuple[object, ...]:
        return (self.session.choices.preset, self.session.choices.string, *_form(self.session.choices.pluck))

    def _progressed(self, share: float, picture: PlanePicture | None) -> None:
        self.view.progress.show_share(share)
        if picture is not None:
            self.view.show_picture(picture)

    def _finished(self, picture: PlanePicture) -> None:
        self.view.progress.show_share(None)
        self.view.show_picture(picture)
        self.view.set_words("Error as trained, for plucks of this shape; a click plucks there")

    def _failed(self, message: str, details: str) -> None:
        self.view.progress.show_share(None)
        self.view.set_words("The error map of this preset could not be computed")
        self.told.emit(message, details)

    def _audition(self, position: float, amplitude_mm: float) -> None:
        self.session.move_pluck(round(position, 3), round(amplitude_mm, 2))
        self.pluck_asked.emit()


class _Planes:
    """The planes so far, by the preset's content, the string and the form of the pluck. Used by one thread."""

    def __init__(self) -> None:
        self._known: dict[tuple[object, ...], ErrorPlane] = {}

    def compute(self, subject: Subject, pluck: Pluck, job: Job) -> PlanePicture:
        preset = load_subject(subject)
        key = (preset_digest(preset.path), string_of(subject), *_form(pluck))
        plane = self._known.pop(key, None) or ErrorPlane()
        self._known[key] = plane  # the latest last
        for oldest in list(self._known)[:-MOST_KEPT]:
            del self._known[oldest]
        return plane.compute(preset, pluck, job)


def _form(pluck: Pluck) -> tuple[object, ...]:
    """What a plane belongs to beside its preset: shape and width, where there is one."""
    return (pluck.shape, None if pluck.shape == "triangular" else pluck.width)

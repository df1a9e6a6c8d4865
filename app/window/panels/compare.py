"""Several presets on the present pluck, computed one after the other while the table is visible.

The chosen preset comes first, then those in the slots, then the others.
"""

from __future__ import annotations

from app.analysis.comparison import ComparedRow, Trial, compare, same_string
from app.presets.library import Library, PresetEntry
from app.rendering import Take
from app.session.choices import Session
from app.session.slots import other_preset
from app.views.plots.compare_view import CompareView
from app.window.panels._background import Background
from app.window.panels.base import Moment, Panel

SETTLED_S = 0.5  # a pluck that is still being moved is not computed


class ComparePanel(Panel):
    key = "compare"
    title = "Compare"
    help = (
        "Several presets on the present pluck: errors, null depth and speed. Enter or a double-click loads the "
        "preset of a row."
    )
    view: CompareView

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self.view = view = CompareView()
        self._names: list[str] | None = None  # chosen by the user; None: those of the present string
        self._rows: dict[str, tuple[Trial | None, ComparedRow]] = {}  # None: of an earlier pluck
        self._tried: tuple[object, ...] = ()  # what the latest job was started for
        self._unchanged_s = 0.0
        self._stopped = False
        self._stale = False  # the table is of choices that have changed since
        view.set_presets(library.entries)
        library.changed.connect(self._library_changed)
        view.set_computing(None)
        view.preset_toggled.connect(self._toggle)
        view.same_string_asked.connect(lambda: self._choose(None))
        view.all_asked.connect(lambda: self._choose(library.names))
        view.stop_asked.connect(self._stop_or_go_on)
        view.preset_opened.connect(lambda name: session.update(preset=name))
        self._background = Background("compare", self)
        self._background.progressed.connect(self._progressed)
        self._background.finished.connect(lambda _: self._ended())
        self._background.failed.connect(self._failed)

    def choices_changed(self, names: frozenset[str]) -> None:
        if names & {"position", "amplitude_mm", "shape", "width", "seconds", "listen", "preset", "string"}:
            self._unchanged_s = 0.0
            if self._tried != self._wanted():
                self._abandon()
            self._stale = True  # shown by `show_moment`: a pluck may be waiting for this call

    def _library_changed(self) -> None:
        self.view.set_presets(self.library.entries)
        self._show()

    def take_started(self, take: Take) -> None:
        self._background.give_way_to(take)

    def show_moment(self, moment: Moment) -> None:
        self._background.look()
        self._unchanged_s += moment.elapsed_s
        if self._stale:
            self._show()
        if self._unchanged_s < SETTLED_S or self._stopped or self._tried == self._wanted():
            return
        self._compute()

    def close(self) -> None:
        self._background.close()

    @property
    def _trial(self) -> Trial:
        choices = self.session.choices
        string = None if choices.string is None else choices.string.parameters
        return Trial(choices.pluck, choices.seconds, choices.listen, string)

    @property
    def _entries(self) -> list[PresetEntry]:
        """Those in the table."""
        if self._names is not None:
            return [entry for entry in self.library.entries if entry.name in self._names]
        present = self.library.find(self.session.choices.preset)
        if self.session.choices.string is not None:  # which no other preset has learned
            return [present] if present is not None else []
        return [e for e in self.library.entries if present is not None and same_string(e.info, present.info)]

    def _wanted(self) -> tuple[object, ...]:
        return (self._trial, *(entry.name for entry in self._entries))

    def _compute(self) -> None:
        self._tried, trial = self._wanted(), self._trial
        missing = [entry for entry in self._entries if self._rows.get(entry.name, (None, None))[0] != trial]
        missing.sort(key=lambda entry: self._urgency(entry.name))
        if missing:
            self.view.set_computing(0.0)
            self._background.start(lambda job: compare(missing, trial, job))
        self._show()

    def _urgency(self, name: str) -> int:
        choices = self.session.choices
        heard = [choices.preset, other_preset(choices.a), other_preset(choices.b)]
        return heard.index(name) if name in heard else len(heard)

    def _progressed(self, share: float, row: ComparedRow | None) -> None:
        self.view.set_computing(share)
        if row is not None:
            self._rows[row.name] = (self._trial, row)
            self._show()

    def _ended(self) -> None:
        self.view.set_computing(None)

    def _failed(self, message: str, details: str) -> None:
        self._ended()
        self.told.emit(message, details)

    def _stop_or_go_on(self) -> None:
        self._stopped = self._background.busy
        if self._stopped:
            self._background.cancel()
            self._ended()
        else:
            done = {name for name, (trial, row) in self._rows.items() if trial == self._trial and row.mae is not None}
            if all(entry.name in done for entry in self._entries):
                done = set()
            self._rows = {n: (trial if n in done else None, row) for n, (trial, row) in self._rows.items()}
            self._compute()

    def _toggle(self, name: str, on: bool) -> None:
        names = [entry.name for entry in self._entries if entry.name != name]
        self._choose([*names, name] if on else names)

    def _choose(self, names: list[str] | None) -> None:
        self._names = names
        if self._tried != self._wanted():
            self._abandon()
        self._show()

    def _abandon(self) -> None:
        """Ends what is computed for other choices than the present ones; where they come back, it is begun anew."""
        self._background.cancel()
        self._tried, self._stopped = (), False
        self._ended()

    def _show(self) -> None:
        self._stale = False
        entries, trial = self._entries, self._trial
        self.view.set_chosen([entry.name for entry in entries])
        shown = []
        for entry in entries:
            computed, row = self._rows.get(entry.name, (None, ComparedRow.of(entry)))
            shown.append((row, computed == trial))
        self.view.show_rows(shown, self.session.choices.preset)
        count, fresh = len(entries), sum(of_this for _, of_this in shown)
        done = f"{fresh} of {count}" if fresh < count else f"{count}"
        former = any(row.mae is not None and not of_this for row, of_this in shown)
        self.view.set_words(
            f"{done} preset{'s' if count != 1 else ''} on this pluck, {trial.seconds:g} s"
            + ("; grey: an earlier pluck" if former else "")
        )

"""A pluck that the worker renders: the motions and signals of its sources, block by block."""

from __future__ import annotations

from app.rendering.line import BLOCK_FRAMES, SourceLine
from app.rendering.rendering import Rendering, RenderRequest
from app.rendering.strobe import Strobe
from app.rendering.take import SOURCES, Listened, Take
from app.shared.vocabulary import OTHER
from engine.presets import PresetError
from engine.values.ear import Ear

FIRST_FRAMES = 256  # samples: small, so that a pluck is seen at once


class PluckJob(Rendering[RenderRequest, Take]):
    """The rendering of a pluck; requests for one motion differ in listening points, slow motion or other presets."""

    _strobe: Strobe | None = None

    def _satisfied(self, take: Take) -> bool:
        return (
            super()._satisfied(take)
            and self._strobe == self._wanted_strobe(take)
            and all(name in self._lines and self._lines[name].complete for name in self._source_names())
        )

    def _continue(self, take: Take) -> None:
        self._find_others(take)
        self._show(take)
        self._listen(take)
        self._advance_lines(take)
        take.measure()

    def _begin(self) -> Take:
        request, loaded = self.request, self._load(self.request.preset)
        info, stride = loaded.preset.info, loaded.stride
        take = Take(loaded.preset.name, info, request.pluck, request.seconds, request.ear, stride, model=loaded.model)
        self._lines = {name: SourceLine(take, name, loaded) for name in SOURCES}
        take.motions.update({name: line.motion for name, line in self._lines.items()})
        take.listened = self._listened(request.ear)
        return take

    def _find_others(self, take: Take) -> None:
        """Begin the models of other presets that are newly requested."""
        for path in self.request.others:
            name = OTHER + path.stem
            if name in self._lines:
                continue
            try:
                line = SourceLine(take, name, self._load(path))
            except (PresetError, ValueError) as error:
                self._listener.other_failed(path.stem, str(error))
                line = SourceLine(take, name, None)
            self._lines[name] = line
            if self._strobe is not None:
                line.show(self._strobe)
            listened = self._coming or take.listened
            listened.signals[name] = line.listen(listened.ear)
            take.motions[name] = line.motion

    def _show(self, take: Take) -> None:
        """Begin new flashes where the slow motion has changed; flashes that are under way are finished first."""
        behind = any(self._lines[name].behind for name in self._source_names() if name in self._lines)
        if self._strobe != (strobe := self._wanted_strobe(take)) and not behind:
            self._strobe = strobe
            for line in self._lines.values():
                line.show(strobe)

    def _listen(self, take: Take) -> None:
        """Begin new signals where the listening points have changed.

        Complete signals stay until the new ones are complete, so that plots follow a point that is dragged as often
        as it can be rendered.
        """
        ear = self.request.ear
        if self._coming is not None and self._is_whole(self._coming):
            take.listened, self._coming = self._coming, None
        if self._coming is None and take.listened.ear != ear:
            if self._is_whole(take.listened):
                self._coming = self._listened(ear)
            elif not take.complete:
                take.listened = self._listened(ear)

    def _listened(self, ear: Ear) -> Listened:
        return Listened(ear, {name: line.listen(ear) for name, line in self._lines.items()})

    def _is_whole(self, listened: Listened) -> bool:
        return all(listened.signals[name].complete for name in self._source_names() if name in listened.signals)

    def _wanted_strobe(self, take: Take) -> Strobe:
        return Strobe(self.request.speed, take.fundamental_hz, take.seconds)

    def _advance_lines(self, take: Take) -> None:
        """Render a block of the model here, of the truth in the helper, and there others up to its end."""
        model, truth = (self._lines[name] for name in SOURCES)
        first = truth.done
        most = BLOCK_FRAMES * truth.stride
        frames = min(min(2 * first, most) if first else 1 + FIRST_FRAMES, truth.frames - first)
        end_s = (first + frames) / truth.rate_hz if first + frames < truth.frames else take.seconds + 1.0
        others = [self._lines[name] for name in self._source_names()[len(SOURCES) :]]
        behind = {line: min(BLOCK_FRAMES * line.stride, line.until(end_s)) for line in others}
        pending = [self._helper.submit(line.advance, count) for line, count in ({truth: frames} | behind).items()]
        model.advance(frames)
        for call in pending:
            call.result()
        take.model_ends_s = model.ends_s

    def _source_names(self) -> list[str]:
        return [*SOURCES, *(OTHER + path.stem for path in self.request.others)]

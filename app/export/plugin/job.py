"""The export of a plug-in as the window runs it."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from app.export.plugin.formats import check_compiler, install_folder, this_target
from app.export.plugin.identity import holding, identifier, lost_with
from app.instruments.instrument import Instrument
from app.shared.worker import Progress


@dataclass(frozen=True)
class PluginExport:
    """A plug-in of one instrument.

    Attributes:
        preset: the file of the preset that plays it.
        path: with the ending of the format.
    """

    instrument: Instrument
    preset: Path
    form: str
    target: str
    path: Path
    cancelled = "nothing was written."

    @property
    def file(self) -> Path:
        return self.path

    def replaces(self) -> str:
        """The plug-in that would be replaced, in words; "": nothing. Raises PluginError: it must not be."""
        if not self.path.exists():
            return ""
        lost = lost_with(self.path, {identifier(self.instrument.name)})
        return f"The plug-in that is there {holding(lost)}: replaced." if lost else "Replaces the one before."

    def run(self, progress: Progress) -> str:
        """Build the plug-in; see `ExportJob`."""
        check_compiler()
        from app.export.plugin.build import build_plugin  # brings LLVM
        from app.export.plugin.image import image_of
        from engine.kernels import cache
        from engine.presets import load_preset

        progress(0.0, "Reading the instrument")
        image = image_of(self.instrument, load_preset(self.preset))

        def advanced(step: str, share: float) -> None:
            progress(share, step.capitalize())

        cache_folder = cache.folder() or Path(tempfile.gettempdir())
        path = build_plugin([image], self.form, self.target, self.path, cache_folder, advanced, replace=True)
        if self.target != this_target():
            return f"Built {path}. Copy it to the other computer."
        if path.parent == install_folder(self.form, self.target):
            return f"Built {path}. Hosts find it at their next scan."
        return f"Built {path}. Hosts look in {install_folder(self.form, self.target)}."

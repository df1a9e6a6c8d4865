"""What is put to the test is what is chosen."""

from __future__ import annotations

from pathlib import Path

from app.analysis.abx.subject import subject_of
from app.patches.patch import PhysicalString
from app.presets.library import list_presets
from app.session.choices import Choices
from engine.resonators.string import StringParameters


def test_the_chosen_string_is_the_subjects(preset_folder: Path) -> None:
    entry = list_presets(preset_folder)[0][0]
    own = StringParameters()
    string = PhysicalString(**{name: getattr(own, name) for name in PhysicalString.model_fields})
    for chosen in (None, string):
        choices = Choices(preset=entry.name, position=0.3, string=chosen)
        assert subject_of(entry, choices).pluck.string == chosen

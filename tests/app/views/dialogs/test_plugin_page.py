"""The export of an instrument as a plug-in: what the dialog suggests, builds and shows."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.export.plugin.formats import FORMATS, install_folder, this_target
from app.export.plugin.identity import identifier
from app.export.sampled.choices import SampledChoices
from app.instruments.library import find_instrument
from app.presets.library import list_presets
from app.views.dialogs.export_dialog import ExportDialog
from app.views.dialogs.export_pages import PLUGIN_NAMES, PLUGIN_NOTE, SYSTEM_NAMES, HeardInstrument
from app.views.file_places import FilePlaces


@pytest.fixture
def gate() -> threading.Event:
    """What building waits for."""
    made = threading.Event()
    made.set()
    return made


@pytest.fixture
def dialog(
    qtbot: QtBot, preset_folder: Path, monkeypatch: pytest.MonkeyPatch, gate: threading.Event, tmp_path: Path
) -> Iterator[ExportDialog]:
    def build(
        images: list[str],
        form: str,
        target: str,
        path: Path,
        cache: Path,
        advanced: Callable[[str, float], None],
        *,
        replace: bool,
    ) -> Path:
        assert replace
        while not gate.wait(0.01):
            advanced("compiling the kernels", 0.4)
        advanced("linking", 0.97)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{images} {form} {target} {identifier(images[0])}\0", encoding="utf-8")
        return path

    monkeypatch.setattr("app.export.plugin.formats.find_spec", lambda name: name)
    monkeypatch.setattr("app.export.plugin.build.build_plugin", build)
    monkeypatch.setattr("app.export.plugin.image.image_of", lambda instrument, preset: instrument.name)
    monkeypatch.setattr("app.export.plugin.formats.Path.home", lambda: tmp_path)
    made = ExportDialog((ExportChoices(), SampledChoices()), FilePlaces())
    qtbot.addWidget(made)
    preset = list_presets(preset_folder)[0][0]
    made.show_subjects({"plugin": HeardInstrument(find_instrument("Classical guitar").instrument, preset)})
    made.open_at("plugin")
    yield made
    gate.set()
    made.accept()


def choose(dialog: ExportDialog, form: str, system: str) -> None:
    page = dialog.plugin
    page["form"].setCurrentIndex(page["form"].findData(form))
    page["system"].setCurrentIndex(page["system"].findData(system))


def test_it_suggests_the_place_where_hosts_look(qtbot: QtBot, dialog: ExportDialog, tmp_path: Path) -> None:
    assert set(PLUGIN_NAMES) == set(FORMATS)
    for form in FORMATS:
        choose(dialog, form, this_target())
        assert dialog.plugin.file.path == install_folder(form, this_target()) / f"Classical guitar.{form}"
    choose(dialog, "vst3", next(each for each in SYSTEM_NAMES if each != this_target()))
    assert dialog.plugin.file.path == tmp_path / "Classical guitar.vst3"
    assert dialog.state.text() == PLUGIN_NOTE


def test_it_builds_and_shows_where_it_was_put(qtbot: QtBot, dialog: ExportDialog) -> None:
    choose(dialog, "clap", this_target())
    dialog.save.click()
    qtbot.waitUntil(lambda: "Built" in dialog.state.text())
    path = install_folder("clap", this_target()) / "Classical guitar.clap"
    assert f"Built {path}" in dialog.state.text()
    assert "next scan" in dialog.state.text()
    assert path.read_text(encoding="utf-8").startswith(f"['Classical guitar'] clap {this_target()}")
    assert dialog.save.text() == "Replace"


def test_what_would_be_lost_is_said_and_what_is_no_plug_in_is_kept(qtbot: QtBot, dialog: ExportDialog) -> None:
    page = dialog.plugin
    choose(dialog, "clap", this_target())
    path = page.file.path
    path.parent.mkdir(parents=True)
    for names, said in (
        (["Classical guitar"], "Replaces the one before."),
        (["Classical guitar", "Concert harp"], "The plug-in that is there holds another instrument, concert-harp"),
        (["Concert harp", "Electric bass"], "The plug-in that is there holds 2 other instruments, as concert-harp"),
    ):
        path.write_text("".join(f"{identifier(name)}\0" for name in names), encoding="utf-8")
        button, words = page.offer()
        assert button == "Replace" and words.startswith(said)
    path.write_text("of somebody", encoding="utf-8")
    page.changed.emit()
    qtbot.waitUntil(lambda: "is no plug-in of this program" in dialog.state.text())
    assert not dialog.save.isEnabled()


def test_it_can_be_cancelled_while_it_compiles(qtbot: QtBot, dialog: ExportDialog, gate: threading.Event) -> None:
    gate.clear()
    dialog.save.click()
    qtbot.waitUntil(lambda: "Compiling the kernels" in dialog.state.text())
    dialog.close_button.click()
    qtbot.waitUntil(lambda: "Cancelled; nothing was written." in dialog.state.text())
    assert not dialog.plugin.file.path.exists()

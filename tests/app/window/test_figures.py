"""What is shown becomes files and the clipboard's: pictures that look like it, and its numbers."""

from __future__ import annotations

import csv
from io import StringIO
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PySide6.QtCore import QByteArray, QPoint, QSize, Qt
from PySide6.QtGui import QColor, QContextMenuEvent, QGuiApplication, QImage, QPainter
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QAbstractScrollArea, QApplication, QFileDialog, QMenu, QWidget

from app.export import columns as columns_module
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.views import theme
from tests.app.gestures import drag
from tests.app.places import choose_files
from tests.app.window.conftest import Open
from tests.app.window.driver import KEY, SHIFT, Window

RIGHT = Qt.MouseButton.RightButton
CURVES = ("string", "spectrum", "waveform", "error_time", "eigenvalues")  # the others may hold images
Table = dict[str, NDArray[np.float64]]


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """The names that file dialogs propose; each is chosen, without its ending, in an own folder."""
    proposed: list[str] = []

    def choose(parent: QWidget, title: str, place: str, filters: str) -> tuple[str, str]:
        proposed.append(place)
        return str(tmp_path / Path(place).stem), filters

    monkeypatch.setattr(QFileDialog, "getSaveFileName", choose)
    return proposed


def by_menu_key(w: Window, figure: QWidget) -> None:
    w.key(KEY.Key_Menu, on=figure)


def by_shift_f10(w: Window, figure: QWidget) -> None:
    w.key(KEY.Key_F10, SHIFT, on=figure)


def by_click(w: Window, figure: QWidget) -> None:
    place = figure.viewport() if isinstance(figure, QAbstractScrollArea) else figure
    w.qtbot.mouseClick(place, RIGHT, pos=place.rect().center())


def take_action(words: str) -> None:
    """Choose in the menu that has popped up."""
    menu = QApplication.activePopupWidget()
    assert isinstance(menu, QMenu), "no menu has opened"
    action = next(each for each in menu.actions() if each.text().startswith(words))
    menu.close()
    action.trigger()


def pixels(image: QImage) -> NDArray[np.float64]:
    image = image.convertToFormat(QImage.Format.Format_RGB32)
    values = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine() // 4, 4)
    return values[:, : image.width(), :3].astype(np.float64)


def rendered(data: bytes, like: QImage) -> QImage:
    """An SVG as Qt draws it, in the size of an image."""
    renderer = QSvgRenderer(QByteArray(data))
    assert renderer.isValid()
    image = QImage(like.size(), QImage.Format.Format_RGB32)
    painter = QPainter(image)
    renderer.render(painter)
    painter.end()
    return image


def table(text: str) -> Table:
    heading, *rows = csv.reader(StringIO(text))
    values = zip(*([float(cell) if cell else np.nan for cell in row] for row in rows), strict=True)
    return dict(zip(heading, map(np.array, values), strict=True))


def test_every_figure_is_saved_as_it_looks_and_with_its_numbers(
    opened: Open, themed: Any, tmp_path: Path, chosen: list[str]
) -> None:
    themed("light")
    lab = opened(face="lab")
    lab.wait_for_take()
    lab.performance.seek(0.1)
    ways: Any = cycle((by_click, by_menu_key))
    for panel in [each for each in lab.panels if each.figure is not None and each.key != "drum"]:
        lab.panel(panel.key)
        lab.wait(lambda panel=panel: panel.isVisible() and panel.columns() is not None and panel.columns().rows)
        lab.wait(lambda panel=panel: panel.background.busy is False)
        size = panel.figure.size()
        kinds = [("Save picture as PNG", "png"), ("Save picture as SVG", "svg"), ("Save data", "csv")]
        for words, suffix in kinds:
            next(ways)(lab, panel.figure)
            take_action(words)
            path = tmp_path / Path(chosen[-1]).name
            assert Path(chosen[-1]).suffix == f".{suffix}" and lab.said[-1].startswith(f"Saved {path}."), lab.said
        stem = path.with_suffix("")
        assert stem.name.endswith(panel.title.lower()) and stem.name.startswith("A small string B3")
        heading, *rows = csv.reader(StringIO(Path(f"{stem}.csv").read_text("utf-8")))
        assert rows and all(len(row) == len(heading) for row in rows)
        assert len(rows) == panel.columns().rows
        image, data = QImage(str(stem) + ".png"), Path(f"{stem}.svg").read_bytes()
        assert image.size() == size.expandedTo(QSize(0, 240)) * 2, "so high that both axes have their labels"
        assert panel.figure.size() == size, "the screen stays"
        seen = pixels(image)
        assert len(np.unique(seen.reshape(-1, 3), axis=0)) > 20, "it is not blank"
        assert np.abs(seen - pixels(rendered(data, image))).mean() < 6, panel.key
        assert data.count(b"<text") > 4, "words are words"
        if panel.key in CURVES:
            assert b"<image" not in data, panel.key
            hue = QColor(theme.MODEL).name()
            drawn = [part for part in data.split(b"<g ") if f'stroke="{hue}"'.encode() in part]
            assert any(b"<path" in part or b"<polyline" in part or b"<ellipse" in part for part in drawn), panel.key
    settings = lab.controller.settings()
    assert settings.files.folders["figure"] == tmp_path == Path(chosen[-1]).parent


def test_files_have_the_numbers_of_the_take_at_the_command(
    lab: Window, tmp_path: Path, chosen: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    lab.wait_for_take()
    take: Any = lab.performance.take
    lab.panel("waveform")
    waveform = lab.panel("waveform")
    lab.wait(lambda: waveform.columns() is not None and waveform.columns().rows == take.frames)
    choose = QFileDialog.getSaveFileName

    def choose_late(*given: Any) -> Any:
        lab.change(position=0.21)
        lab.wait_for_take()
        return choose(*given)

    monkeypatch.setattr(QFileDialog, "getSaveFileName", choose_late)
    by_shift_f10(lab, waveform.figure)
    take_action("Save data")
    found = table((tmp_path / Path(chosen[-1]).name).read_text("utf-8"))
    assert list(found) == ["time (s)", "A model (m)", "B truth (m)"]
    assert (found["time (s)"] == np.arange(take.frames) / take.rate_hz).all()
    for name in ("model", "truth"):
        column = found["A model (m)" if name == "model" else "B truth (m)"].astype(np.float32)
        assert (column == take.listened.signals[name].read()[:, 0]).all()
    monkeypatch.setattr(QFileDialog, "getSaveFileName", choose)
    take = lab.performance.take

    def copied(key: str) -> Table:
        figure = lab.panel(key).figure
        lab.wait(lambda: figure.isVisible() and lab.panel(key).columns() is not None)
        by_click(lab, figure)
        take_action("Copy data")
        return table(QGuiApplication.clipboard().text())

    space_time = lab.panel("space_time")
    lab.wait(lambda: space_time.columns() is not None)
    space_time.plot.show_range(0.1, 0.2)
    found = copied("space_time")
    first, last = round(0.1 * take.frames_hz), round(0.2 * take.frames_hz)
    assert found.pop("time (s)") == pytest.approx(np.arange(first, last + 1) / take.frames_hz)
    motion_m = take.motion_m("model")[first : last + 1]
    assert (np.stack(list(found.values()), axis=1).astype(np.float32) == motion_m).all()
    monkeypatch.setattr(columns_module, "MOST_VALUES", 10 * (1 + motion_m.shape[1]))
    assert len(copied("space_time")["time (s)"]) == 10
    by_click(lab, space_time.figure)
    take_action("Save data")
    assert f"The first 10 of {len(motion_m)} rows; zoom in for others." in lab.said[-1]
    monkeypatch.undo()
    lab.performance.seek(0.1)
    string = lab.panel("string")
    lab.wait(lambda: "A model (mm)" in string.columns().values)
    by_click(lab, string.figure)
    take_action("Copy data")
    found = table(QGuiApplication.clipboard().text())
    assert found["position"] == pytest.approx(np.linspace(0, 1, take.info.grid_points))
    assert (found["B truth (mm)"].astype(np.float32) == string.view.shapes_mm["truth"]).all()


def test_a_right_click_copies_pictures_and_a_right_drag_pans(lab: Window) -> None:
    lab.wait_for_take()
    lab.change(left_view="spectrum")
    figure = lab.panel("spectrum").figure
    lab.wait(figure.isVisible)
    by_click(lab, figure)
    take_action("Copy picture")
    data = QGuiApplication.clipboard().mimeData()
    assert data.imageData().size() == figure.size().expandedTo(QSize(0, 240)) * 2
    assert QSvgRenderer(data.data("image/svg+xml")).isValid()
    view, centre = figure.viewport(), figure.viewport().rect().center()
    drag(view, centre, centre - QPoint(150, 0), button=RIGHT)
    assert QApplication.activePopupWidget() is None, "a right button that drags pans"
    for reason, opens in ((QContextMenuEvent.Reason.Mouse, False), (QContextMenuEvent.Reason.Other, True)):
        QApplication.sendEvent(view, QContextMenuEvent(reason, centre, view.mapToGlobal(centre)))
        assert (QApplication.activePopupWidget() is not None) == opens
    take_action("Copy picture")


def test_a_drum_is_saved_and_what_cannot_be_is_said(
    opened: Open, tmp_path: Path, chosen: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    w = opened("studio_any_string", face="lab", instrument=read_instrument(INSTRUMENTS / "frame_drum.json"))
    w.wait_for_keys()
    drum = w.controller.drum
    by_menu_key(w, drum.figure)
    take_action("Save data")
    assert w.said == ["Drum: there is nothing to save yet; play a note first."] and chosen == []
    w.pluck()
    w.wait(lambda: drum.columns() is not None)
    by_click(w, drum.figure)
    take_action("Save data")
    path = tmp_path / Path(chosen[-1]).name
    found = table(path.read_text("utf-8"))
    assert np.abs(found["x (half-lengths)"]).max() == 1 and len(found) >= 3
    assert any(np.abs(values).max() > 0 for name, values in found.items() if name.endswith("(m)"))
    path.unlink()
    choose_files(monkeypatch)
    by_click(w, drum.figure)
    take_action("Save picture as PNG")
    before = set(tmp_path.iterdir())
    choose_files(monkeypatch, tmp_path / "gone" / "drum")
    for words in ("Save picture as PNG", "Save picture as SVG", "Save data"):
        by_click(w, drum.figure)
        take_action(words)
        assert "make the folder first" in w.said[-1] and "drum." in w.said[-1]
    assert set(tmp_path.iterdir()) == before

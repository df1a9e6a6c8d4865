"""What is shown becomes files and the clipboard's: pictures that look like it, and its numbers."""

import csv
from io import StringIO
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PySide6.QtCore import QByteArray, QSize, Qt
from PySide6.QtGui import QGuiApplication, QImage, QPainter
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QAbstractScrollArea, QApplication, QFileDialog, QMenu, QWidget

from app.export import columns as columns_module
from tests.app.places import choose_files
from tests.app.window.driver import KEY, PLAIN, SHIFT, Window

RIGHT = Qt.MouseButton.RightButton
CURVES = ("string", "spectrum", "waveform", "error_time", "eigenvalues")  # the others may hold images
Table = dict[str, NDArray[np.float64]]


@pytest.fixture
def chosen(monkeypatch, tmp_path) -> list[str]:
    """The names that file dialogs propose; each is chosen, without its ending, in an own folder."""
    proposed: list[str] = []

    def choose(parent: QWidget, title: str, place: str, filters: str) -> tuple[str, str]:
        proposed.append(place)
        return str(tmp_path / Path(place).stem), filters

    monkeypatch.setattr(QFileDialog, "getSaveFileName", choose)
    return proposed


def take(w: Window, figure: QWidget, words: str, way: str = "click") -> None:
    """Choose in the menu that pops up."""
    if way == "click":
        place = figure.viewport() if isinstance(figure, QAbstractScrollArea) else figure
        w.qtbot.mouseClick(place, RIGHT, pos=place.rect().center())
    else:
        w.key(KEY.Key_Menu if way == "key" else KEY.Key_F10, PLAIN if way == "key" else SHIFT, on=figure)
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


def test_every_figure_is_saved_with_its_numbers(lab, themed, tmp_path, chosen, monkeypatch):
    themed("light")
    lab.wait_for_take()
    lab.performance.seek(0.1)
    ways = cycle(("click", "key", "shift"))
    for panel in [each for each in lab.panels if each.figure is not None and each.key != "drum"]:
        lab.panel(panel.key)
        lab.wait(lambda panel=panel: panel.isVisible() and panel.columns() is not None and panel.columns().rows)
        if panel.key == "error_plane":
            panel.background.cancel()  # the finer ones
        lab.wait(lambda panel=panel: panel.background.busy is False)
        size = panel.figure.size()
        for words, suffix in (("Save picture as PNG", "png"), ("Save picture as SVG", "svg"), ("Save data", "csv")):
            take(lab, panel.figure, words, next(ways))
            path = tmp_path / Path(chosen[-1]).name
            assert path.suffix == f".{suffix}" and lab.said[-1].startswith(f"Saved {path}."), lab.said
        stem = path.with_suffix("")
        assert stem.name.endswith(panel.title.lower()) and stem.name.startswith("A small string B3")
        heading, *rows = csv.reader(StringIO(Path(f"{stem}.csv").read_text("utf-8")))
        assert rows and all(len(row) == len(heading) for row in rows) and len(rows) == panel.columns().rows
        image, data = QImage(f"{stem}.png"), Path(f"{stem}.svg").read_bytes()
        assert image.size() == size.expandedTo(QSize(0, 240)) * 2, "so high that both axes have their labels"
        assert panel.figure.size() == size, "the screen stays"
        seen = pixels(image)
        assert len(np.unique(seen.astype(int) @ [1 << 16, 1 << 8, 1])) > 20, "it is not blank"
        assert np.abs(seen - pixels(rendered(data, image))).mean() < 6, panel.key
        assert data.count(b"<text") > 4, "words are words"
        if panel.key in CURVES:
            assert b"<image" not in data, panel.key
    assert lab.controller.settings().files.folders["figure"] == tmp_path == Path(chosen[-1]).parent
    choose_files(monkeypatch, tmp_path / "gone" / "string")
    for words in ("Save picture as PNG", "Save picture as SVG", "Save data"):
        take(lab, panel.figure, words)
        assert "make the folder first" in lab.said[-1]


def test_files_have_the_numbers_at_the_command(lab, tmp_path, chosen, monkeypatch):
    lab.wait_for_take()
    present: Any = lab.performance.take
    waveform, space_time, string = (lab.panel(key) for key in ("waveform", "space_time", "string"))
    lab.panel("waveform")
    lab.wait(lambda: waveform.columns() is not None and waveform.columns().rows == present.frames)
    choose = QFileDialog.getSaveFileName

    def choose_late(*given: Any) -> Any:
        lab.change(position=0.21)
        lab.wait_for_take()
        return choose(*given)

    with monkeypatch.context() as late:
        late.setattr(QFileDialog, "getSaveFileName", choose_late)
        take(lab, waveform.figure, "Save data")
    found = table((tmp_path / Path(chosen[-1]).name).read_text("utf-8"))
    assert list(found) == ["time (s)", "A model (m)", "B truth (m)"]
    assert (found["time (s)"] == np.arange(present.frames) / present.rate_hz).all()
    for heading, name in (("A model (m)", "model"), ("B truth (m)", "truth")):
        assert (found[heading].astype(np.float32) == present.listened.signals[name].read()[:, 0]).all()
    present = lab.performance.take

    def copied(panel: Any) -> Table:
        lab.panel(panel.key)
        lab.wait(lambda: panel.isVisible() and panel.columns() is not None)
        take(lab, panel.figure, "Copy data")
        return table(QGuiApplication.clipboard().text())

    copied(space_time)
    space_time.plot.show_range(0.1, 0.2)
    found = copied(space_time)
    first, last = round(0.1 * present.frames_hz), round(0.2 * present.frames_hz)
    assert found.pop("time (s)") == pytest.approx(np.arange(first, last + 1) / present.frames_hz)
    motion_m = present.motion_m("model")[first : last + 1]
    assert (np.stack(list(found.values()), axis=1).astype(np.float32) == motion_m).all()
    with monkeypatch.context() as small:
        small.setattr(columns_module, "MOST_VALUES", 10 * (1 + motion_m.shape[1]))
        assert len(copied(space_time)["time (s)"]) == 10
        take(lab, space_time.figure, "Save data")
    assert f"The first 10 of {len(motion_m)} rows; zoom in for others." in lab.said[-1]
    lab.performance.seek(0.1)
    lab.wait(lambda: "A model (mm)" in string.columns().values)
    found = copied(string)
    assert found["position"] == pytest.approx(np.linspace(0, 1, present.info.grid_points))
    assert (found["B truth (mm)"].astype(np.float32) == string.view.shapes_mm["truth"]).all()
    figure = waveform.figure
    lab.panel("waveform")
    take(lab, figure, "Copy picture")
    data = QGuiApplication.clipboard().mimeData()
    assert data.imageData().size() == figure.size().expandedTo(QSize(0, 240)) * 2
    assert QSvgRenderer(data.data("image/svg+xml")).isValid()

"""Laws of every panel of the registry, and of the jobs that panels compute."""

import time
from threading import Event

import pytest
from PySide6.QtCore import QRect
from PySide6.QtWidgets import QAbstractButton, QTabBar, QWidget

from app.presets.library import Library
from app.session.choices import Choices
from app.shared.worker import Job
from app.stage.session import Session
from app.window.panels import Moment, Panel, StringPanel, base
from app.window.panels.drum import DrumPanel
from app.window.panels.rack import LEFT, RIGHT
from tests.app.gestures import reported
from tests.app.window.driver import KEY, by_arrows, fits, tab_stops

DECKS = (*LEFT, *RIGHT)
EVERY = (StringPanel, DrumPanel, *DECKS)
KEYS = (KEY.Key_Left, KEY.Key_Up, KEY.Key_Plus, KEY.Key_Minus, KEY.Key_Home, KEY.Key_Return, KEY.Key_Escape)


def lightness(panel: QWidget) -> float:
    """The mean of its picture, 0 … 255."""
    picture = panel.grab().toImage()
    places = [(x, y) for x in range(0, picture.width(), 7) for y in range(0, picture.height(), 7)]
    return sum(picture.pixelColor(*place).lightness() for place in places) / len(places)


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.key)
def test_a_panel_is_named_and_themed_empty_and_with_a_take_and_leaves_no_thread(kind, make, take, themed, qtbot):
    """`make` sees to the threads."""
    assert kind.title and kind.help.endswith(".")
    empty = kind(Session(Choices(face="lab")), Library([]))
    qtbot.addWidget(empty)
    empty.resize(700, 300)
    empty.show()
    for _ in range(8):
        empty.show_moment(Moment(None, 0.0, False, 0.016))
    light = {name: themed(name) or lightness(empty) for name in ("light", "dark")}
    assert light["light"] > light["dark"] + 60
    empty.cover("Drums are played")
    assert empty.covered == "Drums are played"
    empty.end()
    if kind is not DrumPanel:
        panel = make(kind)
        for position_s in (0.0, 0.5, take.seconds):
            for _ in range(8):
                panel.show_moment(Moment(take, position_s, True, 0.016))
        panel.take_finished(take)
        panel.show_moment(Moment(take, 0.5, False, 0.016))
        for control in tab_stops(panel):
            assert control.accessibleName(), control
            assert control.toolTip() or isinstance(control, QTabBar), control.accessibleName()


def test_every_panel_fits_and_is_operated_by_the_keyboard_alone(lab, themed):
    """From the deck's names by arrows to the panel, and by Tab to each of its controls and out again."""
    themed("dark", 150)
    lab.window.show_keys(False)
    lab.window.resize(1280, 720)
    lab.wait_for_take()
    for deck, kinds in ((lab.window.left, LEFT), (lab.window.right, RIGHT)):
        (names,) = deck.findChildren(QTabBar)
        names.setFocus()
        lab.key(KEY.Key_Home, on=names)
        while names.currentIndex() > 0:
            lab.key(KEY.Key_Left, on=names)
        for kind in kinds:
            panel = deck.currentWidget()
            assert isinstance(panel, kind) and panel.isVisible()
            lab.wait(lambda: fits(lab.window) and not panel.background.busy)  # noqa: B023 - it may bring or bar a control
            assert panel.height() >= panel.minimumSizeHint().height() > 0
            controls = [each for each in tab_stops(panel) if not by_arrows(each)]
            for control in controls:
                place = QRect(control.mapTo(panel, control.rect().topLeft()), control.size())
                assert panel.rect().contains(place), (kind.key, control.accessibleName())
            met = set[QWidget]()
            while not met or panel.isAncestorOf(lab.window.focusWidget()):
                lab.key(KEY.Key_Tab, on=lab.window.focusWidget())
                met.add(lab.window.focusWidget())
                assert len(met) <= len(controls) + 1
            assert set(controls) <= met and controls
            for control in controls:
                for key in KEYS[: 1 if isinstance(control, QAbstractButton) else None]:
                    lab.key(key, on=control)
            lab.key(KEY.Key_Escape)
            names.setFocus()
            lab.key(KEY.Key_Right, on=names)
    assert lab.said == []


class AnyPanel(Panel):
    key = "any"


def test_a_job_rests_while_nobody_looks(qtbot, monkeypatch):
    monkeypatch.setattr(base, "UNSEEN_S", 0.2)
    panel, resting = AnyPanel(Session(), Library([])), Event()
    ended = reported(panel.background.finished)

    def work(job: Job) -> None:
        time.sleep(base.UNSEEN_S + 0.05)
        resting.set()
        job.report(0.5)

    panel.compute(work)
    assert resting.wait(60)
    qtbot.wait(50)
    assert ended == []
    qtbot.waitUntil(lambda: panel.look() or bool(ended))
    panel.end()

"""The button that plays: it says what a click does, whatever began or ended the sound."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.session.choices import Choices
from app.views.controls.transport_bar import TransportBar


def test_it_reports_what_plays_and_is_left_alone_while_nothing_changes(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    bar = TransportBar()
    qtbot.addWidget(bar)

    def shown(playing: bool) -> tuple[bool, str]:
        bar.show_playing(playing)
        return bar._play.isChecked(), bar._play.text()

    assert shown(True) == (True, "■  Stop")
    assert shown(False) == (False, "▶  Pluck")
    qtbot.mouseClick(bar._play, Qt.MouseButton.LeftButton)  # it checks itself
    assert shown(False) == (False, "▶  Pluck")
    qtbot.mouseClick(bar._play, Qt.MouseButton.LeftButton)
    assert shown(True) == (True, "■  Stop")
    texts: list[str] = []
    monkeypatch.setattr(bar._play, "setText", texts.append)
    bar.show_playing(True)
    assert not texts
    bar.show_playing(False)
    assert texts == ["▶  Pluck"]


def test_listening_points_are_barred_at_the_bridge(qtbot: QtBot) -> None:
    bar = TransportBar()
    qtbot.addWidget(bar)
    for pickup, stereo, enabled in (
        ("bridge", True, (False, False)),
        ("displacement", True, (True, True)),
        ("bridge", False, (False, False)),
        ("velocity", False, (True, False)),
    ):
        bar.show_choices(Choices(pickup=pickup, stereo=stereo))
        assert tuple(bar.knobs[field].isEnabled() for field in ("listen", "listen_right")) == enabled
    assert "bridge" not in bar.knobs["listen"].toolTip()
    bar.show_choices(Choices(pickup="bridge"))
    assert "The bridge hears the whole string" in bar.knobs["listen"].toolTip()

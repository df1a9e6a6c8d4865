from __future__ import annotations

import json
import shutil

import pytest

from tests.bench.cli import main
from tests.bench.machine import Machine
from tests.bench.play import unplug
from tests.bench.play.children import PACKAGES
from tests.bench.play.unplug import Loss, Unplugged

MACHINE = Machine("", 1, 1, "", "", "")


def found(back_s: float | None = 0.4, ends_s: float | None = 1.0, alive: bool = True) -> Unplugged:
    return Unplugged(MACHINE, 0, "harp", 1, (Loss("card", 1.0, back_s, 0.5, 0),), 0.5, ends_s, alive)


def test_it_passes_where_sound_comes_back_in_time_ends_and_the_app_goes_on() -> None:
    assert found().passed
    assert found(back_s=2.0).in_time == 1
    for failed in (found(back_s=2.1), found(back_s=None), found(ends_s=None), found(alive=False)):
        assert not failed.passed
    assert found(back_s=None).back_s == []


@pytest.mark.skipif(any(shutil.which(name) is None for name in PACKAGES), reason="no PulseAudio, or no Xvfb")
def test_a_device_that_goes_and_comes_back_is_played_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Once the card, once the server; how soon is for a benchmark to tell."""
    monkeypatch.setattr(unplug, "PLAYED_S", 0.3)
    monkeypatch.setattr(unplug, "GONE_S", (0.2, 0.4))
    monkeypatch.setattr(unplug, "TARGET_S", unplug.PATIENCE_S + 1)
    status = main(["unplug", "--times", "2", "--json"])
    out, err = capsys.readouterr()
    if "no key of the app was heard" in err:
        pytest.skip("ALSA does not play into PulseAudio here")
    assert status == 0, err + out
    reported = json.loads(out)
    assert [loss["kind"] for loss in reported["losses"]] == ["card", "server"]
    assert reported["in_time"] == 2
    assert all(0 < loss["loudest"] <= 1 for loss in reported["losses"])
    assert reported["ends_s"] is not None and reported["alive"]

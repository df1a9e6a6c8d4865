from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
import warnings
from collections import Counter
from pathlib import Path
from random import Random

import numpy as np
import pytest
from PySide6.QtCore import qWarning
from pytestqt.qtbot import QtBot

from app.patches.library import list_patches
from app.session.choices import OBSERVED, Choices, Session
from app.window.main_window import MainWindow
from tests.bench.random_changes import Repertoire, random_change
from tests.bench.soak import PROGRAMS, _holes, _Watch, collected_faults
from tests.bench.stage import Stage

PATCHES = tuple(entry.patch for entry in list_patches()[0][:3])
REPERTOIRE = Repertoire(("first", "second"), ("spectrum", "partials"), ("waveform", "compare"), PATCHES)


RUN = """
import sys
from pathlib import Path
import tests.bench.cli, tests.bench.soak, app.presets.library
app.presets.library.SHIPPED = Path(sys.argv[1])
tests.bench.soak.EVERY_S = 0.1
tests.bench.soak.REST_S = 0.2
sys.exit(tests.bench.cli.main(sys.argv[2:]))
"""


@pytest.mark.skipif(any(shutil.which(name) is None for name in PROGRAMS), reason="no PulseAudio")
@pytest.mark.parametrize("how", [(), ("--playing",)])
def test_a_short_soak_plays_into_the_private_card_and_reports(
    small_preset: Path, tmp_path: Path, how: tuple[str, ...]
) -> None:
    """In a process of its own, where PortAudio has not been loaded yet."""
    (tmp_path / "presets").mkdir()
    for name in ("first", "second"):
        shutil.copy(small_preset, tmp_path / "presets" / f"{name}.safetensors")
    words = ["soak", "--minutes", "0.03", "--seed", "3", "--buffer", "high", "--json", *how]
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(tmp_path / "presets"), *words],
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=600,  # kernels may have to be compiled
    )
    if "libasound2-plugins" in done.stderr:
        pytest.skip("ALSA does not play into PulseAudio here")
    assert done.returncode == 0, done.stderr + done.stdout
    found = json.loads(done.stdout)
    assert found["faults"] == []
    assert found["threads_left"] == []
    assert found["plucks"] > 2
    assert found["end_mib"] > 0
    assert found["drift_mib"] == max(abs(mib - found["settled_mib"]) for mib in found["memory_mib"])
    assert len(found["memory_mib"]) >= 2 and found["peak_mib"] > 0
    assert (found["seed"], found["buffer"]) == (3, "high")
    assert found["holes"]["seconds"] > 1.0  # it was recorded
    assert found["holes"]["heard"] == len(found["holes"]["heard_at_s"])


def test_the_recording_is_judged_by_who_played(tmp_path: Path) -> None:
    sound = np.sin(np.arange(48_000) * 0.05).astype(np.float32)
    sound[10_000:10_480] = 0
    sound[20_000:20_960] = 0
    sound[19_000:20_000] *= np.linspace(1, 0, 1000, dtype=np.float32)
    sound[20_960:21_960] *= np.linspace(0, 1, 1000, dtype=np.float32)
    (tmp_path / "recording").write_bytes(sound.tobytes())
    reported, tone = Counter({"device": 1}), np.ones(48_000, np.float32)
    tone[30_000:30_096] = 0
    (tmp_path / "tone").write_bytes(tone.tobytes())
    files = (tmp_path / "recording", tmp_path / "tone")
    playing, restless = (_holes(*files, playing, reported, [3.5, 8.25]) for playing in (True, False))
    assert (playing.control, playing.control_ms) == (1, 2.0)
    assert (playing.late, playing.latest_ms) == (2, 8.25)
    assert (playing.heard, restless.heard) == (2, 1)
    assert restless.heard_ms == pytest.approx(10, abs=0.1)
    assert playing.longest_ms == pytest.approx(20, abs=0.1)
    assert restless.a_minute == 60
    assert restless.reported == {"device": 1}


def test_one_who_plays_is_weighed_at_the_end_of_each_minute(qtbot: QtBot) -> None:
    """Of an hour; what comes and goes within seconds does not count, nor does the first minute's growth."""
    window = MainWindow()
    qtbot.addWidget(window)
    watch = _Watch(Stage(window, None, ""), 3600.0, lambda share, text: None)  # type: ignore[arg-type]
    watch.stop()
    watch._weights_mib = [(s, 400.0 + min(s, 30) + (300.0 if s % 20 == 5 else s / 3600)) for s in range(1, 3601)]
    found = watch.at_each_minute()
    assert len(found) == 60
    assert found[0] == pytest.approx(430, abs=0.1)
    assert found[-1] == pytest.approx(431, abs=0.1)
    assert watch.peak_mib > 700


def test_random_changes_are_allowed_and_touch_everything() -> None:
    random, session = Random(1), Session()
    touched: set[str] = set()
    session.changed.connect(lambda names: touched.update(names))
    for _ in range(500):
        session.update(**random_change(random, session.choices, REPERTOIRE))
    assert touched == set(OBSERVED)


def test_the_same_seed_changes_the_same() -> None:
    def some(seed: int) -> list[object]:
        random = Random(seed)
        return [random_change(random, Choices(), REPERTOIRE) for _ in range(20)]

    assert some(5) == some(5)
    assert some(5) != some(6)


def test_faults_are_collected_once_each_with_their_number() -> None:
    def fail() -> None:
        raise ArithmeticError("a slip")

    with collected_faults() as faults:
        for _ in range(2):
            thread = threading.Thread(target=fail)
            thread.start()
            thread.join()
        qWarning("odd")
        warnings.warn("careful", stacklevel=1)
    reported = sorted(faults.items(), key=lambda fault: -fault[1])
    assert reported[0][1] == 2
    assert "ArithmeticError: a slip" in reported[0][0]
    assert any(text == "Qt: odd" for text in faults)
    assert any("careful" in text for text in faults)

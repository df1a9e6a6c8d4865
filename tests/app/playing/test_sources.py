"""Presets in memory: loaded once, forgotten when others are used, and nobody waits who need not."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.playing import sources as module
from app.playing.sources import Sources
from engine.pluck import Pluck
from engine.presets import Preset, PresetError, load_preset
from engine.resonators.sine_transform import project

RATE_HZ = 8_000
Wait = Callable[[Callable[[], bool]], None]


@pytest.fixture
def loaded(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The files that were read, in order."""
    read: list[Path] = []

    def load(path: Path) -> Preset:
        read.append(path)
        return load_preset(path)

    monkeypatch.setattr(module, "load_preset", load)
    return read


def copies(small_preset: Path, folder: Path, number: int) -> list[Path]:
    return [Path(shutil.copy(small_preset, folder / f"{index}.safetensors")) for index in range(number)]


def test_what_is_prepared_is_there_at_its_rate(small_preset: Path, loaded: list[Path]) -> None:
    sources = Sources()
    assert not sources.has(small_preset, RATE_HZ)
    sources.program(small_preset, "model", RATE_HZ)
    assert not sources.has(small_preset, RATE_HZ), "the truth would be waited for"
    sources.prepare(small_preset, RATE_HZ)
    assert sources.has(small_preset, RATE_HZ)
    assert not sources.has(small_preset, 2 * RATE_HZ)
    assert sources.program(small_preset, "model", RATE_HZ) is sources.program(small_preset, "model", RATE_HZ)
    sources.prepare(small_preset, 2 * RATE_HZ)
    assert sources.load(small_preset) is sources.load(small_preset)
    assert loaded == [small_preset]


def test_the_presets_that_were_used_last_are_kept(
    small_preset: Path, tmp_path: Path, loaded: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "KEPT_PRESETS", 2)
    sources, (first, second, third) = Sources(), copies(small_preset, tmp_path, 3)
    for path in (first, second):
        sources.prepare(path, RATE_HZ)
    sources.load(first)
    sources.prepare(third, RATE_HZ)
    assert [sources.has(path, RATE_HZ) for path in (first, second, third)] == [True, False, True]
    sources.prepare(second, RATE_HZ)
    assert loaded == [first, second, third, second]


def test_what_a_pluck_begins_with_is_remembered(small_preset: Path, loaded: list[Path]) -> None:
    sources, pluck = Sources(), Pluck(0.4, 3.0)
    initial_m, rows = sources.begin(small_preset, "truth", RATE_HZ, pluck)
    info = sources.load(small_preset).preset.info
    np.testing.assert_array_equal(initial_m, project(pluck.displacement(info.grid_points), info.modes))
    assert sources.begin(small_preset, "truth", RATE_HZ, Pluck(0.4, 3.0))[1] is rows
    assert sources.begin(small_preset, "truth", RATE_HZ, Pluck(0.5, 3.0))[1] is not rows


def test_a_damaged_preset_is_named(tmp_path: Path) -> None:
    (tmp_path / "broken.safetensors").write_bytes(b"damaged")
    sources = Sources()
    for ask in (sources.load, lambda path: sources.prepare(path, RATE_HZ)):
        with pytest.raises(PresetError, match=r"broken\.safetensors"):
            ask(tmp_path / "broken.safetensors")
    assert not sources.has(tmp_path / "broken.safetensors", RATE_HZ)


def test_what_is_there_waits_for_nothing_that_is_loaded(
    small_preset: Path, tmp_path: Path, wait: Wait, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources, (slow,) = Sources(), copies(small_preset, tmp_path, 1)
    sources.prepare(small_preset, RATE_HZ)
    begun, go_on = threading.Event(), threading.Event()

    def load(path: Path) -> Preset:
        begun.set()
        assert go_on.wait(20)
        return load_preset(path)

    monkeypatch.setattr(module, "load_preset", load)
    loading = threading.Thread(target=sources.prepare, args=(slow, RATE_HZ))
    loading.start()
    assert begun.wait(20)
    assert sources.has(small_preset, RATE_HZ)
    for kind in ("model", "truth"):
        sources.program(small_preset, kind, RATE_HZ)
        sources.begin(small_preset, kind, RATE_HZ, Pluck(0.45))
    assert loading.is_alive()
    go_on.set()
    wait(lambda: sources.has(slow, RATE_HZ))
    loading.join()

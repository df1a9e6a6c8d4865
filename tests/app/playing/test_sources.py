"""Presets in memory: loaded once, forgotten when others are used, and nobody waits who need not."""

import shutil
import threading
from pathlib import Path

import pytest

from app.playing import sources as module
from app.playing.sources import Sources
from engine.pluck import Pluck
from engine.presets import Preset, PresetError, load_preset
from engine.values.ear import Ear

RATE_HZ = 8_000


@pytest.fixture
def loaded(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The files that were read, in order."""
    read: list[Path] = []

    def load(path: Path) -> Preset:
        read.append(path)
        return load_preset(path)

    monkeypatch.setattr(module, "load_preset", load)
    return read


def test_what_is_prepared_is_there_at_its_rate_and_read_once(small_preset, loaded):
    made = Sources()
    assert not made.has(small_preset, RATE_HZ)
    program = made.load(small_preset).program("model", RATE_HZ)
    assert not made.has(small_preset, RATE_HZ), "the truth would be waited for"
    made.prepare(small_preset, RATE_HZ)
    assert made.has(small_preset, RATE_HZ) and not made.has(small_preset, 2 * RATE_HZ)
    assert made.load(small_preset).program("model", RATE_HZ) is program
    made.prepare(small_preset, 2 * RATE_HZ)
    assert loaded == [small_preset]


def test_the_presets_that_were_used_last_are_kept_and_a_damaged_one_is_named(
    small_preset, tmp_path, loaded, monkeypatch
):
    monkeypatch.setattr(module, "KEPT_PRESETS", 2)
    first, second, third = (Path(shutil.copy(small_preset, tmp_path / f"{n}.safetensors")) for n in range(3))
    made = Sources()
    for path in (first, second):
        made.prepare(path, RATE_HZ)
    made.load(first)
    made.prepare(third, RATE_HZ)
    assert [made.has(path, RATE_HZ) for path in (first, second, third)] == [True, False, True]
    made.prepare(second, RATE_HZ)
    assert loaded == [first, second, third, second]
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"damaged")
    for ask in (made.load, lambda path: made.prepare(path, RATE_HZ)):
        with pytest.raises(PresetError, match=r"broken\.safetensors"):
            ask(broken)
    assert not made.has(broken, RATE_HZ)


def test_what_is_there_waits_for_nothing_that_is_loaded(small_preset, tmp_path, monkeypatch):
    made, slow = Sources(), Path(shutil.copy(small_preset, tmp_path))
    made.prepare(small_preset, RATE_HZ)
    begun, go_on = threading.Event(), threading.Event()

    def load(path: Path) -> Preset:
        begun.set()
        assert go_on.wait(20)
        return load_preset(path)

    monkeypatch.setattr(module, "load_preset", load)
    loading = threading.Thread(target=made.prepare, args=(slow, RATE_HZ))
    loading.start()
    assert begun.wait(20) and made.has(small_preset, RATE_HZ)
    for kind in ("model", "truth"):
        made.load(small_preset).voice(kind, Pluck(0.45), Ear((0.3,)), RATE_HZ)
    assert loading.is_alive()
    go_on.set()
    loading.join()
    assert made.has(slow, RATE_HZ)

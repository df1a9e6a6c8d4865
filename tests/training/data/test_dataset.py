import json
import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from engine.truth import ModalState, SplittingSolver
from training.cell import Cell, configuration_of
from training.configuration import DATA_VERSION, DatasetConfiguration
from training.data.dataset import dataset_folder, draw_initial, load_dataset, split_rows

TINY = DatasetConfiguration("noise", 4000, 4, steps=30, count=10)


def test_amplitudes_are_the_solvers(small_dataset):
    c = small_dataset.configuration
    solver = SplittingSolver(c.resonator, c.rate_hz)
    state = ModalState.at_rest(torch.from_numpy(draw_initial(c)))
    assert torch.equal(small_dataset.amplitudes, solver.solve(state, c.steps).float())


def test_a_draw_that_would_break_the_string_is_softened():
    free = DatasetConfiguration("pluck", 48_000, 40, count=60)
    capped = draw_initial(replace(free, largest_tension_rise=0.02))
    drawn, rise = draw_initial(free), free.resonator.relative_tension_rise(draw_initial(free))
    assert (rise > 0.02).any() and (rise < 0.02).any()
    np.testing.assert_allclose(free.resonator.relative_tension_rise(capped), np.minimum(rise, 0.02))
    assert np.array_equal(capped[rise <= 0.02], drawn[rise <= 0.02])
    with pytest.raises(ValueError, match="largest_tension_rise must be above 0"):
        replace(free, largest_tension_rise=0.0)


def test_splits_are_in_order_and_whole():
    found = [split_rows(1000, name) for name in ("train", "validation", "test", "all")]
    assert found == [slice(0, 800), slice(800, 900), slice(900, 1000), slice(0, 1000)]
    with pytest.raises(ValueError, match="split 'half' is not one of train, validation, test, all"):
        split_rows(10, "half")


def test_the_cache_is_used_again_and_never_shared_by_other_data(tmp_path):
    load_dataset(TINY, tmp_path)
    stamp = (dataset_folder(TINY, tmp_path) / "amplitudes.npy").stat().st_mtime_ns
    load_dataset(TINY, tmp_path, lambda share: pytest.fail("made again"))
    assert (dataset_folder(TINY, tmp_path) / "amplitudes.npy").stat().st_mtime_ns == stamp
    assert dataset_folder(replace(TINY, seed=1), tmp_path) != dataset_folder(TINY, tmp_path)
    assert not list((tmp_path / "datasets").glob("*.unfinished"))


def test_another_version_of_the_data_is_other_data(tmp_path, monkeypatch):
    before = dataset_folder(TINY, tmp_path), configuration_of(Cell("lru", True, "noise", 4000)).digest
    monkeypatch.setattr("training.data.dataset.DATA_VERSION", 99)
    monkeypatch.setattr("training.configuration.DATA_VERSION", 99)
    after = dataset_folder(TINY, tmp_path), configuration_of(Cell("lru", True, "noise", 4000)).digest
    assert before[0] != after[0] and before[1] != after[1]


@pytest.mark.parametrize(
    ("initial", "amplitudes_mm", "scale_mm"),
    [
        ("gaussian", [0.09838905, 1.152356, -0.004192985], 0.6827188),
        ("noise", [0.2198603, -0.1396777, -0.1671215], 2.358021),
        ("pluck", [0.03438805, 0.6412062, -0.1626634], 0.8337261),
    ],
)
def test_what_a_version_of_the_data_holds_is_for_good(tmp_path, initial, amplitudes_mm, scale_mm):
    """Where this fails, the solver or a draw has changed: raise DATA_VERSION, and set the new figures here."""
    found = load_dataset(replace(TINY, initial=initial), tmp_path)
    assert (1000 * found.amplitudes[3, 20, :3]).tolist() == pytest.approx(amplitudes_mm, rel=1e-4)
    assert 1000 * found.scale_m == pytest.approx(scale_mm, rel=1e-5)
    assert DATA_VERSION == 3


@pytest.mark.skipif(sys.platform == "win32", reason="limits the size of files as POSIX does")
def test_a_full_disk_is_an_error_and_leaves_nothing(tmp_path):
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
        with pytest.raises(OSError, match="File too large"):
            load_dataset(TINY, tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert [path.suffix for path in (tmp_path / "datasets").iterdir()] == [".lock"]


def test_a_stride_keeps_some_of_the_frames_and_all_of_the_motion(tmp_path):
    every = load_dataset(replace(TINY, steps=450), tmp_path)
    some = load_dataset(replace(TINY, steps=450, stride=3), tmp_path)
    assert torch.equal(some.amplitudes, every.amplitudes[:, ::3])
    with pytest.raises(ValueError, match="steps must be a multiple of stride, 4, not 30"):
        replace(TINY, stride=4)


def cut_off(folder: Path, count: int, new: bytes = b"") -> None:
    file = folder / "amplitudes.npy"
    file.write_bytes(file.read_bytes()[:-count] + new)


def set_scale(folder: Path, scale_m: object) -> None:
    file = folder / "dataset.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "scale_m": scale_m}))


DAMAGES: dict[str, Callable[[Path], object]] = {
    "cut": lambda folder: cut_off(folder, 100),
    "zeros": lambda folder: cut_off(folder, 4000, bytes(4000)),
    "missing": lambda folder: (folder / "amplitudes.npy").unlink(),
    "type": lambda folder: np.save(folder / "amplitudes.npy", np.zeros((10, 31, 4))),
    "json": lambda folder: (folder / "dataset.json").write_text("{"),
    "scale": lambda folder: set_scale(folder, float("nan")),
    "list": lambda folder: set_scale(folder, [1]),
}


@pytest.mark.parametrize("how", DAMAGES)
def test_a_damaged_cache_is_reported_with_its_remedy(tmp_path, how):
    load_dataset(TINY, tmp_path)
    folder = dataset_folder(TINY, tmp_path)
    DAMAGES[how](folder)
    with pytest.raises(ValueError, match=r"damaged data cache .*delete that folder") as reported:
        load_dataset(TINY, tmp_path)
    assert str(folder) in str(reported.value)

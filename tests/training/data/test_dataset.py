import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from engine.resonators.sine_transform import analysis_matrix
from engine.truth import ModalState, SplittingSolver
from training.cell import Cell, configuration_of
from training.configuration import DATA_VERSION, DatasetConfiguration, Recipe
from training.data.batches import TrainingData, batches
from training.data.dataset import Dataset, dataset_folder, draw_initial, load_dataset, split_rows

TINY = DatasetConfiguration("noise", 4000, 4, steps=30, count=10)


def test_amplitudes_are_the_solvers_and_a_stride_keeps_some_of_their_frames(small_dataset, tmp_path):
    c = small_dataset.configuration
    solver = SplittingSolver(c.resonator, c.rate_hz)
    state = ModalState.at_rest(torch.from_numpy(draw_initial(c)))
    assert torch.equal(small_dataset.amplitudes, solver.solve(state, c.steps).float())
    some = load_dataset(replace(c, stride=3), tmp_path)
    assert torch.equal(some.amplitudes, small_dataset.amplitudes[:, ::3])


def test_a_draw_that_would_break_the_string_is_softened():
    free = DatasetConfiguration("pluck", 48_000, 40, count=60)
    capped = draw_initial(replace(free, largest_tension_rise=0.02))
    drawn, rise = draw_initial(free), free.resonator.relative_tension_rise(draw_initial(free))
    assert (rise > 0.02).any() and (rise < 0.02).any()
    np.testing.assert_allclose(free.resonator.relative_tension_rise(capped), np.minimum(rise, 0.02))
    assert np.array_equal(capped[rise <= 0.02], drawn[rise <= 0.02])


def test_splits_are_in_order_and_whole():
    found = [split_rows(1000, name) for name in ("train", "validation", "test", "all")]
    assert found == [slice(0, 800), slice(800, 900), slice(900, 1000), slice(0, 1000)]
    with pytest.raises(ValueError, match="split 'half' is not one of train, validation, test, all"):
        split_rows(10, "half")


def test_the_cache_is_used_again_and_never_shared_by_other_data_or_another_version(tmp_path, monkeypatch):
    load_dataset(TINY, tmp_path)
    stamp = (dataset_folder(TINY, tmp_path) / "amplitudes.npy").stat().st_mtime_ns
    load_dataset(TINY, tmp_path, lambda share: pytest.fail("made again"))
    assert (dataset_folder(TINY, tmp_path) / "amplitudes.npy").stat().st_mtime_ns == stamp
    assert dataset_folder(replace(TINY, seed=1), tmp_path) != dataset_folder(TINY, tmp_path)
    assert not list((tmp_path / "datasets").glob("*.unfinished"))
    named = lambda: {dataset_folder(TINY, tmp_path), configuration_of(Cell("lru", True, "noise", 4000)).digest}  # noqa: E731
    before = named()
    monkeypatch.setattr("training.data.dataset.DATA_VERSION", 99)
    monkeypatch.setattr("training.configuration.DATA_VERSION", 99)
    assert not before & named()


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


DAMAGES = {  # of a file's bytes
    "cut": ("amplitudes.npy", lambda data: data[:-100]),
    "zeros": ("amplitudes.npy", lambda data: data[:-4000] + bytes(4000)),
    "type": ("amplitudes.npy", lambda data: data.replace(b"<f4", b"<f8")),
    "scale": ("dataset.json", lambda data: json.dumps({**json.loads(data), "scale_m": float("nan")}).encode()),
    "missing": ("amplitudes.npy", None),
}


@pytest.mark.parametrize("how", DAMAGES)
def test_a_damaged_cache_is_reported_with_its_remedy(tmp_path, how):
    load_dataset(TINY, tmp_path)
    folder, (name, damaged) = dataset_folder(TINY, tmp_path), DAMAGES[how]
    data = (folder / name).read_bytes()
    (folder / name).unlink()
    if damaged:
        (folder / name).write_bytes(damaged(data))
    with pytest.raises(ValueError, match=r"damaged data cache .*delete that folder") as reported:
        load_dataset(TINY, tmp_path)
    assert str(folder) in str(reported.value)


CPU = torch.device("cpu")
ROWS = torch.arange(16)
PLAIN = Recipe(epochs=1, flip=False, steps_per_batch=0)


def modal(dataset: Dataset, displacement: torch.Tensor) -> torch.Tensor:
    """Amplitudes in m of normalised displacement."""
    c = dataset.configuration
    return displacement.double() @ torch.from_numpy(analysis_matrix(c.grid_points, c.modes)) * dataset.scale_m


def test_all_frames_of_the_horizon_are_the_data_and_random_ones_cover_it_in_order(small_dataset):
    data = TrainingData(small_dataset, CPU)
    batch = data.draw(PLAIN, ROWS, 120, 0)
    assert data.count == 16
    assert torch.equal(batch.frames, torch.arange(1, 121))
    expected = small_dataset.amplitudes[:16, 1:121].double()
    torch.testing.assert_close(modal(small_dataset, batch.target), expected, rtol=1e-5, atol=1e-9)
    recipe = Recipe(epochs=1, steps_per_batch=20)
    first, second = (data.draw(recipe, ROWS, 400, iteration).frames for iteration in (0, 1))
    assert not torch.equal(first, second)
    for frames in (first, second):
        assert torch.equal((frames - 1) // 20, torch.arange(20))


def test_mirrored_and_inverted_strings_move_as_their_first_frames_do(small_dataset):
    c = small_dataset.configuration
    batch = TrainingData(small_dataset, CPU).draw(Recipe(epochs=1, steps_per_batch=0), ROWS, 100, 0)
    begun = modal(small_dataset, batch.initial)
    assert not torch.allclose(begun, small_dataset.amplitudes[:16, 0].double(), atol=1e-5)
    truth = SplittingSolver(c.resonator, c.rate_hz).solve(ModalState.at_rest(begun), 100)
    torch.testing.assert_close(modal(small_dataset, batch.target), truth[:, batch.frames], rtol=1e-4, atol=2e-8)


def test_an_epoch_holds_every_trajectory_once_and_fixed_batches_change_their_order_alone():
    recipe = Recipe(epochs=1, batch_size=6)
    found = batches(recipe, 20, 3)
    assert [len(rows) for rows in found] == [6, 6, 6, 2]
    assert sorted(torch.cat(found).tolist()) == list(range(20))
    assert all(torch.equal(a, b) for a, b in zip(found, batches(recipe, 20, 3), strict=True))
    assert not torch.equal(found[0], batches(recipe, 20, 4)[0])
    recipe = Recipe(epochs=1, batch_size=5, fixed_batches=True)
    table = [list(range(first, first + 5)) for first in range(0, 20, 5)]
    orders = [[rows.tolist() for rows in batches(recipe, 20, epoch)] for epoch in range(8)]
    assert all(sorted(order) == table for order in orders)
    assert len({str(order) for order in orders}) > 1

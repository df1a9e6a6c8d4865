import torch

from engine.resonators.sine_transform import analysis_matrix
from engine.truth import ModalState, SplittingSolver
from training.configuration import DatasetConfiguration, Recipe
from training.data.batches import TrainingData, batches
from training.data.dataset import Dataset, load_dataset

CPU = torch.device("cpu")
ROWS = torch.arange(16)
PLAIN = Recipe(epochs=1, flip=False, steps_per_batch=0)


def modal(dataset: Dataset, displacement: torch.Tensor) -> torch.Tensor:
    """Amplitudes in m of normalised displacement."""
    c = dataset.configuration
    return displacement.double() @ torch.from_numpy(analysis_matrix(c.grid_points, c.modes)) * dataset.scale_m


def test_all_frames_of_the_horizon_are_the_data(small_dataset):
    data = TrainingData(small_dataset, CPU)
    batch = data.draw(PLAIN, ROWS, 120, 0)
    assert data.count == 16
    assert torch.equal(batch.frames, torch.arange(1, 121))
    torch.testing.assert_close(
        modal(small_dataset, batch.target), small_dataset.amplitudes[:16, 1:121].double(), rtol=1e-5, atol=1e-9
    )


def test_random_frames_cover_the_horizon_in_order(small_dataset):
    data = TrainingData(small_dataset, CPU)
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


def test_an_epoch_holds_every_trajectory_once_and_repeats_by_its_number():
    recipe = Recipe(epochs=1, batch_size=6)
    found = batches(recipe, 20, 3)
    assert [len(rows) for rows in found] == [6, 6, 6, 2]
    assert sorted(torch.cat(found).tolist()) == list(range(20))
    assert all(torch.equal(a, b) for a, b in zip(found, batches(recipe, 20, 3), strict=True))
    assert not torch.equal(found[0], batches(recipe, 20, 4)[0])


def test_fixed_batches_keep_their_trajectories_and_change_their_order():
    recipe = Recipe(epochs=1, batch_size=5, fixed_batches=True)
    table = [list(range(first, first + 5)) for first in range(0, 20, 5)]
    orders = [[rows.tolist() for rows in batches(recipe, 20, epoch)] for epoch in range(8)]
    assert all(sorted(order) == table for order in orders)
    assert len({str(order) for order in orders}) > 1


def test_of_data_with_a_stride_only_kept_frames_are_asked(tmp_path):
    configuration = DatasetConfiguration("pluck", 4000, 5, steps=450, stride=9, count=20)
    dataset = load_dataset(configuration, tmp_path)
    data = TrainingData(dataset, CPU)
    batch = data.draw(Recipe(epochs=1, flip=False, steps_per_batch=7), ROWS, 450, 0)
    assert len(batch.frames) == 7 and not (batch.frames % 9).any() and int(batch.frames[-1]) <= 450
    torch.testing.assert_close(
        modal(dataset, batch.target), dataset.amplitudes[ROWS][:, batch.frames // 9].double(), rtol=1e-5, atol=1e-9
    )

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from engine.resonators.sine_transform import analysis_matrix
from engine.truth import ModalState, SplittingSolver
from training.configuration import DatasetConfiguration, Recipe
from training.data.batches import Batch, TrainingData, batches
from training.data.dataset import START_EVERY, Dataset, load_dataset

CPU = torch.device("cpu")
ROWS = torch.arange(16)
PLAIN = Recipe(epochs=1, flip=False, steps_per_batch=0)


def modal(dataset: Dataset, displacement: torch.Tensor) -> torch.Tensor:
    """Amplitudes in m of normalised displacement."""
    c = dataset.configuration
    return displacement.double() @ analysis_matrix(c.grid_points, c.modes) * dataset.scale_m


def assert_is_a_motion(dataset: Dataset, batch: Batch) -> None:
    """What the batch holds is what the solver makes of its first frame and velocity."""
    c = dataset.configuration
    assert batch.second is not None
    state = ModalState(modal(dataset, batch.initial), modal(dataset, batch.second) * c.rate_hz)
    truth = SplittingSolver(c.resonator, c.rate_hz).solve(state, int(batch.frames[-1]))
    torch.testing.assert_close(modal(dataset, batch.target), truth[:, batch.frames], rtol=1e-4, atol=2e-8)


def test_all_frames_of_the_horizon_are_the_data(small_dataset: Dataset) -> None:
    data = TrainingData(small_dataset, 400, "displacement", CPU)
    batch = data.draw(PLAIN, ROWS, 120, 0)
    assert data.count == 16
    assert torch.equal(batch.frames, torch.arange(1, 121))
    assert batch.second is None
    torch.testing.assert_close(
        modal(small_dataset, batch.target), small_dataset.amplitudes[:16, 1:121].double(), rtol=1e-5, atol=1e-9
    )


def test_random_frames_cover_the_horizon_in_order(small_dataset: Dataset) -> None:
    data = TrainingData(small_dataset, 400, "displacement", CPU)
    recipe = Recipe(epochs=1, steps_per_batch=20)
    first, second = (data.draw(recipe, ROWS, 400, iteration).frames for iteration in (0, 1))
    assert not torch.equal(first, second)
    for frames in (first, second):
        assert torch.equal((frames - 1) // 20, torch.arange(20))


@pytest.mark.parametrize("flip", [False, True])
def test_a_start_within_a_motion_goes_on_as_the_physics_does(small_dataset: Dataset, flip: bool) -> None:
    data = TrainingData(small_dataset, 400, "displacement_velocity", CPU)
    recipe = Recipe(epochs=1, flip=flip, steps_per_batch=0, random_start=True)
    batch = data.draw(recipe, ROWS, 100, 0)
    assert batch.second is not None
    moving = batch.second.abs().amax(1) > 0
    assert 0 < int(moving.sum()) < 16  # one start in four is at rest
    assert_is_a_motion(small_dataset, batch)


def test_the_whole_horizon_starts_at_rest(small_dataset: Dataset) -> None:
    data = TrainingData(small_dataset, 450, "displacement_velocity", CPU)
    batch = data.draw(Recipe(epochs=1, random_start=True), ROWS, 450 - START_EVERY // 2, 0)
    assert batch.second is not None and not batch.second.any()


def test_an_epoch_holds_every_trajectory_once_and_repeats_by_its_number() -> None:
    recipe = Recipe(epochs=1, batch_size=6)
    found = batches(recipe, 20, 3)
    assert [len(rows) for rows in found] == [6, 6, 6, 2]
    assert sorted(torch.cat(found).tolist()) == list(range(20))
    assert all(torch.equal(a, b) for a, b in zip(found, batches(recipe, 20, 3), strict=True))
    assert not torch.equal(found[0], batches(recipe, 20, 4)[0])


def test_two_frames_are_refused(small_dataset: Dataset) -> None:
    with pytest.raises(ValueError, match="choose 'displacement_velocity'"):
        TrainingData(small_dataset, 400, "two_frames", CPU)


def test_of_data_with_a_stride_only_kept_frames_are_asked(tmp_path: Path) -> None:
    configuration = DatasetConfiguration("pluck", 4000, 5, steps=450, stride=9, count=20)
    dataset = load_dataset(configuration, tmp_path)
    data = TrainingData(dataset, 450, "displacement_velocity", CPU)
    batch = data.draw(Recipe(epochs=1, flip=False, steps_per_batch=7), ROWS, 450, 0)
    assert len(batch.frames) == 7 and not (batch.frames % 9).any() and int(batch.frames[-1]) <= 450
    assert_is_a_motion(dataset, batch)

"""What an encoder is told."""

import pytest
import torch

from engine.models.inputs import input_size, join_input


def test_the_second_array_follows_the_displacement() -> None:
    displacement, second = torch.zeros(2, 5), torch.ones(2, 5)
    assert join_input("displacement", displacement, None) is displacement
    assert input_size("displacement", 5) == 5
    for kind in ("displacement_velocity", "two_frames"):
        assert torch.equal(join_input(kind, displacement, second), torch.cat([displacement, second], 1))
        assert input_size(kind, 5) == 10


def test_a_wrong_second_array_is_told() -> None:
    displacement = torch.zeros(2, 5)
    with pytest.raises(ValueError, match="'displacement' takes no second array"):
        join_input("displacement", displacement, displacement)
    with pytest.raises(ValueError, match="'displacement_velocity' needs the velocity"):
        join_input("displacement_velocity", displacement, None)
    with pytest.raises(ValueError, match="'two_frames' needs the frame before"):
        join_input("two_frames", displacement, None)
    with pytest.raises(ValueError, match=r"the frame before has shape \(1, 5\), the displacement \(2, 5\)"):
        join_input("two_frames", displacement, displacement[:1])

"""The table of parameters: values, steps and words."""

from __future__ import annotations

import pytest

from app.shared.parameters import OF_CHOICES, OF_INSTRUMENTS, Parameter


@pytest.mark.parametrize("id", [id for id, each in OF_INSTRUMENTS.items() if each.words])
def test_each_whole_value_has_its_word(id: str) -> None:
    parameter = OF_INSTRUMENTS[id]
    low, high = parameter.limits
    assert parameter.whole
    assert len(set(parameter.words)) == len(parameter.words) == high - low + 1
    assert [parameter.shown(low + step) for step in range(len(parameter.words))] == list(parameter.words)
    assert all(" " not in word for word in parameter.words)  # plug-ins keep them with spaces between


@pytest.mark.parametrize("parameter", {**OF_INSTRUMENTS, **OF_CHOICES}.values(), ids=lambda parameter: parameter.id)
def test_a_knob_goes_through_its_whole_range_and_back(parameter: Parameter) -> None:
    low, high = parameter.limits
    values = [parameter.value(share / 10) for share in range(11)]
    assert (values[0], values[-1]) == (low, pytest.approx(high))
    assert values == sorted(set(values))
    assert [parameter.share(value) for value in values] == pytest.approx([share / 10 for share in range(11)])
    assert (parameter.value(-1), parameter.value(2)) == (pytest.approx(low), pytest.approx(high))
    assert parameter.stepped(values[5], -1) < values[5] < parameter.stepped(values[5], 1)
    assert parameter.stepped(high, 5) == high
    step = parameter.stepped(parameter.default, -1)
    assert parameter.default == low or parameter.stepped(step, 1) == pytest.approx(parameter.default)

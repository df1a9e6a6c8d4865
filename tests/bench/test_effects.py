from __future__ import annotations

import pytest

from tests.bench import effects


def test_bench_effects_reports_what_each_costs(bench, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("SECONDS", 0.2), ("FILLING_S", 0.1), ("REPEATS", 1)):
        monkeypatch.setattr(effects, name, value)
    found = bench("effects")["effects"]
    assert [cost["name"] for cost in found] == [*effects.CHOICES, f"{effects.EXCHANGED}, exchanged"]
    assert all(cost[name] > 0 for cost in found for name in ("worst_us", "set_ms", "first_ms"))
    assert found[0]["response_s"] == pytest.approx(0.35, abs=0.01)

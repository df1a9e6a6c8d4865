from __future__ import annotations

from importlib.util import find_spec

import pytest

from tests.bench import plugin


@pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang, the extra [plugin]")
def test_bench_plugin_reports_voices_of_plugin_and_app(bench, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("INSTRUMENTS", ("classical_guitar",)), ("NOTES", 2), ("ROUNDS", 1)):
        monkeypatch.setattr(plugin, name, value)
    (found,) = bench("plugin")["plugins"]
    assert found["instrument"] == "classical_guitar"
    assert found["notes"] == 2
    assert found["modes"] > 20
    assert found["app_faster"] > 1
    assert found["plugin_faster"] > 1
    assert found["met"] == (found["plugin_faster"] >= found["app_faster"])

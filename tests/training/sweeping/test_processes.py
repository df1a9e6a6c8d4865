from __future__ import annotations

import pytest

from training.sweeping import processes as module
from training.sweeping.processes import Layout, fitted


def test_workers_fit_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: set(range(8)), raising=False)
    monkeypatch.setattr(module, "_memory_bytes", lambda: 20 * 2**30)
    assert len(fitted(100).environments) == 2
    assert len(fitted(100, workers=5).environments) == 5
    monkeypatch.setattr(module, "_memory_bytes", lambda: 2**40)
    found = fitted(100)
    assert (found.device, found.threads, len(found.environments)) == ("cpu", 1, 8)
    assert found.environments[0]["OMP_NUM_THREADS"] == "1"
    assert len(fitted(3).environments) == 3
    assert len(fitted(100, threads=4).environments) == 2
    assert len(fitted(100, threads=16).environments) == 1
    assert len(fitted(100, workers=20).environments) == 20
    with pytest.raises(ValueError, match="no CUDA device can be used here"):
        fitted(1, device="cuda")


@pytest.mark.parametrize(("visible", "gpus"), [(None, ["0", "1"]), ("3, MIG-7", ["3", "MIG-7"])])
def test_several_runs_share_a_gpu(monkeypatch: pytest.MonkeyPatch, visible: str | None, gpus: list[str]) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: True)
    monkeypatch.setattr("torch.cuda.device_count", lambda: 2)
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: set(range(12)), raising=False)
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    if visible:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", visible)

    def places(layout: Layout) -> list[str]:
        return [environment["CUDA_VISIBLE_DEVICES"] for environment in layout.environments]

    assert places(fitted(100)) == gpus
    packed = fitted(100, per_device=3)
    assert (packed.device, packed.threads) == ("cuda", 2)
    assert places(packed) == gpus * 3
    assert places(fitted(3, per_device=3)) == [*gpus, gpus[0]]  # the few are spread
    assert fitted(100, device="cpu").device == "cpu"

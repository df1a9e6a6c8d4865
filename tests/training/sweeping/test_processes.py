import pytest

from training.sweeping.processes import Layout, fitted


def set_machine(monkeypatch: pytest.MonkeyPatch, cores: int, memory_bytes: int, gpus: int = 0) -> None:
    sizes = {"SC_PHYS_PAGES": memory_bytes, "SC_PAGE_SIZE": 1}
    monkeypatch.setattr("os.sysconf", sizes.__getitem__, raising=False)
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: set(range(cores)), raising=False)
    monkeypatch.setattr("torch.cuda.is_available", lambda: gpus > 0)
    monkeypatch.setattr("torch.cuda.device_count", lambda: gpus)


@pytest.mark.parametrize(
    ("memory_bytes", "tasks", "options", "count"),
    [
        (20 * 2**30, 100, {}, 2),
        (20 * 2**30, 100, {"workers": 5}, 5),
        (2**40, 100, {}, 8),
        (2**40, 3, {}, 3),
        (2**40, 100, {"threads": 4}, 2),
        (2**40, 100, {"threads": 16}, 1),
        (2**40, 100, {"workers": 20}, 20),
    ],
)
def test_workers_fit_the_machine(monkeypatch, memory_bytes, tasks, options, count):
    set_machine(monkeypatch, 8, memory_bytes)
    found, threads = fitted(tasks, **options), options.get("threads", 1)
    assert (found.device, found.threads, len(found.environments)) == ("cpu", threads, count)
    assert {environment["OMP_NUM_THREADS"] for environment in found.environments} == {str(threads)}
    with pytest.raises(ValueError, match="no CUDA device can be used here"):
        fitted(1, device="cuda")


@pytest.mark.parametrize(("visible", "gpus"), [(None, ["0", "1"]), ("3, MIG-7", ["3", "MIG-7"])])
def test_several_runs_share_a_gpu(monkeypatch, visible, gpus):
    set_machine(monkeypatch, 12, 2**40, gpus=2)
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

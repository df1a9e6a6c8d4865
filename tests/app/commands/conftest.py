from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from app.commands.cli import main
from engine.excitation import displacement


@dataclass(frozen=True)
class Outcome:
    """What a command line did."""

    status: int
    out: str
    err: str

    @property
    def failure(self) -> str:
        """The one line of a failure."""
        lines = self.err.splitlines()
        assert self.status == 1
        assert len(lines) == 1, self.err
        assert self.out == ""
        return lines[0]

    @property
    def usage(self) -> str:
        """The message of bad usage."""
        assert self.status == 2
        assert self.out == ""
        return self.err


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    """Runs a command line in this process, without the lines of progress that a slow machine prints."""
    monkeypatch.setattr("training.cli.console._Lines", lambda what, every_s: lambda *_, **__: None)

    def run(*words: object) -> Outcome:
        capsys.readouterr()
        status = main([str(word) for word in words])
        return Outcome(status, *capsys.readouterr())

    return run


FullDisk = Callable[[int], AbstractContextManager[None]]


@pytest.fixture
def full_disk() -> FullDisk:
    """Within its block no file can be larger than some bytes: the system fails the write that would make it so."""
    resource = pytest.importorskip("resource", reason="needs POSIX limits")

    @contextmanager
    def full(bytes_left: int) -> Iterator[None]:
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_left, before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return full


@pytest.fixture
def u0(tmp_path: Path) -> Path:
    """Three plucks (3, 101) in m."""
    plucks = [displacement("gaussian", 0.3 + 0.1 * i, 0.05, (2 + i) * 1e-3, 101) for i in range(3)]
    path = tmp_path / "u0.npy"
    np.save(path, np.stack(plucks))
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An empty folder for results."""
    path = tmp_path / "results"
    path.mkdir()
    return path

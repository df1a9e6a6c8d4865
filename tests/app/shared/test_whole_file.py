from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from engine.whole_file import WriteError, result_file


def test_the_file_appears_when_the_block_ends(tmp_path: Path) -> None:
    path = tmp_path / "out.bin"
    with result_file(path) as file:
        file.write(b"12")
        assert not path.exists()
        file.write(b"34")
    assert path.read_bytes() == b"1234"
    assert list(tmp_path.iterdir()) == [path]


def test_after_an_error_the_old_file_stays_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "out.bin"
    path.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt), result_file(path) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_reported_with_the_remedy(tmp_path: Path) -> None:
    path = tmp_path / "out.bin"
    with (
        pytest.raises(WriteError, match=r"out\.bin: cannot be written \(No space left.*\); free some space"),
        result_file(path),
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "setgid"), reason="needs POSIX limits")
def test_a_write_that_the_system_stops_half_way_leaves_nothing(tmp_path: Path) -> None:
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
    try:
        with pytest.raises(WriteError, match="cannot be written"), result_file(tmp_path / "out.bin") as file:
            file.write(bytes(100_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_reported_before_the_work(tmp_path: Path) -> None:
    with (
        pytest.raises(WriteError, match="make the folder first"),
        result_file(tmp_path / "missing" / "out.bin"),
    ):
        pytest.fail("the block must not run")


def test_a_folder_that_is_a_file_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(WriteError, match="cannot be written"), result_file(tmp_path / "file" / "out.bin"):
        pytest.fail("the block must not run")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_an_unwritable_folder_is_reported(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(WriteError, match="a folder that you may write to"), result_file(tmp_path / "out.bin"):
        pytest.fail("the block must not run")


def test_a_folder_is_never_replaced(tmp_path: Path) -> None:
    with pytest.raises(WriteError, match="not a file that can be replaced"), result_file(tmp_path):
        pytest.fail("the block must not run")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_device_is_never_replaced() -> None:
    with pytest.raises(WriteError, match="not a file that can be replaced"), result_file(Path("/dev/full")):
        pytest.fail("the block must not run")
    assert Path("/dev/full").is_char_device()


def test_a_link_stays_and_its_target_is_replaced(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_bytes(b"old")
    try:
        link.symlink_to(target)
    except OSError:
        pytest.skip("links are not allowed here")
    with result_file(link) as file:
        file.write(b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"

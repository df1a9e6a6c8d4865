"""Files that a user asked for: whole or not at all, through links, and the remedy where one cannot be written."""

import errno
import os
from pathlib import Path

import pytest

from engine.whole_file import WriteError, result_file


def test_the_file_appears_when_the_block_ends_and_a_link_to_it_stays(tmp_path):
    path, link = tmp_path / "out.bin", tmp_path / "link"
    with result_file(path) as file:
        file.write(b"12")
        assert not path.exists()
        file.write(b"34")
    assert path.read_bytes() == b"1234"
    try:
        link.symlink_to(path)
    except OSError:
        pytest.skip("links are not allowed here")
    with result_file(link) as file:
        file.write(b"new")
    assert link.is_symlink() and path.read_bytes() == b"new"
    assert set(tmp_path.iterdir()) == {path, link}


@pytest.mark.parametrize(
    ("error", "raised", "words"),
    [
        (KeyboardInterrupt(), KeyboardInterrupt, "^$"),
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), WriteError, r"out\.bin: cannot be .* \(No space.*; free"),
    ],
)
def test_after_an_error_the_old_file_stays_and_nothing_else(tmp_path, error, raised, words):
    path = tmp_path / "out.bin"
    path.write_bytes(b"old")
    with pytest.raises(raised, match=words), result_file(path) as file:
        file.write(b"half")
        raise error
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(not hasattr(os, "setgid"), reason="needs POSIX limits")
def test_a_write_that_the_system_stops_half_way_leaves_nothing(tmp_path):
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
    try:
        with pytest.raises(WriteError, match="cannot be written"), result_file(tmp_path / "out.bin") as file:
            file.write(bytes(100_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("missing/out.bin", "make the folder first"),
        ("file/out.bin", "cannot be written"),
        ("", "not a file that can be replaced"),
        ("locked/out.bin", "a folder that you may write to"),
        ("/dev/full", "not a file that can be replaced"),
    ],
)
def test_where_nothing_can_be_written_the_block_does_not_run(tmp_path, place, words):
    if place.startswith("locked") and (not hasattr(os, "geteuid") or os.geteuid() == 0):
        pytest.skip("root may write anywhere")
    if place.startswith("/dev") and not Path(place).exists():
        pytest.skip("needs /dev/full")
    (tmp_path / "file").touch()
    (tmp_path / "locked").mkdir(0o500)
    with pytest.raises(WriteError, match=words), result_file(tmp_path / place):
        pytest.fail("the block must not run")
    assert not place.startswith("/dev") or Path(place).is_char_device()

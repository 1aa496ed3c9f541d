"""A file is written whole or not at all: what was there before stays where a disk is full."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from missions.files import write_whole


@contextmanager
def room_for(count: int) -> Iterator[None]:
    """Let no file of this process grow beyond so many bytes, as a full disk does."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (count, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_leaves_the_file_of_before_and_no_half_of_a_new_one(tmp_path: Path) -> None:
    path = tmp_path / "line.geojson"
    path.write_bytes(b"before")
    with room_for(100), pytest.raises(OSError, match="File too large"):
        write_whole(path, bytes(1000))
    assert path.read_bytes() == b"before"
    assert [one.name for one in tmp_path.iterdir()] == ["line.geojson"]


def test_a_link_stays_a_link_and_rights_stay_as_they_were(tmp_path: Path) -> None:
    file, link = tmp_path / "kept.json", tmp_path / "latest.json"
    file.write_bytes(b"before")
    file.chmod(0o640)
    link.symlink_to(file)
    write_whole(link, b"after")
    assert (link.is_symlink(), file.read_bytes(), file.stat().st_mode & 0o777) == (True, b"after", 0o640)


def test_what_is_no_file_is_written_to_as_it_is() -> None:
    write_whole(Path("/dev/null"), b"for nobody")
    assert not Path("/dev/null").is_file()

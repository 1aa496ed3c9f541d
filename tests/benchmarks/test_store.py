"""Results on disk: an interrupted run resumes where it stopped, with its original settings."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.errors import BenchError
from benchmarks.store import Json, Store


def test_what_is_there_is_not_made_again(tmp_path: Path) -> None:
    made = []

    def make() -> Json:
        made.append(1)
        return {"value": len(made), "routes": ((1, 2), (3,))}

    first = Store(tmp_path / "results").find_or_make("one", {"seconds": 2.0}, make)
    again = Store(tmp_path / "results").find_or_make("one", {"seconds": 2.0}, make)
    assert first == again == {"value": 1, "routes": [[1, 2], [3]]}


def test_other_settings_are_another_result(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.keep("one", {"seconds": 2.0}, {"value": 1})
    assert store.find_result("one", {"seconds": 3.0}) is None
    assert store.find_result("one", {"seconds": 2.0}) == {"value": 1}


def test_settings_are_compared_as_they_are_written(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.keep("one", {"routes": ((1,), ())}, {"value": 1})
    assert store.find_result("one", {"routes": ((1,), ())}) == {"value": 1}


def test_half_a_file_is_no_result(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.keep("one", {}, {"value": 1})
    path = tmp_path / "one.json"
    path.write_text(path.read_text(encoding="utf-8")[:20], encoding="utf-8")
    assert store.find_result("one", {}) is None


def test_a_fresh_store_has_forgotten(tmp_path: Path) -> None:
    Store(tmp_path).keep("one", {}, {"value": 1})
    assert Store(tmp_path, fresh=True).find_result("one", {}) is None


def test_a_directory_that_cannot_be_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("", encoding="utf-8")
    with pytest.raises(BenchError, match="expected a directory"):
        Store(file / "results")

"""Truths on disk."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from simulator.truth import Truth, TruthWriter, read_truths


def test_truths_read_back_and_a_cut_off_line_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "truth.jsonl"
    truths = (Truth("uav1", "fault uav1:crash@40%", 12.5, 1.7e9), Truth("uav1", "crash", 14.0, 1.7e9 + 1.5))
    with closing(TruthWriter(path)) as write:
        write(truths[0])
        # Whole after every line: readable while it is being written.
        assert read_truths(path) == truths[:1]
        write(truths[1])
    with path.open("a") as file:
        file.write('{"vehicle": "ua')
    assert read_truths(path) == truths

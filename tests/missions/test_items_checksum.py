"""PX4's checksum of a list: what counts; the real one is asked in tests/sitl/test_transfers.py."""

from __future__ import annotations

from dataclasses import replace

from missions import MissionItem, compute_list_checksum

ITEMS = tuple(
    MissionItem(seq, 6, 16, 1.0, 2.0, 0.0, float("nan"), 496_000_000 + seq, 156_000_000, 30.0) for seq in range(3)
)


def test_every_field_but_current_counts_and_so_does_the_order() -> None:
    whole = compute_list_checksum(ITEMS)
    assert compute_list_checksum((replace(ITEMS[0], current=True), *ITEMS[1:])) == whole
    for change in (
        {"frame": 3},
        {"command": 21},
        {"param2": 3.0},
        {"x": 1},
        {"y": 1},
        {"z": 31.0},
        {"autocontinue": False},
    ):
        assert compute_list_checksum((replace(ITEMS[0], **change), *ITEMS[1:])) != whole
    assert compute_list_checksum(ITEMS[::-1]) != whole
    assert compute_list_checksum(()) == 0

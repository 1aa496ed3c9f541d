"""Two vehicles with one system id, distinguished by their clocks and positions."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import pytest

from executor.core.state.link_quality import DuplicateIdWatch, ReportedPosition, add_reported_position

A_DEGREE_M = 111_320.0
Told = tuple[float, float, float]
"""When it came, its time since boot, metres north."""


def followed(told: Iterable[Told], *, stands: bool = False) -> DuplicateIdWatch:
    known = DuplicateIdWatch()
    for at_s, boot_s, north_m in told:
        position = ReportedPosition(at_s, boot_s, 50.0 + north_m / A_DEGREE_M, 13.0)
        known = add_reported_position(known, position, stands=stands)
    return known


def merged(*vehicles: Callable[[float], tuple[float, float]], seconds: int = 20) -> list[Told]:
    """Return what vehicles say in turn, five times a second, as (time since boot, metres north) of each moment."""
    moments = [0.2 * number for number in range(5 * seconds)]
    return [(at_s, *one(at_s)) for at_s in moments for one in vehicles]


def test_two_clocks_are_two_vehicles() -> None:
    assert followed(merged(lambda s: (s, 4.0 * s), lambda s: (500.0 + s, 3.0 * s))).are_two


def test_two_places_are_two_vehicles_that_booted_together() -> None:
    assert followed(merged(lambda s: (s, 4.0 * s), lambda s: (s + 0.05, 900.0))).are_two


@pytest.mark.parametrize("lot", [1, 3])
def test_two_that_stand_side_by_side_and_booted_together_are_two(lot: int) -> None:
    """A radio brings what each of them says in lots."""
    pair = merged(lambda s: (s, 0.2 * (s % 1.0)), lambda s: (s + 0.1, 5.0))
    told = [
        one for at in range(0, len(pair), 2 * lot) for which in (0, 1) for one in pair[at + which : at + 2 * lot : 2]
    ]
    assert followed(told, stands=True).are_two
    assert not followed(merged(lambda s: (s, 0.8 * (s % 2.0))), stands=True).are_two, "one that drifts"
    assert not followed(merged(lambda s: (s, 6.0 * (5.0 < s < 6.0))), stands=True).are_two, "one that jumps once"


@pytest.mark.parametrize("slower", [1, 5, 10])
def test_one_of_them_may_speak_seldom(slower: int) -> None:
    told = merged(lambda s: (s, 4.0 * s), lambda s: (500.0 + s, 0.0), seconds=60)
    assert followed(one for number, one in enumerate(told) if number % 2 == 0 or number % (2 * slower) == 1).are_two


ONE: dict[str, list[Told]] = {
    "a flight": merged(lambda s: (s, 12.0 * s)),
    "a reboot": merged(lambda s: (s if s < 10 else s - 10.0, 4.0 * s)),
    "reboots": merged(lambda s: (s % 3.0, 4.0 * s)),
    "a copy by a radio that is 2 s late": sorted(
        [*merged(lambda s: (s, 4.0 * s)), *((at_s + 2.0, boot_s, north_m) for at_s, boot_s, north_m
                                            in merged(lambda s: (s, 4.0 * s)))]
    ),
    "positions that were held back": [(max(at_s, 8.0 * (at_s >= 3.0)), boot_s, north_m) for at_s, boot_s, north_m
                                      in merged(lambda s: (s, 4.0 * s))],
    "frames that come as a busy computer reads them": [
        (at_s + 8.0 * (number % 3 == 1), boot_s, north_m)
        for number, (at_s, boot_s, north_m) in enumerate(merged(lambda s: (s, 4.0 * s), seconds=120))
    ],
    "a jump and back": merged(lambda s: (s, 4.0 * s + 400.0 * (5.0 < s < 6.0))),
    "silences": [one for one in merged(lambda s: (s, 4.0 * s), seconds=300) if one[0] % 40.0 < 10.0],
}  # fmt: skip


@pytest.mark.parametrize("told", ONE.values(), ids=ONE)
def test_one_vehicle_is_one(told: list[Told]) -> None:
    assert not followed(told).are_two

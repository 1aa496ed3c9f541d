"""Flights with cameras: pictures prove the spans, lost messages are requested again, unseen assets are flown
again, and a camera that fails is found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Any

import pytest

from executor.core.interface.intents import Action, Outcome
from tests.stories.eyes import MAVLINK, WIRED, Eyes, Table
from tests.stories.story import Do, Moment, Routes, Story, When, asks, first, on_segment, share, told

LOOPTIME = pytest.mark.looptime(noop_cycles=2)
DIALECTS = ("ardupilot", "px4")
TWO: Routes = {"uav1": (0, 2), "uav2": (4, 6)}
FOUR: Routes = {"uav1": (0, 2, 4), "uav2": (6, 8)}


def half(*choices: Sequence[Any]) -> list[Any]:
    """Return every case, half of them for `./scripts/stories`: the other half has every pair of choices."""
    cases = product(*map(enumerate, choices))
    return [
        pytest.param(*(value for _, value in case), marks=pytest.mark.campaign if sum(n for n, _ in case) % 2 else ())
        for case in cases
    ]


def story(*moments: Moment, fleet: Routes = TWO, **tables: dict[str, object]) -> Story:
    return Story("pictures", moments, fleet=fleet, tables=tables)


def lines(sky: Eyes) -> list[str]:
    return [say.text for _, say in sky.said]


@pytest.mark.asyncio
@LOOPTIME
@pytest.mark.parametrize("autopilot", DIALECTS)
@pytest.mark.parametrize("camera", [MAVLINK, WIRED], ids=["mavlink", "wired"])
async def test_each_picture_is_known_once_with_its_span(autopilot: str, camera: Table) -> None:
    sky = Eyes(story(), autopilot, [camera])
    flown = await sky.fly()
    assert set(flown.inspected) == flown.wanted, lines(sky)
    for name, own in TWO.items():
        known = sky.pictures(name)
        assert len(known) == len(sky.shots[name]) == len({one.sequence for one in known})
        assert {one.segment for one in known} == {visit >> 1 for visit in own}
        assert [one.flaw for one in known if one.flaw] == []
        for segment in {one.segment for one in known}:
            places = sorted(one.along_m or 0.0 for one in known if one.segment == segment)
            # 100 m, one every ten metres; one at the pylon may be taken for the span before.
            assert max(b - a for a, b in zip([0.0, *places], [*places, 100.0], strict=True)) < 12.5


@pytest.mark.asyncio
@LOOPTIME
@pytest.mark.parametrize("autopilot", DIALECTS)
async def test_words_that_are_lost_are_asked_for_again(autopilot: str) -> None:
    sky = Eyes(story(told(share("uav1", 0.01), "uav1:camera-loss=0.4")), autopilot)
    flown = await sky.fly()
    assert set(flown.inspected) == flown.wanted, lines(sky)
    assert {one.sequence for one in sky.pictures("uav1")} == {shot.number - 1 for shot in sky.shots["uav1"]}
    assert sky.state.coverage.not_seen == {}
    assert flown.solver_asked == 0


@pytest.mark.asyncio
@LOOPTIME
@pytest.mark.parametrize("autopilot", DIALECTS)
async def test_a_re_plan_in_flight_neither_loses_nor_doubles_a_picture(autopilot: str) -> None:
    crash = told(on_segment("uav2"), "uav2:crash")
    sky = Eyes(story(crash), autopilot)
    flown = await sky.fly()
    assert set(flown.inspected) == flown.wanted, lines(sky)
    shown = [one.segment for one in sky.pictures("uav1")]
    for segment in range(4):
        assert shown.count(segment) in {9, 10}, (segment, shown)  # each once, also where its mission changed meanwhile


FAULTS = (
    ("camera-silent", "no picture for", MAVLINK),
    ("camera-mute", "no picture reported", MAVLINK),
    ("card-full", "its card is full", MAVLINK),
    ("gimbal-stuck", "its gimbal points at", MAVLINK),
)
WIRED_FAULT = ("camera-silent", "no picture for", WIRED)


@pytest.mark.asyncio
@LOOPTIME
@pytest.mark.parametrize(
    ("autopilot", "then", "fails"),
    [
        *half(DIALECTS, ("home", "on"), FAULTS),
        # Only ArduPilot says more of a wired camera than that it was triggered.
        *(("ardupilot", then, WIRED_FAULT) for then in ("home", "on")),
    ],
)
async def test_a_payload_that_fails_is_found_and_others_look(
    autopilot: str, then: str, fails: tuple[str, str, Table]
) -> None:
    fault, words, camera = fails
    # Before it sets out on its second span: it has flown one and seen it. A gimbal sticks before it first turns.
    at = share("uav1", 0.01) if fault == "gimbal-stuck" else on_segment("uav1", 2)
    sky = Eyes(story(told(at, f"uav1:{fault}"), fleet=FOUR, faults={"camera": then}), autopilot, [camera])
    flown = await sky.fly()
    said = lines(sky)
    assert any(line.startswith("uav1") and words in line for line in said), said
    assert set(flown.inspected) == flown.wanted, said
    first = set() if fault == "gimbal-stuck" else {0}
    assert {segment for segment, by in flown.inspected.items() if by == "uav1"} == first
    faulty = sky.state.vehicles["uav1"].fault
    assert (faulty is not None) == (then == "home")


AROUND = {"camera": "rgb", "of": "pylons", "pylons": ["*1"], "bearings_deg": [60, 120], "both_sides": True}


@pytest.mark.asyncio
@LOOPTIME
@pytest.mark.parametrize("autopilot", DIALECTS)
@pytest.mark.parametrize("camera", [MAVLINK, WIRED], ids=["mavlink", "wired"])
async def test_a_pylon_is_an_asset_of_its_own_with_its_viewpoints(autopilot: str, camera: Table) -> None:
    fleet: Routes = {"uav1": (0, 4), "uav2": (2,)}
    sky = Eyes(story(fleet=fleet), autopilot, [camera], [AROUND], pylons=3)
    flown = await sky.fly()
    assert sky.flight is not None
    names = [sky.flight.context.segment_name(segment) for segment in sorted(flown.wanted)]
    assert names[-1].startswith("pylon")
    assert set(flown.inspected) == flown.wanted, lines(sky)
    known = sky.pictures("uav1")
    assert [(one.segment, one.points, one.flaw) for one in known] == [(2, (number,), "") for number in range(4)]


BELOW = {**AROUND, "distance_m": 14, "heights_m": [-4, -12], "target_m": -6}
"""Insulators, from above and from below."""


@pytest.mark.asyncio
@LOOPTIME
@pytest.mark.parametrize(("autopilot", "camera", "roi"), half(DIALECTS, (MAVLINK, WIRED), (False, True)))
async def test_viewpoints_below_the_top_are_seen_from_where_they_were_asked_for(
    autopilot: str, camera: Table, roi: bool
) -> None:
    fleet: Routes = {"uav1": (0, 4), "uav2": (2,)}
    looks = {**BELOW, "roi": roi}
    sky = Eyes(
        story(fleet=fleet, inspection={"same_distance": True}), autopilot, [camera], [looks], pylons=3, tall=True
    )
    flown = await sky.fly()
    assert set(flown.inspected) == flown.wanted, lines(sky)
    known = sky.pictures("uav1")
    assert [(one.segment, one.points, one.flaw) for one in known] == [(2, (number,), "") for number in range(8)]
    shots = sky.shots["uav1"]
    assert [round(shot.up_m) for shot in shots] == [26, 18, 18, 26, 26, 18, 18, 26]
    if roi or camera is MAVLINK:  # it looks at the pylon, by its gimbal or with its nose
        pad = sky.flight.context.setup.pad_of("uav1")  # type: ignore[union-attr]
        for shot in shots:
            to_pylon = math.degrees(math.atan2(200.0 - shot.east_m - pad.east_m, -shot.north_m - pad.north_m))
            assert abs((shot.yaw_deg - to_pylon + 180) % 360 - 180) < 8, (shot, to_pylon)


def counts(segment: int) -> When:
    """When a segment counts."""
    return lambda world: segment in world.state.coverage.inspected


def again(*assets: int | str) -> Do:
    return asks(Action.PROVE, assets=assets)


@pytest.mark.asyncio
@LOOPTIME
@pytest.mark.parametrize("autopilot", DIALECTS)
async def test_a_span_with_a_rejected_picture_is_inspected_again(autopilot: str) -> None:
    moment = Moment(first(counts(0), on_segment("uav1", 2)), again("segment 0"))
    sky = Eyes(story(moment, fleet=FOUR), autopilot)
    flown = await sky.fly()
    said = lines(sky)
    assert "terminal asks: prove of 1 asset; segment 0 reopened for re-inspection" in said
    assert set(flown.inspected) == flown.wanted, said
    assert flown.solver_asked == 1, said
    shown = [one.segment for name in FOUR for one in sky.pictures(name) if not one.flaw]
    assert shown.count(0) >= 18
    assert all(shown.count(segment) <= 11 for segment in range(1, 5))
    [record] = [one for one in sky.state.crew.intents.values() if one.intent.action is Action.PROVE]
    assert (record.outcome, record.text) == (Outcome.DONE, "re-plan 1 is on board")
    assert sky.state.coverage.not_seen == {}


@pytest.mark.asyncio
@LOOPTIME
async def test_a_pylon_with_rejected_pictures_is_inspected_again() -> None:
    fleet: Routes = {"uav1": (4, 0), "uav2": (2,)}
    moment = Moment(counts(2), again("pylon p1"))
    sky = Eyes(story(moment, fleet=fleet), "ardupilot", [MAVLINK], [AROUND], pylons=3)
    flown = await sky.fly()
    assert set(flown.inspected) == flown.wanted, lines(sky)
    known = [one for name in fleet for one in sky.pictures(name) if one.segment == 2]
    assert sorted(one.points for one in known if not one.flaw) == [(0,), (0,), (1,), (1,), (2,), (2,), (3,), (3,)]


@pytest.mark.asyncio
@LOOPTIME
@pytest.mark.parametrize("autopilot", DIALECTS)
async def test_viewpoints_above_each_other_are_one_picture_from_the_layer(autopilot: str) -> None:
    fleet: Routes = {"uav1": (0, 2), "uav2": (4,)}
    told_so = story(fleet=fleet, inspection={"same_distance": True})
    sky = Eyes(told_so, autopilot, [MAVLINK], [BELOW], pylons=3, tall=True)
    flown = await sky.fly()
    assert set(flown.inspected) == flown.wanted, lines(sky)
    known = [(one.points, one.flaw) for one in sky.pictures("uav2")]
    assert known == [((0, 1), ""), ((2, 3), ""), ((4, 5), ""), ((6, 7), "")]
    assert len(sky.shots["uav2"]) == 4


AT_PYLONS = (
    ("camera-silent", "no picture of 6 viewpoints", MAVLINK),
    ("camera-mute", "no picture reported", MAVLINK),
    ("card-full", "its card is full", MAVLINK),
    ("gimbal-stuck", "its gimbal pointed elsewhere at 3 viewpoints", MAVLINK),
)
"""No camera takes a row of pictures there."""
WIRED_AT_PYLONS = ("camera-silent", "no picture of 6 viewpoints", WIRED)


@pytest.mark.asyncio
@LOOPTIME
# Only ArduPilot says more of a wired camera than that it was triggered.
@pytest.mark.parametrize(("autopilot", "fails"), [*half(DIALECTS, AT_PYLONS), ("ardupilot", WIRED_AT_PYLONS)])
async def test_a_payload_that_fails_at_pylons_is_found_too(autopilot: str, fails: tuple[str, str, Table]) -> None:
    fault, words, camera = fails
    around = {**AROUND, "pylons": ["*"]}
    fleet: Routes = {"uav1": (8, 10, 12, 14, 16), "uav2": (0, 2, 4, 6)}
    at = told(share("uav1", 0.3), f"uav1:{fault}")
    sky = Eyes(story(at, fleet=fleet), autopilot, [camera], [around], pylons=5)
    flown = await sky.fly()
    assert set(flown.inspected) == flown.wanted, lines(sky)
    assert any(line.startswith("uav1: payload, ") and words in line for line in lines(sky)), lines(sky)
    assert {segment for segment, by in flown.inspected.items() if by == "uav1"} == {4, 5}

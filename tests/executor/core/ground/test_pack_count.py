"""The charged packs of each base in flight, counted as the day's plan counts them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import pytest

from benchmarks.virtual_day import round_trip_state
from executor.core.context import Context, DayRules, PackRules
from executor.core.fleet_step import step
from executor.core.fleet_view import build_fleet_view
from executor.core.ground.pack_count import PackStock, count_packs, describe_packs
from executor.core.interface.events import IntentReceived
from executor.core.interface.intents import Action, Intent, IntentReason, Outcome
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import FlownSortie, PlannedSortie
from executor.core.state.vehicle_state import Stage
from missions import Pad
from planner.sorties import SortieBase
from tests.executor.builders import with_facts
from tests.executor.core.steps import flight_of
from tests.executor.core.vehicles import FLEET, NOW_S, flying
from tests.executor.runtime.turns_of_a_day import Crew, Day, DaySky, day_flown
from tests.stories.story import When, World, wants

LAUNCHED_S = NOW_S - 100.0
FULL = {f"P{number}": 100.0 for number in range(3, 9)}
Flown = tuple[float, float | None]


def day_with(packs: PackRules | None, *, until_s: float = 1000.0) -> Context:
    """Return a day whose vehicles share a base."""
    names = ("uav1", "uav2", "uav3")
    windows = dict.fromkeys(names, ((0.0, until_s),))
    rules = DayRules(0.0, dict.fromkeys(names, "west"), windows, packs={} if packs is None else {"west": packs})
    return replace(FLEET.context, day=rules)


def flown(
    *sorties: Sequence[Flown], stage: Stage = Stage.LANDED, asked_s: float | None = None, took_off: bool = True
) -> FleetState:
    """Return a flight of vehicles that flew sorties, by their seconds after the launch."""
    vehicles = []
    for number, own in enumerate(sorties, 1):
        rows = tuple(
            FlownSortie(index, "", LAUNCHED_S + begin, 100.0, None, ended_s=None if end is None else LAUNCHED_S + end)
            for index, (begin, end) in enumerate(own, 1)
        )
        one = flying(name=f"uav{number}", stage=stage, took_off=took_off)
        vehicles.append(one.with_turn(sorties=rows, asked_s=asked_s if number == 1 else None))
    return flight_of(*vehicles, launched_s=LAUNCHED_S)


@pytest.mark.parametrize(
    ("packs", "sorties", "found"),
    [
        (PackRules(3), (), (3, None, False)),
        (PackRules(3), (((0.0, 50.0),), ((0.0, 60.0),)), (1, None, False)),
        (PackRules(2), (((0.0, 50.0),), ((0.0, 60.0),)), (0, None, True)),
        (PackRules(2, 200.0), (((0.0, 50.0),), ((0.0, 60.0),)), (0, 250.0, False)),
        (PackRules(2, 30.0), (((0.0, 50.0),), ((0.0, 80.0),)), (1, 110.0, False)),
        (PackRules(2, 20.0), (((0.0, 30.0), (60.0, 70.0)), ((0.0, 80.0),)), (2, None, False)),
        (PackRules(2, 960.0), (((0.0, 50.0),), ((0.0, 60.0),)), (0, 1010.0, True)),
        (PackRules(1, 20.0), (((0.0, None),), ((0.0, 95.0),)), (0, 115.0, False)),
        (PackRules(0), (), (0, None, True)),
    ],
)
def test_packs_are_counted_from_the_sorties_flown(
    packs: PackRules, sorties: Sequence[Sequence[Flown]], found: tuple[int, float | None, bool]
) -> None:
    context, state = day_with(packs), flown(*sorties)
    assert count_packs(context, state, "uav1", NOW_S) == PackStock("west", *found)
    assert count_packs(context, round_trip_state(state), "uav1", NOW_S) == PackStock("west", *found)


def test_nothing_is_counted_before_the_launch_or_where_there_are_always_enough() -> None:
    assert count_packs(day_with(None), flown(), "uav1", NOW_S) is None
    assert count_packs(FLEET.context, flown(), "uav1", NOW_S) is None
    assert count_packs(day_with(PackRules(2)), with_facts(flown(), launched_s=None), "uav1", NOW_S) is None
    assert describe_packs(None) == ""


def test_the_pack_of_a_flying_vehicle_is_charged_again_while_there_is_time() -> None:
    aloft, context = flown(((0.0, None),), stage=Stage.FLYING), day_with(PackRules(1, 500.0))
    stock = count_packs(context, aloft, "uav2", NOW_S)
    assert stock == PackStock("west", 0, None, exhausted=False)
    assert describe_packs(stock) == "no charged pack is left at base west until one has landed and is charged"
    late = count_packs(context, aloft, "uav2", LAUNCHED_S + 501.0)
    assert late == PackStock("west", 0, None, exhausted=True)
    lost = count_packs(context, flown(((0.0, None),), stage=Stage.LOST), "uav2", NOW_S)
    assert lost == PackStock("west", 0, None, exhausted=True)


def test_a_vehicle_that_is_turned_around_has_its_pack_once() -> None:
    context = day_with(PackRules(3))
    turned = flown(((0.0, 50.0),), asked_s=NOW_S - 5.0)
    assert count_packs(context, turned, "uav2", NOW_S) == PackStock("west", 1, None, exhausted=False)
    failed = flown(((0.0, 50.0), (60.0, None)), took_off=False, asked_s=NOW_S - 5.0)
    assert count_packs(context, failed, "uav2", NOW_S) == PackStock("west", 1, None, exhausted=False)


@pytest.mark.parametrize(
    ("packs", "sorties", "charged", "counted_s", "found"),
    [
        (PackRules(3), (((0.0, 50.0),),), 5, 90.0, (5, None, False)),
        (PackRules(3), (((0.0, 50.0),),), 0, 90.0, (0, None, True)),
        (PackRules(3), (((0.0, 50.0),), ((60.0, 80.0),)), 4, 55.0, (3, None, False)),
        (PackRules(1, 100.0), (((0.0, 50.0),),), 0, 90.0, (0, 150.0, False)),
        (PackRules(1, 30.0), (((0.0, 50.0),),), 2, 90.0, (2, None, False)),
    ],
    ids=["more", "none is left", "one flew since", "one still charges", "one was charged before"],
)
def test_what_the_crew_counts_is_charged_from_then_on(
    packs: PackRules, sorties: Sequence[Sequence[Flown]], charged: int, counted_s: float,
    found: tuple[int, float | None, bool],
) -> None:  # fmt: skip
    context, state = day_with(packs), flown(*sorties)
    wish = Intent("a-1", Action.COUNT, None, "page", base="west", charged=charged)
    state, _ = step(context, state, IntentReceived(wish), LAUNCHED_S + counted_s)
    assert state.crew.intents["a-1"].outcome is Outcome.DONE
    assert count_packs(context, state, "uav1", NOW_S) == PackStock("west", *found)
    assert count_packs(context, round_trip_state(state), "uav1", NOW_S) == PackStock("west", *found)


def test_a_pack_that_was_in_a_vehicle_as_the_crew_counted_is_not_taken_again() -> None:
    context, state = day_with(PackRules(3)), flown(((0.0, 50.0),), asked_s=LAUNCHED_S + 60.0)
    wish = Intent("a-1", Action.COUNT, None, "page", base="west", charged=2)
    state, _ = step(context, state, IntentReceived(wish), LAUNCHED_S + 70.0)
    assert count_packs(context, state, "uav1", NOW_S) == PackStock("west", 2, None, exhausted=False)
    one = state.vehicles["uav1"]
    gone = one.with_turn(asked_s=None, sorties=(*one.turn.sorties, FlownSortie(2, "", LAUNCHED_S + 80.0, 100.0, None)))
    assert count_packs(context, state.put(gone), "uav1", NOW_S) == PackStock("west", 2, None, exhausted=False)
    other = state.vehicles["uav2"].with_turn(asked_s=LAUNCHED_S + 75.0)
    assert count_packs(context, state.put(gone).put(other), "uav1", NOW_S) == PackStock(
        "west", 1, None, exhausted=False
    )


def test_a_count_is_refused_where_packs_are_not_counted() -> None:
    wish = Intent("a-1", Action.COUNT, None, "page", base="west", charged=2)
    for context, asked, code in (
        (day_with(None), wish, IntentReason.PACKS_UNCOUNTED),
        (day_with(PackRules(3)), replace(wish, charged=None), IntentReason.PACKS_UNCOUNTED),
        (day_with(PackRules(3)), replace(wish, base="east"), IntentReason.BASE_UNKNOWN),
        (FLEET.context, wish, IntentReason.BASE_UNKNOWN),
    ):
        state, _ = step(context, flown(), IntentReceived(asked), NOW_S)
        assert state.crew.intents["a-1"].code is code
        assert not state.crew.counted_packs


def test_packs_are_counted_at_the_bases_where_sorties_begin_and_land() -> None:
    context, state = day_with(PackRules(2, 20.0)), flown(((0.0, 50.0),))
    assert context.day is not None
    pads = {"uav1": {"west": Pad("uav1", 0.0, 0.0, 450.0), "east": Pad("uav1", 900.0, 0.0, 450.0)}}
    packs = {"west": PackRules(2, 20.0), "east": PackRules(1, 20.0)}
    context = replace(context, day=replace(context.day, packs=packs, pads=pads))
    one = state.vehicles["uav1"]
    east = one.with_turn(base="east", sorties=(replace(one.turn.sorties[0], lands="east"),))
    assert count_packs(context, state.put(east), "uav1", NOW_S) == PackStock("east", 2, None, exhausted=False)
    assert count_packs(context, state.put(east), "uav2", NOW_S) == PackStock("west", 1, None, exhausted=False)
    turned = state.put(east.with_turn(asked_s=NOW_S - 1.0))
    assert count_packs(context, turned, "uav1", NOW_S) == PackStock("east", 1, None, exhausted=False)


def test_it_counts_as_the_planner_does() -> None:
    base, pool = SortieBase("west", 0.0, 3, 40.0), list[float]()
    sorties: tuple[Flown, ...] = ((0.0, 20.0), (5.0, 30.0), (10.0, 35.0), (65.0, 80.0), (72.0, 90.0))
    pool = base.list_packs(0, 0.0)
    for begin, end in sorties:
        assert min(pool) <= begin
        pool.remove(min(pool))
        pool.append((end or 0.0) + (base.recharge_s or 0.0))
    stock = count_packs(day_with(PackRules(3, 40.0)), flown(sorties), "uav1", NOW_S)
    assert stock is not None
    assert stock.charged == sum(ready_s <= 100.0 for ready_s in pool)
    assert stock.next_s == min(ready_s for ready_s in pool if ready_s > 100.0)


def test_the_strip_of_a_waiting_vehicle_says_what_is_left_at_its_base() -> None:
    context, state = day_with(PackRules(2, 500.0)), flown(((0.0, 50.0),), ((0.0, 60.0),))
    one = state.vehicles["uav1"].with_turn(ahead=(PlannedSortie((0,), 0.0),))
    state = state.put(replace(one, telemetry=replace(one.telemetry, heartbeat=None)))
    turn = next(row for row in build_fleet_view(context, state, NOW_S).vehicles if row.name == "uav1").turn
    assert turn is not None
    waits = "waiting for pack confirmation: sortie 2, 1 segment"
    packs = "no charged pack is left at base west until T+9:10"
    assert (turn.awaited, turn.text) == (True, f"{waits}; by the plan's count {packs}")


def landed(name: str) -> When:
    """When a vehicle is back from its first sortie."""

    def due(world: World) -> bool:
        one = world.state.vehicles[name]
        return one.is_on_base and not one.armed and bool(one.turn.sorties) and one.turn.sorties[-1].ended_s is not None

    return due


def told(sky: DaySky, pattern: str) -> list[str]:
    return [line for line in sky.lines if re.search(pattern, line)]


@pytest.mark.looptime(noop_cycles=2)
@pytest.mark.asyncio
async def test_the_count_shows_while_packs_are_left() -> None:
    day = Day(Crew(FULL), packs={"depot": PackRules(4)})
    sky, flown_day = await day_flown(day, "ardupilot")
    assert set(flown_day.inspected) == set(range(8)), "\n".join(sky.lines)
    waits = told(sky, "waiting for pack confirmation: sortie 2")
    assert [line.split("; ")[1] for line in waits] == [
        "by the plan's count 2 charged packs left at base depot",
        "by the plan's count 1 charged pack left at base depot",
    ]
    assert not told(sky, "no charged pack is left .* of its later sorties")
    assert [record.text.rsplit("; ", 1)[-1] for record in sky.asked] == [
        "by the plan's count 1 charged pack left at base depot",
        "by the plan's count no charged pack is left at base depot for the rest of the day",
    ]


@pytest.mark.looptime(noop_cycles=2)
@pytest.mark.asyncio
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_where_no_pack_will_be_charged_the_sorties_go_to_another_base(autopilot: str) -> None:
    day = Day(
        Crew(FULL, confirms=False), bases={"uav1": "west", "uav2": "east"},
        packs={"west": PackRules(1), "east": PackRules(9)}, later={"uav1": ((8,), (10,)), "uav2": ((12, 14),)},
        moments=(wants(landed("uav2"), Action.SWAP, "uav2"),),
    )  # fmt: skip
    sky, flown_day = await day_flown(day, autopilot)
    assert flown_day.ended_s is not None
    assert set(flown_day.inspected) == set(range(8)), "\n".join(sky.lines)
    assert [len(sky.state.vehicles[name].turn.sorties) for name in ("uav1", "uav2")] == [1, 2]
    assert len(told(sky, "no charged pack is left at base west for the rest of the day; 2 segments of its later")) == 1


@pytest.mark.looptime(noop_cycles=2)
@pytest.mark.asyncio
async def test_a_swap_that_the_count_has_no_pack_for_is_taken_with_one_warning() -> None:
    day = Day(
        Crew(FULL, confirms=False), first={"uav1": (0, 2)}, later={"uav1": ((4, 6),)}, segments=4,
        packs={"depot": PackRules(1, 400.0)},
        moments=(wants(landed("uav1"), Action.SWAP, "uav1"),),
    )  # fmt: skip
    sky, flown_day = await day_flown(day, "px4")
    assert set(flown_day.inspected) == set(range(4)), "\n".join(sky.lines)
    swaps = [
        one for one in sky.state.crew.intents.values() if one.intent.action is Action.SWAP and one.intent.confirmed
    ]
    assert {one.outcome for one in swaps} == {Outcome.DONE}, "\n".join(sky.lines)
    assert len(told(sky, r"^uav1: by the plan's count no charged pack is left at base depot until T\+\d+:\d\d$")) == 1


@pytest.mark.looptime(noop_cycles=2)
@pytest.mark.asyncio
async def test_a_day_ends_that_no_pack_is_left_for() -> None:
    day = Day(Crew(FULL, confirms=False), packs={"depot": PackRules(2)})
    sky, flown_day = await day_flown(day, "ardupilot")
    assert flown_day.ended_s is not None
    assert flown_day.ended_s < 1000.0
    assert set(range(4)) <= set(flown_day.inspected) < set(range(8)), "\n".join(sky.lines)
    assert {len(vehicle.turn.sorties) for vehicle in sky.state.vehicles.values()} == {1}
    assert len(told(sky, "no charged pack is left at base depot for the rest of the day; 4 segments")) == 1

"""What is not well yet no fault."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.inflight.faults.warning_rules import TABLE, find_new_warnings, find_warnings
from executor.core.inflight.faults.watch_view import WatchView
from executor.core.interface.messages import Heartbeat, Radio, Traffic
from executor.core.state import link_quality
from executor.core.state.fleet_state import ReportedWarnings
from executor.core.state.link_quality import LinkQuality
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_parts import LegBoundary, Positioning
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState
from tests.executor.core.vehicles import CONTEXT, NOW_S, SETUP, at, flying, nearly_empty, pack

GOOD = Radio(120, 110, 40, 40, 90)


def lossy(*lost: int, of: int = 20) -> LinkQuality:
    """Return a link after seconds in which so many of its frames were lost."""
    state = LinkQuality()
    for number, missing in enumerate(lost):
        state = link_quality.add_traffic(state, Traffic(of - missing, missing), NOW_S - len(lost) + number, 10.0)
    return state


FALLS = Fault(FaultKind.INTERRUPTION, "falls", NOW_S - 9.0, FaultCode.FALLING)
ROWS: list[tuple[str, VehicleState]] = [
    ("silent", flying(heard_s=NOW_S - 4.0)),
    ("heartbeat", flying(heartbeat_s=NOW_S - 4.0)),
    ("disarmed", flying(doubted=(Heartbeat(3, 3, False, 4), NOW_S - 0.5))),
    ("positions", flying(fix=at(age_s=4.0))),
    ("items", flying(item_s=NOW_S - 6.0)),
    ("loss", flying(quality=lossy(*[0] * 60, *[10] * 12))),
    ("radio", flying(quality=LinkQuality(radio=Radio(45, 110, 40, 40, 90), radio_s=NOW_S))),
    ("battery-silent", flying(battery=pack(90.0, 90.0, age_s=9.0))),
    ("battery-low", flying(battery=pack(20.0, charge_state=2))),
    ("pack", flying(battery=pack(62.0, 62.0), pack=nearly_empty())),
    ("battery-besides", flying(stage=Stage.RETURNING, fault=FALLS, battery=pack(20.0, charge_state=3))),
    ("reserve", flying(battery=pack(16.0, 16.0))),
    ("gps", flying(positioning=Positioning(fixed=at(age_s=3.0), lost_s=NOW_S - 1.0, why="no GPS fix"))),
    ("position", flying(jump=(33.0, NOW_S))),
    ("low", flying(fix=at(east_m=140.0, up_m=10.0))),
    ("strays", flying(fix=at(east_m=900.0), leg_began=LegBoundary(NOW_S - 300.0, None))),
    ("stands", flying(stage=Stage.RETURNING, anchor=replace(at(), boot_s=NOW_S - 25.0))),
]


def names(state: VehicleState) -> list[str]:
    return [row.name for row, _ in find_warnings(WatchView(CONTEXT, SETUP, state, False, NOW_S))]


def test_every_warning_has_its_row() -> None:
    assert [name for name, _ in ROWS] == [row.name for row in TABLE]


def test_nothing_is_wrong_with_a_healthy_vehicle() -> None:
    assert names(flying(quality=LinkQuality(radio=GOOD, radio_s=NOW_S))) == []


@pytest.mark.parametrize(("name", "state"), ROWS, ids=[name for name, _ in ROWS])
def test_it_is_reported(name: str, state: VehicleState) -> None:
    assert name in names(state)


def test_no_warning_about_a_vehicle_on_the_ground() -> None:
    assert names(flying(stage=Stage.LANDED, heard_s=NOW_S - 100.0)) == []


def test_a_log_that_was_thinned_is_no_lossy_link() -> None:
    assert lossy(*[15] * 60).worse == 0.0
    assert lossy(*[0] * 60, *[10] * 12).worse > 0.25


def test_a_full_buffer_is_the_radios_own_complaint() -> None:
    assert "buffer 5 %" in LinkQuality(radio=Radio(120, 110, 40, 40, 5)).weak
    assert LinkQuality(radio=Radio(None, None, None, None, None)).weak == ""


def radio(
    rssi: int | None = 120, noise: int | None = 40, far: int | None = 110, buffer: int | None = 90
) -> LinkQuality:
    return LinkQuality(radio=Radio(rssi, far, noise, 40, buffer), radio_s=NOW_S)


HOMEWARD: dict[str, object] = {"stage": Stage.RETURNING, "anchor": replace(at(), boot_s=NOW_S - 20.0)}
PAST: dict[str, object] = {"fix": at(east_m=368.0), "leg_began": LegBoundary(NOW_S - 77.0, None)}
EDGES: list[tuple[str, VehicleState, VehicleState]] = [
    # Nothing is said at the last figure before the threshold, and something from there on.
    ("silent", flying(heard_s=NOW_S - 2.9), flying(heard_s=NOW_S - 3.0)),
    ("silent", flying(heard_s=None), flying(heard_s=NOW_S - 3.0)),
    ("heartbeat", flying(heartbeat_s=NOW_S - 3.4), flying(heartbeat_s=NOW_S - 3.5)),
    ("positions", flying(fix=at(age_s=2.9)), flying(fix=at(age_s=3.0))),
    ("items", flying(item_s=NOW_S - 4.9), flying(item_s=NOW_S - 5.0)),
    ("items", flying(item_s=NOW_S - 9.0, stage=Stage.RETURNING), flying(item_s=NOW_S - 9.0)),
    ("battery-silent", flying(battery=pack(90.0, age_s=6.9)), flying(battery=pack(90.0, age_s=7.0))),
    ("battery-low", flying(battery=pack(20.0, charge_state=1)), flying(battery=pack(20.0, charge_state=2))),
    ("battery-low", flying(unhealthy=0x1000000), flying(unhealthy=0x2000000)),
    ("loss", flying(quality=LinkQuality(lost=0.24, usual=0.0)), flying(quality=LinkQuality(lost=0.25, usual=0.0))),
    ("loss", flying(quality=LinkQuality(lost=0.62, usual=0.5)), flying(quality=LinkQuality(lost=0.625, usual=0.5))),
    ("loss", flying(quality=LinkQuality(lost=0.96, usual=0.95)), flying(quality=LinkQuality(lost=0.97, usual=0.95))),
    ("radio", flying(quality=radio(50, 40)), flying(quality=radio(49, 40))),
    ("radio", flying(quality=radio(far=50)), flying(quality=radio(far=49))),
    ("radio", flying(quality=radio(None, 40)), flying(quality=radio(0, 40))),
    ("radio", flying(quality=radio(buffer=20)), flying(quality=radio(buffer=19))),
    (
        "radio",
        flying(quality=replace(radio(45), radio_s=NOW_S - 5.1)),
        flying(quality=replace(radio(45), radio_s=NOW_S - 5.0)),
    ),
    ("position", flying(jump=(9.9, NOW_S)), flying(jump=(10.0, NOW_S))),
    ("position", flying(jump=(33.0, NOW_S - 3.1)), flying(jump=(33.0, NOW_S - 3.0))),
    ("stands", flying(**HOMEWARD | {"anchor": replace(at(), boot_s=NOW_S - 19.9)}), flying(**HOMEWARD)),
    ("stands", flying(**HOMEWARD, fix=at(up_m=1.9)), flying(**HOMEWARD, fix=at(up_m=2.0))),
    # On its pad it should have disarmed by now.
    ("stands", flying(**HOMEWARD, fix=at(east_m=15.1, up_m=0.1)), flying(**HOMEWARD, fix=at(east_m=15.0, up_m=0.1))),
    (
        "stands",
        flying(**HOMEWARD, fix=replace(at(), at_s=NOW_S - 3.1)),
        flying(**HOMEWARD, fix=replace(at(), at_s=NOW_S - 3.0)),
    ),
    ("stands", flying(**HOMEWARD, heartbeat=Heartbeat(3, 6, False, 4)), flying(**HOMEWARD)),
    ("stands", flying(**HOMEWARD | {"stage": Stage.FLYING}), flying(**HOMEWARD)),
    # Its leg is 100 m long and takes 38 s; it flies on beyond the end.
    ("strays", flying(**PAST | {"leg_began": LegBoundary(NOW_S - 76.0, None)}), flying(**PAST)),
    ("strays", flying(**PAST | {"leg_began": None}), flying(**PAST)),
    ("strays", flying(**PAST | {"fix": at(east_m=366.0)}), flying(**PAST)),
    ("strays", flying(**PAST | {"fix": replace(at(east_m=368.0), velocity_m_s=(-3.0, 0.0, 0.0))}), flying(**PAST)),
    ("strays", flying(**PAST | {"fix": replace(at(east_m=368.0), reckoned=True)}), flying(**PAST)),
    ("strays", flying(**PAST, held_s=NOW_S - 9.0), flying(**PAST)),
    ("strays", flying(**PAST, hold_asked_s=NOW_S - 9.0), flying(**PAST)),
    ("strays", flying(**PAST, carried=MissionOwnership(ours_s=NOW_S - 9.0)), flying(**PAST)),
    ("strays", flying(**PAST, heartbeat=Heartbeat(3, 5, True, 4)), flying(**PAST)),
    ("strays", flying(**PAST, stage=Stage.RETURNING), flying(**PAST)),
]


@pytest.mark.parametrize(("name", "well", "not_well"), EDGES, ids=[f"{n}-{one[0]}" for n, one in enumerate(EDGES)])
def test_it_is_reported_from_its_threshold_on(name: str, well: VehicleState, not_well: VehicleState) -> None:
    assert name not in names(well)
    assert name in names(not_well)


WORDS: list[tuple[VehicleState, str]] = [
    (flying(heard_s=NOW_S - 4.0), "no message for 4.0 s"),
    (flying(quality=LinkQuality(lost=0.5, usual=0.1)), "50 % of its frames are lost, where 10 % is usual"),
    (flying(quality=radio(45)), "radio signal 45 over noise 40 here"),
    (flying(quality=radio(far=45)), "radio signal 45 over noise 40 at the vehicle"),
    (flying(battery=pack(20.0, charge_state=2)), "the autopilot reports its battery low"),
    (flying(unhealthy=0x2000000), "the autopilot reports its battery not healthy"),
    (flying(jump=(33.0, NOW_S)), "its position jumped by 33 m"),
    (flying(**PAST), "flies away from its waypoint: 131 m from it, 39 s late"),
]


@pytest.mark.parametrize(("state", "words"), WORDS, ids=[words for _, words in WORDS])
def test_the_words(state: VehicleState, words: str) -> None:
    assert words in [new_warnings for _, new_warnings in find_warnings(WatchView(CONTEXT, SETUP, state, False, NOW_S))]


def told(state: VehicleState, before: ReportedWarnings, now_s: float) -> tuple[ReportedWarnings, tuple[str, ...]]:
    return find_new_warnings(WatchView(CONTEXT, SETUP, state, False, now_s), before)


def test_what_comes_back_within_half_a_minute_is_the_same() -> None:
    low, well = flying(battery_faults=0, unhealthy=0x2000000), flying()
    line = "uav1: the autopilot reports its battery not healthy"
    before, lines = told(low, (), NOW_S)
    assert line in lines
    before, lines = told(low, before, NOW_S + 1.0)
    assert line not in lines
    before, _ = told(well, before, NOW_S + 2.0)
    again, lines = told(low, before, NOW_S + 30.9)
    assert line not in lines, "it was not well 29.9 s ago"
    assert line in told(low, before, NOW_S + 31.0)[1]
    assert line in told(low, again, NOW_S + 60.9)[1]


def test_a_silence_is_reported_elsewhere() -> None:
    assert told(flying(heard_s=NOW_S - 4.0), (), NOW_S)[1] == ()


def test_a_loss_is_learned_slowly_and_an_improvement_at_once() -> None:
    worse = lossy(*[0] * 60, *[10] * 12)
    assert worse.lost == pytest.approx(0.5)
    # A sixtieth of the loss each second, while the window fills with it in ten: 0.05, 0.1 ... 0.5, 0.5, 0.5.
    assert worse.usual == pytest.approx((5.5 * 0.5 + 1.0) / 60.0, abs=0.005)
    better = lossy(*[10] * 60, *[0] * 12)
    assert (better.lost, better.usual) == (0.0, 0.0)
    assert better.worse == 0.0


def test_a_few_frames_say_nothing() -> None:
    assert link_quality.add_traffic(LinkQuality(), Traffic(10, 9), NOW_S, 10.0).lost is None
    assert link_quality.add_traffic(LinkQuality(), Traffic(10, 10), NOW_S, 10.0).lost == 0.5


def test_frames_are_forgotten_after_the_window() -> None:
    first = link_quality.add_traffic(LinkQuality(), Traffic(10, 10), NOW_S, 10.0)
    assert link_quality.add_traffic(first, Traffic(20, 0), NOW_S + 9.9, 10.0).lost == pytest.approx(0.25)
    assert link_quality.add_traffic(first, Traffic(20, 0), NOW_S + 10.0, 10.0).lost == 0.0

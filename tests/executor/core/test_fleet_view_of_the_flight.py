"""Everything that the page shows of a flight, from states that are made by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import pytest

from executor.core import fleet_view
from executor.core.fleet_view import (
    IntentView,
    OfferView,
    ReplanView,
)
from executor.core.interface.commands import Level
from executor.core.interface.intents import Action, IntentRecord
from executor.core.state.fleet_state import OperatorLine, TakeoffOffer
from executor.core.state.vehicle_state import VehicleState
from tests.executor.core.steps import (
    Changes,
    flight_of,
    plan_of,
    rounded,
    wished,
)
from tests.executor.core.vehicles import FLEET, NOW_S, flying

CONTEXT = FLEET.context
OPEN = TakeoffOffer(("uav1",), (0, 2), 5.0)


def page(*vehicles: VehicleState, **given: Any) -> Changes:
    """Return what is shown of a flight, without its vehicles."""
    found = fleet_view.build_fleet_view(CONTEXT, flight_of(*vehicles, **given), NOW_S + 0.004)
    return {one.name: getattr(found, one.name) for one in fields(found) if one.name != "vehicles"}


def lines(count: int) -> tuple[OperatorLine, ...]:
    return tuple(OperatorLine(float(number), Level.INFO, str(number)) for number in range(count))


def wishes(count: int) -> dict[str, IntentRecord]:
    return {str(number): replace(wished(Action.HOLD), at_s=number + 0.004) for number in range(count)}


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a flight",
        lambda: page(flying()),
        {
            "now_s": NOW_S,
            "flight_s": 100.0,
            "revision": 0,
            "segments_total": 6,
            "inspected": (),
            "uncovered": (),
            "missed": (),
            "replan": None,
            "all_silent": False,
            "recalled": False,
            "finished": False,
            "min_separation_m": None,
            "said": (),
            "intents": (),
            "checks": (),
            "question": None,
            "offer": None,
            "radios": (),
        },
    ),
    ("a flight before its launch", lambda: page(launched_s=None)["flight_s"], None),
    (
        "a flight in which much is going on",
        lambda: page(
            flying(),
            revision=4,
            inspected={3: "uav1", 1: "uav2"},
            given_up=frozenset({1, 5, 4}),
            replan=plan_of(pending=frozenset({"uav2", "uav1"})),
            silent_since_s=5.0,
            recalled=True,
            finished=True,
            separation_m=5.126,
            offer=OPEN,
        ),
        {
            "now_s": NOW_S,
            "flight_s": 100.0,
            "revision": 4,
            "segments_total": 6,
            "inspected": (1, 3),
            "uncovered": (4, 5),
            "missed": (),
            "replan": ReplanView(revision=4, trigger="uav3: gone", solving=False, pending=("uav1", "uav2")),
            "all_silent": True,
            "recalled": True,
            "finished": True,
            "min_separation_m": 5.13,
            "said": (),
            "intents": (),
            "checks": (),
            "question": None,
            "offer": OfferView(
                vehicles=("uav1",),
                segments=(0, 2),
                text=("uav1 can take over 2 segments (segment 0, segment 2). Is its pad clear of people?"),
            ),
            "radios": (),
        },
    ),
    (
        "a re-plan that is solved",
        lambda: page(replan=plan_of(solve_s=None))["replan"],
        ReplanView(revision=4, trigger="uav3: gone", solving=True, pending=()),
    ),
    (
        "the last lines",
        lambda: [(len(found), found[0]) for count in (60, 61) for found in (page(said=lines(count))["said"],)],
        [(60, OperatorLine(0.0, Level.INFO, "0")), (60, OperatorLine(1.0, Level.INFO, "1"))],
    ),
    (
        "the last wishes",
        lambda: [(len(found), found[0]) for count in (30, 31) for found in (page(intents=wishes(count))["intents"],)],
        [
            (
                30,
                IntentView(
                    id="wish",
                    action="hold",
                    vehicle="uav1",
                    source="page",
                    outcome="accepted",
                    text="under way",
                    at_s=0.0,
                    question="",
                ),
            ),
            (
                30,
                IntentView(
                    id="wish",
                    action="hold",
                    vehicle="uav1",
                    source="page",
                    outcome="accepted",
                    text="under way",
                    at_s=1.0,
                    question="",
                ),
            ),
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected

"""Which vehicles on the ground are offered, for which segments, and until when."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest

from executor.core.battery import kalman
from executor.core.battery.account import BatteryState
from executor.core.battery.kalman import Prior
from executor.core.context import Context, RelaunchPolicy
from executor.core.ground import takeoff_offers
from executor.core.interface.commands import Level, Say
from executor.core.state.fleet_state import FleetState, TakeoffOffer
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    CREW,
    LOW,
    SECOND,
    Changes,
    Stepped,
    beat,
    flight_of,
    landed,
    outcome,
    over_pad,
    plan_of,
    rounded,
)
from tests.executor.core.vehicles import FLEET, NOW_S, flying, pack

STANDS = landed(stage=Stage.LANDED)
NOBODY = FleetState(MappingProxyType({}))
OPEN: Changes = {"given_up": frozenset({0, 2, 4})}
TWO = (STANDS, with_facts(STANDS, name="uav2", fix=replace(LOW, place_m=FLEET.context.vehicles["uav2"].pad_m)))
OFFER = TakeoffOffer(("uav1",), (0, 2, 4), NOW_S - 50.0)
LANDS = with_facts(SECOND, waypoint=4)


def idle(one: VehicleState, context: Context = CREW) -> bool:
    return takeoff_offers.is_idle(context, flight_of(one), one, NOW_S)


def greedy(factor: float) -> BatteryState:
    """Return a battery at 22 % that gives so many times what the model says."""
    return replace(pack(22.0), estimate=kalman.initialise_estimate(22.0, Prior(factor, 0.1)))


def looked(*vehicles: VehicleState, context: Context = CREW, **given: Any) -> Stepped:
    before = flight_of(*vehicles, **{**OPEN, **given})
    return outcome(before, takeoff_offers.update_offers(context, before, NOW_S))


ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("a vehicle on its pad is ready", lambda: idle(STANDS), True),
    (
        "stages in which a vehicle is ready",
        lambda: [stage for stage in Stage if idle(replace(STANDS, stage=stage))],
        [Stage.GROUND, Stage.LANDED],
    ),
    (
        "a landed vehicle is not offered where none flies twice",
        lambda: [
            idle(replace(STANDS, stage=stage), replace(CREW, fly_again=RelaunchPolicy.NEVER))
            for stage in (Stage.LANDED, Stage.GROUND)
        ],
        [False, True],
    ),
    (
        "faults with which a landed vehicle is ready",
        lambda: [kind for kind in FaultKind if idle(replace(STANDS, fault=Fault(kind, "", 5.0, FaultCode.STALL)))],
        [FaultKind.LINK, FaultKind.INTERRUPTION, FaultKind.FENCE],
    ),
    (
        "faults with which a vehicle that has not flown is ready",
        lambda: [
            kind
            for kind in FaultKind
            if idle(replace(STANDS, stage=Stage.GROUND, fault=Fault(kind, "", 5.0, FaultCode.STALL)))
        ],
        [],
    ),
    (
        "vehicles that are not ready",
        lambda: [
            idle(with_facts(STANDS, **given))
            for given in (
                {"stubborn": True},
                {"excluded": True},
                {"heartbeat": beat()},
                {"pending": 3},
                {"fix": None},
                {"heard_s": None},
                {"battery": BatteryState()},
            )
        ],
        [False, False, False, False, False, False, False],
    ),
    (
        "longest silence of a ready vehicle",
        lambda: [idle(with_facts(STANDS, heard_s=NOW_S - age_s)) for age_s in (2.9, 3.0)],
        [True, False],
    ),
    (
        "largest distance from its pad",
        lambda: [idle(with_facts(STANDS, fix=over_pad(north_m=-north_m))) for north_m in (15.0, 15.1)],
        [True, False],
    ),
    (
        "least battery charge",
        lambda: [idle(with_facts(STANDS, battery=pack(percent))) for percent in (20.0, 19.9)],
        [True, False],
    ),
    (
        "open segments",
        lambda: [
            sorted(takeoff_offers.find_open_segments(CREW, flight_of(flying(), **given)))
            for given in (
                {},
                OPEN,
                {"attempts": {4: 2, 5: 3}},
                {"inspected": {3: "uav2"}, "given_up": frozenset({0, 3})},
            )
        ],
        [[2, 3, 4, 5], [0, 2, 3, 4, 5], [2, 3, 4], [0, 2, 4, 5]],
    ),
    (
        "segments within reach",
        lambda: [
            sorted(
                takeoff_offers.find_reachable_segments(
                    CREW, NOBODY, with_facts(STANDS, battery=pack(percent)), frozenset(range(6))
                )
            )
            for percent in (17.0, 19.0, 19.5, 20.0, 20.5, 21.0, 22.0)
        ],
        [[], [], [], [], [], [], [0, 1]],
    ),
    (
        "segments within reach at a higher consumption than the model",
        lambda: [
            sorted(
                takeoff_offers.find_reachable_segments(
                    CREW, NOBODY, with_facts(STANDS, battery=greedy(factor)), frozenset(range(6))
                )
            )
            for factor in (1.0, 1.1, 1.2)
        ],
        [[0, 1], [0], []],
    ),
    (
        "a vehicle with an unknown battery reaches no segment",
        lambda: takeoff_offers.find_reachable_segments(
            CREW, NOBODY, with_facts(STANDS, battery=BatteryState()), frozenset({0})
        ),
        frozenset(),
    ),
    (
        "an offer",
        lambda: looked(STANDS),
        (
            [
                Say(
                    Level.FAULT,
                    (
                        "uav1 can take over 6 segments (segment 0, segment 1, segment 2, segment 3, segment 4, "
                        "segment 5). Is its pad clear of people? Use include for each that may take off"
                    ),
                )
            ],
            {},
            {
                "offer": TakeoffOffer(vehicles=("uav1",), segments=(0, 1, 2, 3, 4, 5), since_s=NOW_S),
                "offer_wanted_s": NOW_S,
            },
        ),
    ),
    (
        "an offer of two",
        lambda: looked(*TWO),
        (
            [
                Say(
                    Level.FAULT,
                    (
                        "uav1 and uav2 can take over 6 segments (segment 0, segment 1, segment 2, segment 3, "
                        "segment 4, segment 5). Are their pads clear of people? Use include for each "
                        "that may take off"
                    ),
                )
            ],
            {},
            {
                "offer": TakeoffOffer(vehicles=("uav1", "uav2"), segments=(0, 1, 2, 3, 4, 5), since_s=NOW_S),
                "offer_wanted_s": NOW_S,
            },
        ),
    ),
    (
        "an offer for a simulation",
        lambda: looked(STANDS, context=FLEET.context, offer=OFFER),
        ([], {}, {"offer": None}),
    ),
    (
        "an offer before the launch",
        lambda: looked(STANDS, launched_s=None, offer_wanted_s=5.0),
        ([], {}, {"offer_wanted_s": None}),
    ),
    (
        "an offer after the flight was aborted",
        lambda: looked(STANDS, recalled=True, offer=OFFER),
        ([], {}, {"offer": None}),
    ),
    ("an offer after the end", lambda: looked(STANDS, finished=True, offer=OFFER), ([], {}, {"offer": None})),
    ("an offer when all are over", lambda: looked(STANDS, offers_over=True), ([], {}, {})),
    ("an offer while a re-plan goes on", lambda: looked(STANDS, replan=plan_of(), offer=OFFER), ([], {}, {})),
    (
        "an offer when a re-plan is about to begin",
        lambda: [
            looked(STANDS, **given) for given in ({"urgent": True}, {"ordered": True}, {"wait_until_s": NOW_S + 0.1})
        ],
        [([], {}, {}), ([], {}, {}), ([], {}, {})],
    ),
    (
        "an offer when nothing is open",
        lambda: looked(
            STANDS, given_up=frozenset(), inspected=dict.fromkeys(range(6), "uav2"), offer=OFFER, offer_wanted_s=5.0
        ),
        ([], {}, {"offer": None, "offer_wanted_s": None}),
    ),
    ("an offer of who was cleared already", lambda: looked(with_facts(STANDS, cleared_s=5.0)), ([], {}, {})),
    ("an offer while somebody in the air can", lambda: looked(STANDS, SECOND, given_up=frozenset({2})), ([], {}, {})),
    (
        "an offer while somebody in the air could, but not what was given up",
        lambda: looked(STANDS, SECOND, given_up=frozenset({0, 1, 4, 5})),
        (
            [
                Say(
                    Level.FAULT,
                    (
                        "uav1 can take over 4 segments (segment 0, segment 1, segment 4, segment 5). Is its "
                        "pad clear of people? Use include for each that may take off"
                    ),
                )
            ],
            {},
            {"offer": TakeoffOffer(vehicles=("uav1",), segments=(0, 1, 4, 5), since_s=NOW_S), "offer_wanted_s": NOW_S},
        ),
    ),
    (
        "an offer waits for who lands soon",
        lambda: looked(STANDS, with_facts(LANDS, held_s=5.0)),
        ([], {}, {"offer_wanted_s": NOW_S}),
    ),
    (
        "an offer has waited for who lands soon",
        lambda: looked(STANDS, with_facts(LANDS, held_s=5.0), offer_wanted_s=NOW_S - 180.0),
        (
            [
                Say(
                    Level.FAULT,
                    (
                        "uav1 can take over 6 segments (segment 0, segment 1, segment 2, segment 3, segment 4, "
                        "segment 5). Is its pad clear of people? Use include for each that may take off"
                    ),
                )
            ],
            {},
            {"offer": TakeoffOffer(vehicles=("uav1",), segments=(0, 1, 2, 3, 4, 5), since_s=NOW_S)},
        ),
    ),
    (
        "an offer has not waited long enough",
        lambda: looked(STANDS, with_facts(LANDS, held_s=5.0), offer_wanted_s=NOW_S - 179.9),
        ([], {}, {}),
    ),
    (
        "vehicles that an offer waits for",
        lambda: [
            looked(STANDS, with_facts(SECOND, **given))[2].get("offer") is None
            for given in (
                {"stage": Stage.RETURNING},
                {"stage": Stage.RETURNING, "excluded": True},
                {"stage": Stage.RETURNING, "fault": BATTERY_FAULT},
                {"stage": Stage.RETURNING, "fault": Fault(FaultKind.LINK, "", 5.0, FaultCode.LINK_LOST)},
                {"held_s": 5.0},
                {"held_s": 5.0, "waypoint": 4},
                {"held_s": 5.0, "waypoint": 5},
                {"held_s": 5.0, "waypoint": 6},
            )
        ],
        [True, False, False, True, False, True, True, False],
    ),
    (
        "an offer that stands",
        lambda: looked(STANDS, offer=OFFER, offer_wanted_s=5.0),
        (
            [],
            {},
            {
                "offer": TakeoffOffer(
                    vehicles=("uav1",), segments=(0, 1, 2, 3, 4, 5), since_s=NOW_S - 50.0, alone_since_s=NOW_S
                )
            },
        ),
    ),
    (
        "an offer that stands while somebody flies",
        lambda: looked(
            STANDS, with_facts(SECOND, held_s=5.0), offer=replace(OFFER, alone_since_s=5.0), offer_wanted_s=5.0
        ),
        ([], {}, {"offer": TakeoffOffer(vehicles=("uav1",), segments=(0, 1, 2, 4, 5), since_s=NOW_S - 50.0)}),
    ),
    (
        "an offer that stands while somebody starts",
        lambda: looked(
            STANDS,
            with_facts(SECOND, stage=Stage.STARTING, held_s=5.0),
            offer=replace(OFFER, alone_since_s=5.0),
            offer_wanted_s=5.0,
        ),
        ([], {}, {"offer": TakeoffOffer(vehicles=("uav1",), segments=(0, 1, 2, 4, 5), since_s=NOW_S - 50.0)}),
    ),
    (
        "an offer of more",
        lambda: looked(STANDS, offer=replace(OFFER, segments=(0, 2), alone_since_s=NOW_S - 5.0)),
        (
            [],
            {},
            {
                "offer": TakeoffOffer(
                    vehicles=("uav1",), segments=(0, 1, 2, 3, 4, 5), since_s=NOW_S - 50.0, alone_since_s=NOW_S - 5.0
                )
            },
        ),
    ),
    (
        "an offer of another one",
        lambda: looked(*TWO, offer=OFFER, offer_wanted_s=5.0),
        (
            [
                Say(
                    Level.FAULT,
                    (
                        "uav1 and uav2 can take over 6 segments (segment 0, segment 1, segment 2, segment 3, "
                        "segment 4, segment 5). Are their pads clear of people? Use include for each "
                        "that may take off"
                    ),
                )
            ],
            {},
            {"offer": TakeoffOffer(vehicles=("uav1", "uav2"), segments=(0, 1, 2, 3, 4, 5), since_s=NOW_S)},
        ),
    ),
    (
        "an offer that was not answered",
        lambda: looked(
            STANDS, offer=replace(OFFER, alone_since_s=NOW_S - 300.0), offer_wanted_s=5.0, inspected={0: "uav2"}
        ),
        (
            [Say(Level.WARNING, "no vehicle was cleared for take-off within 300 s; 5 segments are left over")],
            {},
            {"given_up": frozenset({0, 1, 2, 3, 4, 5}), "offer": None, "offers_over": True},
        ),
    ),
    (
        "an offer that may be answered still",
        lambda: looked(STANDS, offer=replace(OFFER, alone_since_s=NOW_S - 299.9)),
        (
            [],
            {},
            {
                "offer": TakeoffOffer(
                    vehicles=("uav1",), segments=(0, 1, 2, 3, 4, 5), since_s=NOW_S - 50.0, alone_since_s=NOW_S - 299.9
                )
            },
        ),
    ),
    (
        "offers in words",
        lambda: [
            takeoff_offers.describe_offer(CREW, offer)
            for offer in (
                replace(OFFER, segments=(2,)),
                TakeoffOffer(("uav1", "uav2"), (0, 1, 2, 3, 4, 5), 0.0),
                TakeoffOffer(("uav1",), (0, 1, 2, 3, 4, 5, 5), 0.0),
            )
        ],
        [
            "uav1 can take over 1 segment (segment 2). Is its pad clear of people?",
            (
                "uav1 and uav2 can take over 6 segments (segment 0, segment 1, segment 2, segment 3, segment "
                "4, segment 5). Are their pads clear of people?"
            ),
            (
                "uav1 can take over 7 segments (segment 0, segment 1, segment 2, segment 3, segment 4, segment "
                "5, ...). Is its pad clear of people?"
            ),
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected

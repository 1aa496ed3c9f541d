"""Packs before a flight: what they count by, and what their voltage says."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.battery.pack_condition import PackFlightRecord, PackHistory, build_pack_history
from executor.core.battery.voltage import Chemistry, PackFacts
from executor.core.context import Context
from executor.core.interface.codes import CheckCode, Severity
from executor.core.interface.messages import Position
from executor.core.preflight import vehicle_checks
from executor.core.preflight.vehicle_checks import VehicleFacts
from missions import PX4
from tests.executor.core.vehicles import DISARMED, FLEET

PLACE = Position(5.0, 49.6, 15.6, 450.0, 0.0, 0.0, 0.0, 0.0, None)
FACTS = VehicleFacts("uav1", DISARMED, PLACE, 76.0, None, {}, voltage_v=11.1)
FOUR = replace(FACTS, cells=4)
SOUND = replace(FOUR, remaining_pct=98.0, voltage_v=16.6)


def said(
    facts: VehicleFacts, site: PackFacts | None = None, context: Context = FLEET.context
) -> list[tuple[Severity, str]]:
    setup = replace(context.vehicles["uav1"], pack=site or PackFacts())
    context = replace(context, vehicles={**context.vehicles, "uav1": setup})
    found = vehicle_checks.check_pack(context, facts)
    assert {one.code for one in found} <= {CheckCode.PACK}
    return [(one.severity, one.text) for one in found]


def test_a_pack_that_is_emptier_than_it_counts() -> None:
    text = "its pack rests at 3.70 V a cell, about 12 %, and reports 76 % (at least 3 cells, cell count not reported)"
    assert said(FACTS) == [(Severity.WARNING, text)]


@pytest.mark.parametrize(
    ("facts", "site"),
    [
        (replace(FACTS, parameters={"MOT_BAT_VOLT_MAX": 12.6}), None),
        (FACTS, PackFacts(cells=3)),
        (replace(FACTS, cells=3), None),
    ],
)
def test_the_cell_count_comes_from_a_parameter_the_site_or_the_voltage(
    facts: VehicleFacts, site: PackFacts | None
) -> None:
    text = "its pack rests at 3.70 V a cell, about 12 %, and reports 76 % (3 cells)"
    assert said(facts, site) == [(Severity.WARNING, text)]


def test_lithium_ion_is_judged_by_its_own_curve() -> None:
    [(_, text)] = said(FACTS, PackFacts(cells=3, chemistry=Chemistry.LI_ION))
    assert "about 52 %" in text


def test_a_sound_pack() -> None:
    text = "its pack rests at 4.15 V a cell, about 94 %, and reports 98 % (4 cells)"
    assert said(SOUND) == [(Severity.OK, text)]


def test_a_pack_of_another_size_than_the_plans() -> None:
    """The site counts with the 5 Ah of its drone."""
    found = said(replace(SOUND, parameters={"BATT_CAPACITY": 3300.0}))
    assert found[0] == (
        Severity.WARNING,
        (
            "it counts by a pack of 3.3 Ah, the plan by 5 Ah ([energy] capacity_ah): its percentage will fall 1.5 "
            "times as fast as planned"
        ),
    )
    assert len(said(replace(SOUND, parameters={"BATT_CAPACITY": 5100.0}))) == 1


def test_px4s_percentage_may_be_read_off_the_very_same_voltage() -> None:
    setup = replace(FLEET.context.vehicles["uav1"], dialect=PX4)
    context = replace(FLEET.context, vehicles={**FLEET.context.vehicles, "uav1": setup})
    low = replace(FOUR, remaining_pct=100.0, voltage_v=16.0)
    assert said(low, context=context)[0][0] is Severity.OK
    counted = replace(low, parameters={"BAT1_CAPACITY": 5000.0})
    assert said(counted, context=context)[0][0] is Severity.WARNING


def test_a_vehicle_without_a_voltage() -> None:
    assert said(replace(FACTS, voltage_v=None))[0][0] is Severity.OK


WORN = build_pack_history("A7", [PackFlightRecord(3.5, 0.024, 5.0)] * 4)


def of_history(known: PackHistory | None, budget_pct: float, reserve_pct: float, empty_pct: float) -> list[object]:
    setup = replace(
        FLEET.context.vehicles["uav1"], history=known, budget_pct=budget_pct, reserve_pct=reserve_pct,
        empty_pct=empty_pct,
    )  # fmt: skip
    context = replace(FLEET.context, vehicles={**FLEET.context.vehicles, "uav1": setup})
    return [(one.severity, one.text) for one in vehicle_checks.check_pack(context, SOUND)[:-1]]


def test_a_worn_pack_is_reported_with_what_is_reckoned_with_for_it() -> None:
    text = (
        "its pack A7 has 3.5 Ah, 70 % of the plan's 5 Ah and 24 mOhm, by 4 flights: budget 55 %, "
        "empty at 30 % of the counted capacity"
    )
    assert of_history(WORN, 55.0, 45.0, 30.0) == [(Severity.WARNING, text)]


def test_a_good_or_unknown_pack_is_listed_without_a_warning() -> None:
    sound = build_pack_history("B1", [PackFlightRecord(4.9, None, 5.0)])
    assert of_history(sound, 75.0, 15.0, 0.0) == [
        (Severity.OK, "its pack B1 has 4.9 Ah, 98 % of the plan's 5 Ah, by 1 flight")
    ]
    assert of_history(build_pack_history("new", []), 75.0, 15.0, 0.0) == [
        (Severity.OK, "its pack new: no earlier flight is known; the plan assumes 5 Ah")
    ]
    assert of_history(build_pack_history("C2", [PackFlightRecord(None, None, None)]), 75.0, 15.0, 0.0) == [
        (Severity.OK, "its pack C2: 1 flight gave no capacity; the plan assumes 5 Ah")
    ]
    assert of_history(None, 75.0, 15.0, 0.0) == []

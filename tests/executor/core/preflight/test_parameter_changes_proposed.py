"""Changes on board, their record, and which may be restored."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.context import Context
from executor.core.interface.codes import Severity
from executor.core.interface.messages import ParamValue
from executor.core.preflight.parameter_changes import (
    KEPT_HIGHER_M,
    Answers,
    ParameterProposal,
    add_other_homes,
    check_return_height,
    propose_return_changes,
)
from missions import Pad
from tests.executor.builders import fleet_of

INT32, REAL32 = 6, 9
COPTERS = fleet_of().context
"""Three over flat ground: uav3 has the highest layer."""
PX4S = fleet_of(autopilot="px4").context


def said(kind: int = REAL32, **values: float) -> dict[str, ParamValue]:
    """Return what a vehicle answered."""
    return {name: ParamValue(name, value, kind) for name, value in values.items()}


def proposed(context: Context, vehicle: str, kind: int = REAL32, **values: float) -> ParameterProposal:
    """Return what is proposed for one vehicle that has these parameters."""
    return propose_return_changes(context, {vehicle: Answers(said(kind, **values))})


def with_return_ceiling(context: Context, ceiling_m: float) -> Context:
    """Return a flight in which returns end so far over the ground."""
    setup = context.setup
    return replace(context, setup=replace(setup, inspection=replace(setup.inspection, return_ceiling_m=ceiling_m)))


def new_values(proposal: ParameterProposal) -> dict[str, float]:
    """Return what is to be set."""
    return {change.name: change.new for change in proposal.changes}


def test_the_height_of_ardupilots_return_is_in_centimetres() -> None:
    proposal = proposed(COPTERS, "uav1", INT32, RTL_ALT=1200.0, RTL_CONE_SLOPE=3.0)
    height_m = COPTERS.return_height_m("uav1")
    assert new_values(proposal) == {"RTL_ALT": 100 * height_m, "RTL_CONE_SLOPE": 0.0}
    first, second = proposal.changes
    assert first.words_set == f"RTL_ALT 1200 -> {100 * height_m:.0f} cm: keeps its RTL in its own layer"
    assert (first.old, first.kind, second.old) == (1200.0, INT32, 3.0)
    assert second.words_set == "RTL_CONE_SLOPE 3 -> 0: climbs to that height near its pad, too"
    texts = [check.text for check in proposal.checks]
    assert texts == [
        f"RTL altitude will be {height_m:g} m (RTL_ALT)",
        f"to be set for the flight: {first.words_set}",
        f"to be set for the flight: {second.words_set}",
    ]


def test_the_newer_name_of_ardupilots_return_is_in_metres() -> None:
    proposal = proposed(COPTERS, "uav1", RTL_ALT_M=12.0)
    assert new_values(proposal) == {"RTL_ALT_M": COPTERS.return_height_m("uav1")}
    assert proposal.changes[0].unit == "m"


@pytest.mark.parametrize(
    ("autopilot", "name", "kind", "value"),
    [
        ("ardupilot", "RTL_ALT", INT32, 2034.0),
        ("ardupilot", "RTL_ALT", REAL32, 2034.0),
        ("ardupilot", "RTL_ALT_M", REAL32, 20.4),
        ("ardupilot", "RTL_ALT_M", INT32, 21.0),
        ("px4", "RTL_RETURN_ALT", REAL32, 20.4),
    ],
)
def test_a_height_is_rounded_up_to_what_its_parameter_holds(autopilot: str, name: str, kind: int, value: float) -> None:
    """Whole centimetres, tenths of a metre, or whole metres: never below its layer, which is at 20.333 m."""
    context = fleet_of(autopilot=autopilot, inspection={"height_m": 20.333}).context
    assert new_values(proposed(context, "uav1", kind, **{name: 5.0}))[name] == value


def test_px4_returns_in_its_own_layer() -> None:
    proposal = proposed(PX4S, "uav2", RTL_RETURN_ALT=60.0, RTL_DESCEND_ALT=10.0, RTL_CONE_ANG=45.0, RTL_LAND_DELAY=0.0)
    height_m = PX4S.return_height_m("uav2")
    assert new_values(proposal) == {"RTL_RETURN_ALT": height_m, "RTL_CONE_ANG": 0.0}, "it lands without a wait"
    assert proposal.changes[1].words_set == "RTL_CONE_ANG 45 -> 0 deg: climbs to that height near its pad, too"


@pytest.mark.parametrize("delay", [{"RTL_LAND_DELAY": -1.0}, {"RTL_LAND_DELAY": 30.0}, {}])
def test_px4_that_waits_before_it_lands_waits_in_its_own_layer(delay: dict[str, float]) -> None:
    proposal = proposed(PX4S, "uav2", REAL32, RTL_RETURN_ALT=60.0, RTL_DESCEND_ALT=10.0, RTL_CONE_ANG=0.0, **delay)
    height_m = PX4S.return_height_m("uav2")
    assert new_values(proposal) == {"RTL_RETURN_ALT": height_m, "RTL_DESCEND_ALT": height_m}


@pytest.mark.parametrize("slope", [0.0, 0.4])
def test_what_is_right_stays(slope: float) -> None:
    height_m = COPTERS.return_height_m("uav1")
    for above_m in (0.0, 0.5):
        proposal = proposed(COPTERS, "uav1", RTL_ALT=100 * (height_m + above_m), RTL_CONE_SLOPE=slope)
        assert proposal.changes == ()
        assert [check.severity for check in proposal.checks] == [Severity.OK]
    assert proposed(COPTERS, "uav1", RTL_ALT=100 * (height_m - 0.2)).changes, "it would return below its layer"
    assert proposed(COPTERS, "uav1", RTL_ALT=100 * (height_m + 1.0)).changes, "it would climb out of its layer"


def test_only_the_highest_vehicle_may_return_higher() -> None:
    """Above it there is nobody; whoever is lower would climb through the layers of others."""
    height_m = COPTERS.return_height_m("uav3")
    assert proposed(COPTERS, "uav3", RTL_ALT=100 * (height_m + 20.0)).changes == ()
    assert proposed(COPTERS, "uav2", RTL_ALT=100 * (height_m + 20.0)).changes
    assert proposed(COPTERS, "uav3", RTL_ALT=100 * (height_m + KEPT_HIGHER_M + 1.0)).changes, "it would cost too much"
    low = proposed(with_return_ceiling(COPTERS, height_m + 10.0), "uav3", RTL_ALT=100 * (height_m + 20.0))
    assert new_values(low) == {"RTL_ALT": 100 * height_m}, "it would be above the ceiling"


def test_a_vehicle_alone_keeps_what_its_crew_chose() -> None:
    alone = fleet_of({"uav1": (0, 2)}, autopilot="px4").context
    assert proposed(alone, "uav1", RTL_RETURN_ALT=60.0, RTL_CONE_ANG=0.0).changes == ()
    [low] = proposed(alone, "uav1", RTL_RETURN_ALT=10.0, RTL_CONE_ANG=0.0).changes
    assert low.why == "keeps its RTL above the line"


def test_an_unknown_rtl_height_stops_the_flight() -> None:
    proposal = proposed(COPTERS, "uav1", RTL_CONE_SLOPE=3.0)
    assert proposal.changes == ()
    [check] = proposal.checks
    assert check.severity is Severity.STOP
    assert check.text == (
        "RTL altitude not known: it has no RTL_ALT or RTL_ALT_M, so nothing keeps it clear of the others"
    )


def test_what_became_of_it() -> None:
    proposal = proposed(COPTERS, "uav1", RTL_ALT=1200.0, RTL_CONE_SLOPE=3.0)
    height_m = COPTERS.return_height_m("uav1")
    good = check_return_height(COPTERS, "uav1", proposal, {"RTL_ALT": "", "RTL_CONE_SLOPE": ""})
    assert (good.severity, good.text) == (Severity.OK, f"RTL altitude set to {height_m:g} m (RTL_ALT)")
    low = check_return_height(COPTERS, "uav1", proposal, {"RTL_ALT": "RTL_ALT stays 1200", "RTL_CONE_SLOPE": ""})
    assert low.severity is Severity.STOP
    assert low.text == (
        f"RTL altitude stays 12 m (RTL_ALT), not the {height_m:.0f} m that keep it clear of the others: "
        "RTL_ALT stays 1200"
    )
    beside = check_return_height(COPTERS, "uav1", proposal, {"RTL_ALT": "", "RTL_CONE_SLOPE": "RTL_CONE_SLOPE stays 3"})
    assert (beside.severity, beside.text) == (
        Severity.WARNING,
        f"RTL altitude set to {height_m:g} m, but RTL_CONE_SLOPE stays 3",
    )


def with_pad_at(context: Context, lower_m: float) -> Context:
    """Return a flight in which uav1 lands at another base as well, on lower ground."""
    home = context.setup.pad_of("uav1")
    other = Pad("uav1", home.east_m + 500.0, home.north_m, home.alt_m - lower_m)
    return replace(context, setup=replace(context.setup, day_pads=(home, other)))


def test_what_is_set_later_for_a_lower_pad_is_on_record_from_the_beginning() -> None:
    context, height_m = with_pad_at(COPTERS, 10.0), COPTERS.return_height_m("uav1")
    found = add_other_homes(context, proposed(context, "uav1", INT32, RTL_ALT=1200.0, RTL_CONE_SLOPE=0.0))
    [change] = found.changes
    assert (change.old, change.new, change.earlier) == (1200.0, 100 * height_m, (100 * (height_m + 10.0),))
    assert change.is_ours(100 * (height_m + 10.0))
    assert change.words_set.endswith(f"; {100 * (height_m + 10.0):.0f} at another of its pads")


def test_what_is_right_at_first_and_not_at_another_pad_is_on_record_too() -> None:
    context, height_m = with_pad_at(COPTERS, 10.0), COPTERS.return_height_m("uav1")
    found = add_other_homes(context, proposed(context, "uav1", RTL_ALT=100 * height_m, RTL_CONE_SLOPE=0.0))
    [change] = found.changes
    assert (change.old, change.new) == (100 * height_m, 100 * height_m)
    assert change.is_ours(100 * (height_m + 10.0))


def test_a_pad_on_the_same_ground_needs_nothing_else() -> None:
    context = with_pad_at(PX4S, 0.0)
    first = proposed(context, "uav1", RTL_RETURN_ALT=12.0)
    assert add_other_homes(context, first) == first

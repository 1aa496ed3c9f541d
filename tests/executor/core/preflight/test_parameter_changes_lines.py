"""Parameters set for a flight, their reasons, and how they are restored."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import pytest

from executor.core.context import Context
from executor.core.interface.codes import Check
from executor.core.interface.messages import ParamValue
from executor.core.preflight import parameter_changes
from executor.core.preflight.parameter_changes import KeptParameter
from missions import ARDUPILOT, PX4, list_other_names
from tests.executor.builders import fleet_of
from tests.executor.core.preflight.test_parameter_changes_proposed import with_return_ceiling
from tests.executor.core.steps import rounded
from tests.executor.core.vehicles import FLEET

CONTEXT = FLEET.context
UNEVEN = fleet_of(autopilot="px4").context
UNDER_CEILING = with_return_ceiling(CONTEXT, 40.0)
CHANGE = KeptParameter("uav1", 1, "ardupilot", "RTL_ALT", 3000.0, 1500.0, 4, "cm", "why")


def lines(checks: Check | Sequence[Check]) -> list[str]:
    return [f"{one.severity.value}: {one.text}" for one in ([checks] if isinstance(checks, Check) else checks)]


def known(**values: float) -> Mapping[str, ParamValue]:
    return {name: ParamValue(name, value, 9 if name.endswith("_M") else 4) for name, value in values.items()}


def proposed(said: Mapping[str, ParamValue], name: str = "uav1", context: Context = CONTEXT) -> list[str]:
    found = parameter_changes.propose_return_changes(context, {name: parameter_changes.Answers(said)})
    return [one.words_set for one in found.changes] + lines(found.checks)


def settled(ends: Mapping[str, str], said: Mapping[str, ParamValue]) -> list[str]:
    found = parameter_changes.propose_return_changes(CONTEXT, {"uav1": parameter_changes.Answers(said)})
    return lines(parameter_changes.check_return_height(CONTEXT, "uav1", found, ends))


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a height that is right",
        lambda: [proposed(known(RTL_ALT=value)) for value in (1499.0, 1500.0, 1550.0, 1551.0, 1498.0)],
        [
            ["ok: RTL altitude is 15 m (RTL_ALT)"],
            ["ok: RTL altitude is 15 m (RTL_ALT)"],
            ["ok: RTL altitude is 15.5 m (RTL_ALT)"],
            [
                "RTL_ALT 1551 -> 1500 cm: keeps its RTL in its own layer",
                "ok: RTL altitude will be 15 m (RTL_ALT)",
                "ok: to be set for the flight: RTL_ALT 1551 -> 1500 cm: keeps its RTL in its own layer",
            ],
            [
                "RTL_ALT 1498 -> 1500 cm: keeps its RTL in its own layer",
                "ok: RTL altitude will be 15 m (RTL_ALT)",
                "ok: to be set for the flight: RTL_ALT 1498 -> 1500 cm: keeps its RTL in its own layer",
            ],
        ],
    ),
    (
        "a height of the highest",
        lambda: [proposed(known(RTL_ALT=value), "uav3") for value in (3000.0, 7000.0, 7600.0, 9000.0)],
        [
            ["ok: RTL altitude is 30 m (RTL_ALT)"],
            ["ok: RTL altitude is 70 m (RTL_ALT)"],
            ["ok: RTL altitude is 76 m (RTL_ALT)"],
            [
                "RTL_ALT 9000 -> 2700 cm: keeps its RTL in its own layer",
                "ok: RTL altitude will be 27 m (RTL_ALT)",
                "ok: to be set for the flight: RTL_ALT 9000 -> 2700 cm: keeps its RTL in its own layer",
            ],
        ],
    ),
    (
        "a height of the highest under a ceiling",
        lambda: [
            proposed(known(RTL_ALT=value), "uav3", with_return_ceiling(CONTEXT, 40.0)) for value in (4000.0, 4001.0)
        ],
        [
            ["ok: RTL altitude is 40 m (RTL_ALT)"],
            [
                "RTL_ALT 4001 -> 2700 cm: keeps its RTL in its own layer",
                "ok: RTL altitude will be 27 m (RTL_ALT)",
                "ok: to be set for the flight: RTL_ALT 4001 -> 2700 cm: keeps its RTL in its own layer",
            ],
        ],
    ),
    (
        "a height of newer firmware",
        lambda: [
            proposed(known(**values))
            for values in ({"RTL_ALT_M": 30.0}, {"RTL_ALT_M": 15.0}, {"RTL_ALT_M": 30.0, "RTL_ALT": 1500.0}, {})
        ],
        [
            [
                "RTL_ALT_M 30 -> 15 m: keeps its RTL in its own layer",
                "ok: RTL altitude will be 15 m (RTL_ALT_M)",
                "ok: to be set for the flight: RTL_ALT_M 30 -> 15 m: keeps its RTL in its own layer",
            ],
            ["ok: RTL altitude is 15 m (RTL_ALT_M)"],
            ["ok: RTL altitude is 15 m (RTL_ALT)"],
            ["stop: RTL altitude not known: it has no RTL_ALT or RTL_ALT_M, so nothing keeps it clear of the others"],
        ],
    ),
    (
        "a cone",
        lambda: [proposed(known(RTL_ALT=1500.0, RTL_CONE_SLOPE=value)) for value in (0.0, 0.4, 0.5, 3.0)],
        [
            ["ok: RTL altitude is 15 m (RTL_ALT)"],
            ["ok: RTL altitude is 15 m (RTL_ALT)"],
            [
                "RTL_CONE_SLOPE 0.5 -> 0: climbs to that height near its pad, too",
                "ok: RTL altitude is 15 m (RTL_ALT)",
                ("ok: to be set for the flight: RTL_CONE_SLOPE 0.5 -> 0: climbs to that height near its pad, too"),
            ],
            [
                "RTL_CONE_SLOPE 3 -> 0: climbs to that height near its pad, too",
                "ok: RTL altitude is 15 m (RTL_ALT)",
                ("ok: to be set for the flight: RTL_CONE_SLOPE 3 -> 0: climbs to that height near its pad, too"),
            ],
        ],
    ),
    (
        "a return of PX4's",
        lambda: [
            proposed(known(**values), "uav1", UNEVEN)
            for values in (
                {"RTL_RETURN_ALT": 15.0, "RTL_DESCEND_ALT": 10.0, "RTL_LAND_DELAY": 0.0},
                {"RTL_RETURN_ALT": 15.0, "RTL_DESCEND_ALT": 10.0, "RTL_LAND_DELAY": 5.0},
                {"RTL_RETURN_ALT": 60.0, "RTL_DESCEND_ALT": 10.0},
                {"RTL_RETURN_ALT": 15.0, "RTL_DESCEND_ALT": 15.0},
                {"RTL_RETURN_ALT": 15.0, "RTL_CONE_ANG": 45.0},
            )
        ],
        [
            ["ok: RTL altitude is 15 m (RTL_RETURN_ALT)"],
            [
                "RTL_DESCEND_ALT 10 -> 15 m: waits over its pad in its own layer",
                "ok: RTL altitude is 15 m (RTL_RETURN_ALT)",
                ("ok: to be set for the flight: RTL_DESCEND_ALT 10 -> 15 m: waits over its pad in its own layer"),
            ],
            [
                "RTL_RETURN_ALT 60 -> 15 m: keeps its RTL in its own layer",
                "RTL_DESCEND_ALT 10 -> 15 m: waits over its pad in its own layer",
                "ok: RTL altitude will be 15 m (RTL_RETURN_ALT)",
                "ok: to be set for the flight: RTL_RETURN_ALT 60 -> 15 m: keeps its RTL in its own layer",
                ("ok: to be set for the flight: RTL_DESCEND_ALT 10 -> 15 m: waits over its pad in its own layer"),
            ],
            ["ok: RTL altitude is 15 m (RTL_RETURN_ALT)"],
            [
                "RTL_CONE_ANG 45 -> 0 deg: climbs to that height near its pad, too",
                "ok: RTL altitude is 15 m (RTL_RETURN_ALT)",
                ("ok: to be set for the flight: RTL_CONE_ANG 45 -> 0 deg: climbs to that height near its pad, too"),
            ],
        ],
    ),
    (
        "a height once it is set",
        lambda: [
            settled(ends, known(RTL_ALT=3000.0))
            for ends in (
                {},
                {"RTL_ALT": ""},
                {"RTL_ALT": "RTL_ALT stays 3000"},
                {"RTL_CONE_SLOPE": "RTL_CONE_SLOPE: no answer"},
            )
        ],
        [
            ["ok: RTL altitude set to 15 m (RTL_ALT)"],
            ["ok: RTL altitude set to 15 m (RTL_ALT)"],
            [
                (
                    "stop: RTL altitude stays 30 m (RTL_ALT), not the 15 m that keep it clear of the others: "
                    "RTL_ALT stays 3000"
                )
            ],
            ["warning: RTL altitude set to 15 m, but RTL_CONE_SLOPE: no answer"],
        ],
    ),
    (
        "requested parameters",
        lambda: [
            (
                parameter_changes.list_return_parameters(dialect),
                list_other_names(dialect, parameter_changes.list_return_parameters(dialect)),
                list_other_names(dialect, parameter_changes.list_return_parameters(dialect), known(RTL_ALT=1.0)),
            )
            for dialect in (ARDUPILOT, PX4)
        ],
        [
            (("RTL_ALT", "RTL_CONE_SLOPE"), ("RTL_ALT_M",), ()),
            (("RTL_RETURN_ALT", "RTL_CONE_ANG", "RTL_DESCEND_ALT", "RTL_LAND_DELAY"), (), ()),
        ],
    ),
    (
        "heights are rounded up",
        lambda: [
            parameter_changes._round_up_height(height_m, unit_m, kind)
            for height_m, unit_m, kind in (
                (15.001, 0.01, 4),
                (15.0, 0.01, 4),
                (15.01, 1.0, 9),
                (15.01, 1.0, 4),
                (15.0000000001, 0.01, 9),
            )
        ],
        [1501.0, 1500.0, 15.1, 16.0, 1500.0],
    ),
    (
        "reasons for a height",
        lambda: [
            parameter_changes._explain_return_height(context) for context in (CONTEXT, fleet_of({"uav1": (0,)}).context)
        ],
        ["keeps its RTL in its own layer", "keeps its RTL above the line"],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected

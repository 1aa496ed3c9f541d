"""What comes back from ArduPilot, as it was read from Copter 4.7-dev."""

from __future__ import annotations

import pytest

from missions.items import Command, Frame, MissionItem
from missions.stored_items import predict_stored_item

RELATIVE = Frame.GLOBAL_RELATIVE_ALT


@pytest.mark.parametrize(
    ("sent", "stored"),
    [
        (
            MissionItem(3, RELATIVE, Command.NAV_WAYPOINT, 1.5, x=1, y=2, z=15.0, current=True),
            MissionItem(3, RELATIVE, Command.NAV_WAYPOINT, 1.0, x=1, y=2, z=15.0),
        ),
        (
            MissionItem(4, RELATIVE, Command.DO_CHANGE_SPEED, 1.0, 3.0, -1.0),
            MissionItem(4, Frame.GLOBAL, Command.DO_CHANGE_SPEED, 1.0, 3.0, -1.0),
        ),
        (
            MissionItem(5, Frame.GLOBAL_RELATIVE_ALT_INT, Command.NAV_LAND, x=1, y=2),
            MissionItem(5, RELATIVE, Command.NAV_LAND, param4=1.0, x=1, y=2),
        ),
        (
            MissionItem(6, RELATIVE, Command.NAV_RETURN_TO_LAUNCH, 1.0, 4.0, 50.0, 7.0, x=1, y=2, z=20.0),
            MissionItem(6, Frame.GLOBAL, Command.NAV_RETURN_TO_LAUNCH),
        ),
        (
            MissionItem(7, RELATIVE, Command.DO_CHANGE_SPEED, 1.0, 3.0, -1.0, 7.0, x=1, y=2, z=20.0),
            MissionItem(7, Frame.GLOBAL, Command.DO_CHANGE_SPEED, 1.0, 3.0, -1.0),
        ),
    ],
    ids=["hold and current", "speed", "landing", "a return with a place", "a speed with a place"],
)
def test_what_it_makes_of_an_item(sent: MissionItem, stored: MissionItem) -> None:
    assert predict_stored_item(sent) == stored


@pytest.mark.parametrize(("sent_m", "stored_cm"), [(21.37, 2137), (16.379, 1637), (-3.999, -399)])
def test_heights_are_cut_to_centimetres(sent_m: float, stored_cm: int) -> None:
    stored = predict_stored_item(MissionItem(1, RELATIVE, Command.NAV_WAYPOINT, z=sent_m))
    assert stored.z == pytest.approx(stored_cm / 100, abs=1e-5)

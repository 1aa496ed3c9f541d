"""The parameter protocol in both dialects."""

from __future__ import annotations

import struct

import pytest

from simulator.config import AutopilotKind
from simulator.messages import ParamRequestList, ParamRequestRead, ParamSet
from simulator.params import UNINDEXED
from tests.simulator.harness import Operator, fields_of


@pytest.mark.parametrize("kind", list(AutopilotKind))
def test_the_list_is_complete_and_consistent(kind: AutopilotKind) -> None:
    values = [fields_of(answer) for answer in Operator(kind).send(ParamRequestList())]
    assert [value["param_index"] for value in values] == list(range(len(values)))
    assert {value["param_count"] for value in values} == {len(values)}
    names = [value["param_id"] for value in values]
    assert len(set(names)) == len(names)
    assert all(isinstance(name, bytes) and len(name) <= 16 for name in names)


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        (AutopilotKind.ARDUPILOT, "RTL_ALT", 1500),
        (AutopilotKind.ARDUPILOT, "MAV_GCS_SYSID", 255),
        (AutopilotKind.ARDUPILOT, "MAV_SYSID", 11),
        (AutopilotKind.ARDUPILOT, "FS_GCS_ENABLE", 1),
        (AutopilotKind.ARDUPILOT, "WPNAV_SPEED", 1000),
        (AutopilotKind.PX4, "RTL_RETURN_ALT", 60),
        (AutopilotKind.PX4, "COM_DL_LOSS_T", 10),
        (AutopilotKind.PX4, "MPC_XY_CRUISE", 5),
    ],
)
def test_the_parameters_that_a_ground_station_asks_for(kind: AutopilotKind, name: str, value: float) -> None:
    operator = Operator(kind)
    assert operator.vehicle.params[name] == value
    (answer,) = operator.send(ParamRequestRead(name, -1))
    index = fields_of(answer)["param_index"]
    if kind is AutopilotKind.ARDUPILOT:
        assert index == UNINDEXED
        return
    assert isinstance(index, int)
    assert fields_of(next(iter(operator.send(ParamRequestRead("", index)))))["param_id"] == name.encode()


@pytest.mark.parametrize("kind", list(AutopilotKind))
def test_an_unknown_parameter_gets_no_answer(kind: AutopilotKind) -> None:
    operator = Operator(kind)
    assert operator.send(ParamRequestRead("SYSID_MYGCS", -1)) == []
    assert operator.send(ParamSet("SYSID_MYGCS", 1.0, 9)) == []


def test_ardupilot_sends_integers_as_numbers() -> None:
    operator = Operator(AutopilotKind.ARDUPILOT)
    (answer,) = operator.send(ParamSet("FS_GCS_ENABLE", 5.0, 2))
    assert fields_of(answer)["param_value"] == 5.0
    assert operator.vehicle.params["FS_GCS_ENABLE"] == 5


@pytest.mark.parametrize("value", [0, 2, -1])
def test_px4_hides_the_bits_of_integers_in_the_float(value: int) -> None:
    operator = Operator(AutopilotKind.PX4)
    raw = struct.unpack("<f", struct.pack("<i", value))[0]
    (answer,) = operator.send(ParamSet("NAV_DLL_ACT", raw, 6))
    assert operator.vehicle.params["NAV_DLL_ACT"] == value
    sent = fields_of(answer)["param_value"]
    assert isinstance(sent, float)
    assert struct.pack("<f", sent) == struct.pack("<i", value)


def test_px4_floats_are_floats() -> None:
    operator = Operator(AutopilotKind.PX4)
    (answer,) = operator.send(ParamSet("BAT_LOW_THR", 0.25, 9))
    assert fields_of(answer)["param_value"] == 0.25


def test_parameters_survive_a_restart() -> None:
    operator = Operator(AutopilotKind.ARDUPILOT)
    operator.send(ParamSet("RTL_ALT", 3000.0, 6))
    operator.vehicle.reboot()
    operator.run(10)
    assert operator.vehicle.params["RTL_ALT"] == 3000

"""Autopilot parameters: the names and defaults that ground stations ask for, and how each dialect sends them."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import partial

from simulator.config import AutopilotKind, FleetError, SimVehicle
from simulator.messages import Outbound, ParamRequestList, ParamRequestRead, ParamSet, build_message

UNINDEXED = 65535
"""param_index of a value that was not asked for by its index."""


class ParamKind(IntEnum):
    """MAV_PARAM_TYPE, as far as used."""

    INT8 = 2
    INT16 = 4
    INT32 = 6
    REAL32 = 9


@dataclass(frozen=True, slots=True)
class Param:
    """A default."""

    value: float
    kind: ParamKind = ParamKind.REAL32


_int8_param = partial(Param, kind=ParamKind.INT8)
_int16_param = partial(Param, kind=ParamKind.INT16)
_int32_param = partial(Param, kind=ParamKind.INT32)

# Copter 4.7: SYSID_MYGCS is MAV_GCS_SYSID. Heights and speeds are in centimetres. FS_GCS_ENABLE is 0 in the firmware;
# here it is 1 so that a vehicle that is left alone comes home.
ARDUPILOT: Mapping[str, Param] = {
    "MAV_GCS_SYSID": _int16_param(255), "FRAME_CLASS": _int8_param(1), "FRAME_TYPE": _int8_param(1),
    "STAT_RUNTIME": _int32_param(0),
    "FS_GCS_ENABLE": _int8_param(1), "FS_GCS_TIMEOUT": Param(5), "FS_OPTIONS": _int32_param(0),
    "FS_THR_ENABLE": _int8_param(0),
    "RTL_ALT": _int32_param(1500), "RTL_SPEED": _int16_param(0), "RTL_LOIT_TIME": _int32_param(5000),
    "RTL_ALT_FINAL": _int16_param(0),
    "RTL_CONE_SLOPE": Param(3),
    "WPNAV_SPEED": Param(1000), "WPNAV_SPEED_UP": Param(250), "WPNAV_SPEED_DN": Param(150), "WPNAV_RADIUS": Param(200),
    "WPNAV_ACCEL": Param(250), "WPNAV_ACCEL_Z": Param(100), "WPNAV_JERK": Param(1), "LAND_SPEED": _int16_param(50),
    "LAND_ALT_LOW": _int16_param(1000), "DISARM_DELAY": _int8_param(10),
    "AUTO_OPTIONS": _int32_param(0), "MIS_RESTART": _int8_param(0), "MIS_OPTIONS": _int16_param(0),
    "ARMING_CHECK": _int32_param(1),
    "BATT_MONITOR": _int8_param(4), "MOT_BAT_VOLT_MAX": Param(0), "BATT_CAPACITY": _int32_param(0),
    "BATT_LOW_VOLT": Param(0),
    "BATT_LOW_MAH": Param(0),
    "BATT_CRT_VOLT": Param(0), "BATT_CRT_MAH": Param(0), "BATT_LOW_TIMER": _int8_param(10),
    "BATT_FS_LOW_ACT": _int8_param(0),
    "BATT_FS_CRT_ACT": _int8_param(0), "BATT_ARM_VOLT": Param(0), "BATT_ARM_MAH": _int32_param(0),
    "FENCE_ENABLE": _int8_param(0),
    "FENCE_AUTOENABLE": _int8_param(0), "FENCE_TYPE": _int8_param(7), "FENCE_ALT_MAX": Param(100),
    "FENCE_RADIUS": Param(300),
    "FENCE_ACTION": _int8_param(1), "RALLY_LIMIT_KM": Param(0.3), "CAM1_TYPE": _int8_param(0),
}  # fmt: skip
# PX4 1.17. NAV_DLL_ACT is 0 in the firmware; here it is 2, for the same reason.
PX4: Mapping[str, Param] = {
    "MAV_TYPE": _int32_param(2), "SYS_AUTOSTART": _int32_param(4001), "NAV_DLL_ACT": _int32_param(2),
    "NAV_RCL_ACT": _int32_param(2),
    "COM_DL_LOSS_T": _int32_param(10), "COM_FAIL_ACT_T": Param(5), "COM_LOW_BAT_ACT": _int32_param(0),
    "COM_FLTT_LOW_ACT": _int32_param(0),
    "COM_DISARM_LAND": Param(2),
    "COM_RC_IN_MODE": _int32_param(1), "BAT_LOW_THR": Param(0.15), "BAT_CRIT_THR": Param(0.07),
    "BAT_EMERGEN_THR": Param(0.05),
    "BAT1_CAPACITY": Param(-1), "BAT1_N_CELLS": _int32_param(0), "RTL_TYPE": _int32_param(0),
    "RTL_RETURN_ALT": Param(60),
    "RTL_DESCEND_ALT": Param(30), "RTL_LAND_DELAY": Param(0), "RTL_CONE_ANG": _int32_param(45),
    "MPC_XY_CRUISE": Param(5),
    "MPC_XY_VEL_MAX": Param(12), "MPC_Z_VEL_MAX_UP": Param(3), "MPC_Z_VEL_MAX_DN": Param(1.5),
    "MPC_TKO_SPEED": Param(1.5), "MPC_ACC_HOR": Param(3), "MPC_Z_V_AUTO_UP": Param(3), "MPC_Z_V_AUTO_DN": Param(1.5),
    "MPC_LAND_SPEED": Param(0.7), "NAV_ACC_RAD": Param(2), "MIS_TAKEOFF_ALT": Param(2.5),
    "MIS_TKO_LAND_REQ": _int32_param(0), "GF_ACTION": _int32_param(2), "GF_MAX_HOR_DIST": Param(0),
    "GF_MAX_VER_DIST": Param(0),
    "COM_DLL_EXCEPT": _int32_param(0), "TRIG_MODE": _int32_param(0),
}  # fmt: skip
LOW_CELL_V = 3.5
"""BATT_LOW_VOLT for each cell: ArduPilot's default of 10.5 V is for three."""


def defaults_for(vehicle: SimVehicle, capacity_mah: float) -> dict[str, Param]:
    """Return the vehicle's parameters as they are after it was set up: dialect, identity, battery, overrides.

    Raises:
        FleetError: an override names a parameter that the dialect does not have.
    """
    if vehicle.autopilot is AutopilotKind.ARDUPILOT:
        table = dict(ARDUPILOT)
        table["MAV_SYSID"] = _int16_param(vehicle.sysid)
        table["BATT_CAPACITY"] = _int32_param(round(capacity_mah))
        table["BATT_LOW_VOLT"] = Param(LOW_CELL_V * vehicle.drone.cells)
        table["BATT_MONITOR"] = _int8_param(4 if vehicle.current_sensor else 3)
    else:
        table = dict(PX4)
        table["MAV_SYS_ID"] = _int32_param(vehicle.sysid)
        table["BAT1_CAPACITY"] = Param(capacity_mah)
        table["BAT1_N_CELLS"] = _int32_param(vehicle.drone.cells)
    if vehicle.cameras:  # whoever mounts one sets its autopilot up for it
        table |= (
            {"CAM1_TYPE": _int8_param(1)}
            if vehicle.autopilot is AutopilotKind.ARDUPILOT
            else {"TRIG_MODE": _int32_param(4)}
        )
    for name, value in vehicle.parameters.items():
        if name not in table:
            raise FleetError(
                f"vehicle {vehicle.name!r}: no parameter {name!r}, expected one of {', '.join(sorted(table))}"
            )
        table[name] = Param(value, table[name].kind)
    return table


class ParamTable:
    """The vehicle's side of the parameter protocol."""

    def __init__(self, table: Mapping[str, Param], *, bytewise: bool) -> None:
        self._kinds = {name: param.kind for name, param in sorted(table.items())}
        self._values = {name: table[name].value for name in self._kinds}
        self._names = list(self._kinds)
        self._bytewise = bytewise
        """Whether integers travel as their bits (PX4) or as numbers (ArduPilot)."""
        self.hidden: set[str] = set()
        """What it does not answer for, as a firmware that does not have it."""

    def __getitem__(self, name: str) -> float:
        """Return the value of a parameter that the dialect has."""
        return self._values[name]

    def __setitem__(self, name: str, value: float) -> None:
        """Have another value from now on, as after a boot that lost one; unknown names are refused.

        Raises:
            KeyError: there is no such parameter.
        """
        if name not in self._values:
            raise KeyError(name)
        self._values[name] = value

    def answer(self, request: ParamRequestList | ParamRequestRead | ParamSet) -> Iterator[Outbound]:
        """Yield the answers; an unknown name gets none, as both autopilots do."""
        match request:
            case ParamRequestRead(name=name) | ParamSet(name=name) if name in self.hidden:
                return
            case ParamRequestList():
                for index in range(len(self._names)):
                    yield self._build_param_value(index, index)
            case ParamRequestRead(index=index) if 0 <= index < len(self._names):
                yield self._build_param_value(index, index)
            case ParamRequestRead(name=name) if name in self._values:
                index = self._names.index(name)
                yield self._build_param_value(index, index if self._bytewise else UNINDEXED)
            case ParamSet(name=name, raw=raw, kind=kind) if name in self._values:
                integer = self._bytewise and kind != ParamKind.REAL32
                value = float(struct.unpack("<i", struct.pack("<f", raw))[0]) if integer else raw
                self._values[name] = value if self._kinds[name] is ParamKind.REAL32 else float(round(value))
                yield self._build_param_value(self._names.index(name), UNINDEXED)
            case _:
                return

    def _build_param_value(self, position: int, index: int) -> Outbound:
        name = self._names[position]
        kind, value = self._kinds[name], self._values[name]
        if self._bytewise and kind is not ParamKind.REAL32:
            value = struct.unpack("<f", struct.pack("<i", int(value)))[0]
        return build_message(
            "PARAM_VALUE",
            param_id=name.encode("ascii"),
            param_value=value,
            param_type=int(kind),
            param_count=len(self._names),
            param_index=index,
        )

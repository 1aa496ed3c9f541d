"""Autopilot parameters: names and defaults that ground stations read, and their encoding in each dialect."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import takewhile

from simulator.config import AutopilotKind, SimVehicle
from simulator.errors import FleetError
from simulator.messages import Outbound, ParamRequestList, ParamRequestRead, ParamSet, build_message

PACKED_PARAMETERS = "@PARAM/param.pck"
"""ArduPilot's parameters as a file."""
PACKED_HEADER = struct.Struct("<HHH")
"""Magic, number of parameters in the file and in total."""
PACKED, PACKED_WITH_DEFAULTS = 0x671B, 0x671C
PACKED_PARAM_BYTES = 12
"""Estimated bytes per parameter."""
UNINDEXED = 65535
"""param_index of a value not requested by index."""


class ParamKind(IntEnum):
    """MAV_PARAM_TYPE, as far as used."""

    INT8 = 2
    INT16 = 4
    INT32 = 6
    REAL32 = 9


@dataclass(frozen=True, slots=True)
class Param:
    """A parameter's default."""

    value: float
    kind: ParamKind = ParamKind.REAL32


PACKED_FORMATS = {
    ParamKind.INT8: (1, "<b"), ParamKind.INT16: (2, "<h"), ParamKind.INT32: (3, "<i"), ParamKind.REAL32: (4, "<f"),
}  # fmt: skip
"""ArduPilot's type number and format in the file."""


def _build_table(**values: Mapping[str, float]) -> dict[str, Param]:
    return {name: Param(value, ParamKind[kind.upper()]) for kind, own in values.items() for name, value in own.items()}


# Copter 4.7: SYSID_MYGCS is MAV_GCS_SYSID. Heights and speeds are in centimetres. FS_GCS_ENABLE is 0 in the firmware;
# here it is 1 so that a vehicle that loses its link returns.
ARDUPILOT = _build_table(
    int8={
        "FRAME_CLASS": 1, "FRAME_TYPE": 1, "FS_GCS_ENABLE": 1, "FS_THR_ENABLE": 0, "DISARM_DELAY": 10, "MIS_RESTART": 0,
        "BATT_MONITOR": 4, "BATT_LOW_TIMER": 10, "BATT_FS_LOW_ACT": 0, "BATT_FS_CRT_ACT": 0, "FENCE_ENABLE": 0,
        "FENCE_AUTOENABLE": 0, "FENCE_TYPE": 7, "FENCE_ACTION": 1, "CAM1_TYPE": 0,
    },
    int16={
        "MAV_GCS_SYSID": 255, "RTL_SPEED": 0, "RTL_ALT_FINAL": 0, "LAND_SPEED": 50, "LAND_ALT_LOW": 1000,
        "MIS_OPTIONS": 0,
    },
    int32={
        "STAT_RUNTIME": 0, "FS_OPTIONS": 0, "RTL_ALT": 1500, "RTL_LOIT_TIME": 5000, "AUTO_OPTIONS": 0,
        "ARMING_CHECK": 1, "BATT_CAPACITY": 0, "BATT_ARM_MAH": 0,
    },
    real32={
        "FS_GCS_TIMEOUT": 5, "RTL_CONE_SLOPE": 3, "WPNAV_SPEED": 1000, "WPNAV_SPEED_UP": 250, "WPNAV_SPEED_DN": 150,
        "WPNAV_RADIUS": 200, "WPNAV_ACCEL": 250, "WPNAV_ACCEL_Z": 100, "WPNAV_JERK": 1, "MOT_BAT_VOLT_MAX": 0,
        "BATT_LOW_VOLT": 0, "BATT_LOW_MAH": 0, "BATT_CRT_VOLT": 0, "BATT_CRT_MAH": 0, "BATT_ARM_VOLT": 0,
        "FENCE_ALT_MAX": 100, "FENCE_RADIUS": 300, "RALLY_LIMIT_KM": 0.3, "GUID_TIMEOUT": 3,
    },
)  # fmt: skip
# PX4 1.17. NAV_DLL_ACT is 0 in the firmware; here it is 2, for the same reason. SYS_FAILURE_EN is 1 where it is
# simulated.
PX4 = _build_table(
    int32={
        "MAV_TYPE": 2, "SYS_AUTOSTART": 4001, "NAV_DLL_ACT": 2, "NAV_RCL_ACT": 2, "COM_DL_LOSS_T": 10,
        "COM_LOW_BAT_ACT": 0, "COM_FLTT_LOW_ACT": 0, "COM_RC_IN_MODE": 1, "BAT1_N_CELLS": 0, "RTL_TYPE": 0,
        "RTL_CONE_ANG": 45, "MIS_TKO_LAND_REQ": 0, "GF_ACTION": 2, "COM_DLL_EXCEPT": 0, "TRIG_MODE": 0,
        "SYS_FAILURE_EN": 1,
    },
    real32={
        "COM_FAIL_ACT_T": 5, "COM_DISARM_LAND": 2, "BAT_LOW_THR": 0.15, "BAT_CRIT_THR": 0.07, "BAT_EMERGEN_THR": 0.05,
        "BAT1_CAPACITY": -1, "RTL_RETURN_ALT": 60, "RTL_DESCEND_ALT": 30, "RTL_LAND_DELAY": 0, "MPC_XY_CRUISE": 5,
        "MPC_XY_VEL_MAX": 12, "MPC_Z_VEL_MAX_UP": 3, "MPC_Z_VEL_MAX_DN": 1.5, "MPC_TKO_SPEED": 1.5, "MPC_ACC_HOR": 3,
        "MPC_Z_V_AUTO_UP": 3, "MPC_Z_V_AUTO_DN": 1.5, "MPC_LAND_SPEED": 0.7, "NAV_ACC_RAD": 2, "MIS_TAKEOFF_ALT": 2.5,
        "GF_MAX_HOR_DIST": 0, "GF_MAX_VER_DIST": 0, "COM_OF_LOSS_T": 1, "MC_ORBIT_RAD_MAX": 1000,
    },
)  # fmt: skip
LOW_CELL_V = 3.5
"""BATT_LOW_VOLT per cell: ArduPilot's default of 10.5 V is for three."""


def defaults_for(vehicle: SimVehicle, capacity_mah: float) -> dict[str, Param]:
    """Return the vehicle's parameters after set-up: dialect, identity, battery, overrides.

    Raises:
        FleetError: an override names a parameter that the dialect does not have.
    """
    if vehicle.autopilot is AutopilotKind.ARDUPILOT:
        table = dict(ARDUPILOT)
        table["MAV_SYSID"] = Param(vehicle.sysid, ParamKind.INT16)
        table["BATT_CAPACITY"] = Param(round(capacity_mah), ParamKind.INT32)
        table["BATT_LOW_VOLT"] = Param(LOW_CELL_V * vehicle.drone.cells)
        table["BATT_MONITOR"] = Param(4 if vehicle.current_sensor else 3, ParamKind.INT8)
    else:
        table = dict(PX4)
        table["MAV_SYS_ID"] = Param(vehicle.sysid, ParamKind.INT32)
        table["BAT1_CAPACITY"] = Param(capacity_mah)
        table["BAT1_N_CELLS"] = Param(vehicle.drone.cells, ParamKind.INT32)
    if vehicle.cameras:  # the installer of a camera also sets its parameters
        name, value = ("CAM1_TYPE", 1.0) if vehicle.autopilot is AutopilotKind.ARDUPILOT else ("TRIG_MODE", 4.0)
        table[name] = replace(table[name], value=value)
    for name, value in vehicle.parameters.items():
        if name not in table:
            raise FleetError(
                f"vehicle {vehicle.name!r}: no parameter {name!r}, expected one of {', '.join(sorted(table))}"
            )
        table[name] = replace(table[name], value=value)
    return table


class ParamTable:
    """The vehicle's side of the parameter protocol."""

    def __init__(self, table: Mapping[str, Param], *, bytewise: bool) -> None:
        self._kinds = {name: param.kind for name, param in sorted(table.items())}
        self._values = {name: table[name].value for name in self._kinds}
        self._names = list(self._kinds)
        self._defaults = dict(self._values)
        self._bytewise = bytewise
        """Whether integers are sent bytewise (PX4) or as numbers (ArduPilot)."""
        self.hidden: set[str] = set()
        """Parameters that it does not answer for, like firmware without them."""

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._names)

    def __setitem__(self, name: str, value: float) -> None:
        """Change a value from now on, as after a boot that lost one; unknown names are refused.

        Raises:
            KeyError: there is no such parameter.
        """
        if name not in self._values:
            raise KeyError(name)
        self._values[name] = value

    def answer(self, request: ParamRequestList | ParamRequestRead | ParamSet) -> Iterator[Outbound]:
        """Yield the answers; an unknown name gets none, as with both autopilots."""
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

    @property
    def packed_bytes(self) -> int:
        """Reported size of the packed file."""
        return PACKED_PARAM_BYTES * len(self._names)

    def pack(self, block: int, *, with_defaults: bool = False) -> bytes:
        """Return the file of all parameters after AP_Filesystem_Param.cpp: no value crosses the end of a block."""
        magic = PACKED_WITH_DEFAULTS if with_defaults else PACKED
        packed, before = PACKED_HEADER.pack(magic, len(self._names), len(self._names)), ""
        for name in self._names:
            number, layout = PACKED_FORMATS[self._kinds[name]]
            to_number = float if layout == "<f" else int
            values = [to_number(self._values[name])]
            if with_defaults and self._values[name] != self._defaults[name]:
                values.append(to_number(self._defaults[name]))
            same = takewhile(lambda pair: pair[0] == pair[1], zip(name, before, strict=False))
            common = min(sum(1 for _ in same), len(name) - 1)
            own, before = name[common:].encode("ascii"), name
            entry = bytes([number | (len(values) - 1) << 4, common | (len(own) - 1) << 4]) + own
            entry += b"".join(struct.pack(layout, value) for value in values)
            over = (len(packed) + len(entry)) % block
            size = struct.calcsize(layout)
            packed += (bytes(size - over) if 0 < over < size else b"") + entry
        return packed

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

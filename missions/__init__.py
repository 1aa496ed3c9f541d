# Part of faultline.
"""The power line, the flights over it, and mission items as data: everything between a plan and a MAVLink message.

>>> network = read_network(default_network_path(), radius_m=700)
>>> setup = flight_setup(network, ["uav1", "uav2"], Inspection())
>>> path = flight_path(setup, "uav1", [0, 2, 4])
>>> mission = encode(path, PX4)
>>> mission.items[0].command.name
'NAV_TAKEOFF'
"""

from missions.autopilots.ardupilot import ARDUPILOT
from missions.autopilots.dialect import Dialect, ModeNumber, Modes, ReturnParameters, SetCurrent, StartStep
from missions.autopilots.failsafes import (
    BatteryFailsafe,
    BatteryLevel,
    EarlyReturn,
    Geofence,
    GroundStationFailsafe,
    ThresholdUnit,
    Words,
)
from missions.autopilots.px4 import PX4
from missions.autopilots.registry import AUTOPILOTS, dialect_for, dialect_of
from missions.clearance import (
    OverGround,
    check_ceiling,
    check_clearance,
    check_everywhere,
    highest_return_m,
    lowest_over_tops_m,
    margin_m,
    over_ground_m,
    return_over_ground_m,
)
from missions.compare import alike, differences
from missions.dayplan import BasePlace, DayPlanFile, check_day_plan
from missions.dayplanjson import day_plan_document, is_day_plan, read_day_plan, write_day_plan
from missions.encode import EncodedMission, encode, flag_current
from missions.errors import (
    EncodeError,
    MissionFileError,
    MissionsError,
    NetworkError,
    PlanFileError,
    SafetyError,
)
from missions.estimate import Estimate, LegEstimate, estimate
from missions.files import NESTED, parse_json, read_text
from missions.flight_model import Base, FlightModel
from missions.geo import LocalFrame
from missions.heights import implausible, with_heights
from missions.items import Command, Frame, MissionItem, MissionKind
from missions.network import Network, Pylon, Segment
from missions.pace import Pace
from missions.pads import Pad, column_radius_m, place_pads
from missions.performance import Performance, Ramp, Tuning, tuned
from missions.planfile import (
    BreakingLoss,
    PlanFile,
    PlanSegment,
    Solved,
    Window,
    check_plan,
    make_plan_file,
    plan_segment,
)
from missions.planjson import plan_document, read_plan, write_plan
from missions.pricing import FlownMoves, Pricing, flown_instance
from missions.qgc import QgcPlan, parse_qgc_plan, parse_qgc_waypoints, qgc_plan, qgc_waypoints
from missions.readers import (
    SNAP_M,
    Matter,
    Mending,
    Remark,
    Selection,
    Understood,
    default_network_path,
    network_document,
    parse_where,
    read_network,
    station_points,
    understand,
)
from missions.routes import continue_path, flight_path
from missions.safety import HeightReference, Layers, check_separation, plan_layers, tracks_m
from missions.setup import FlightSetup, Inspection, flight_setup
from missions.sorties import flown_sorties
from missions.tasks import Task, open_task
from missions.validation import first_reason
from missions.waypoints import FlightPath, Phase, Waypoint

__all__ = [
    "ARDUPILOT",
    "AUTOPILOTS",
    "NESTED",
    "PX4",
    "SNAP_M",
    "Base",
    "BasePlace",
    "BatteryFailsafe",
    "BatteryLevel",
    "BreakingLoss",
    "Command",
    "DayPlanFile",
    "Dialect",
    "EarlyReturn",
    "EncodeError",
    "EncodedMission",
    "Estimate",
    "FlightModel",
    "FlightPath",
    "FlightSetup",
    "FlownMoves",
    "Frame",
    "Geofence",
    "GroundStationFailsafe",
    "HeightReference",
    "Inspection",
    "Layers",
    "LegEstimate",
    "LocalFrame",
    "Matter",
    "Mending",
    "MissionFileError",
    "MissionItem",
    "MissionKind",
    "MissionsError",
    "ModeNumber",
    "Modes",
    "Network",
    "NetworkError",
    "OverGround",
    "Pace",
    "Pad",
    "Performance",
    "Phase",
    "PlanFile",
    "PlanFileError",
    "PlanSegment",
    "Pricing",
    "Pylon",
    "QgcPlan",
    "Ramp",
    "Remark",
    "ReturnParameters",
    "SafetyError",
    "Segment",
    "Selection",
    "SetCurrent",
    "Solved",
    "StartStep",
    "Task",
    "ThresholdUnit",
    "Tuning",
    "Understood",
    "Waypoint",
    "Window",
    "Words",
    "alike",
    "check_ceiling",
    "check_clearance",
    "check_day_plan",
    "check_everywhere",
    "check_plan",
    "check_separation",
    "column_radius_m",
    "continue_path",
    "day_plan_document",
    "default_network_path",
    "dialect_for",
    "dialect_of",
    "differences",
    "encode",
    "estimate",
    "first_reason",
    "flag_current",
    "flight_path",
    "flight_setup",
    "flown_instance",
    "flown_sorties",
    "highest_return_m",
    "implausible",
    "is_day_plan",
    "lowest_over_tops_m",
    "make_plan_file",
    "margin_m",
    "network_document",
    "open_task",
    "over_ground_m",
    "parse_json",
    "parse_qgc_plan",
    "parse_qgc_waypoints",
    "parse_where",
    "place_pads",
    "plan_document",
    "plan_layers",
    "plan_segment",
    "qgc_plan",
    "qgc_waypoints",
    "read_day_plan",
    "read_network",
    "read_plan",
    "read_text",
    "return_over_ground_m",
    "station_points",
    "tracks_m",
    "tuned",
    "understand",
    "with_heights",
    "write_day_plan",
    "write_plan",
]

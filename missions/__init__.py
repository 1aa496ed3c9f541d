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
    HeightOverGround,
    check_ceiling,
    check_clearance,
    check_network_clearance,
    find_height_extremes,
    find_max_return_height,
    margin_m,
    max_return_height_m,
    min_height_over_tops_m,
)
from missions.day_plan import BasePlace, DayPlanFile, check_day_plan
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
from missions.items import Command, Frame, MissionItem, MissionKind
from missions.line_heights import check_line_heights, with_heights
from missions.mission_comparison import count_common_items, find_mission_differences
from missions.network import Network, Pylon, Segment
from missions.pace import Pace
from missions.pads import Pad, column_radius_m, place_pads
from missions.performance import Performance, Ramp, Tuning, apply_tunings
from missions.plan_file import (
    BreakingLoss,
    PlanFile,
    PlanSegment,
    SolverRecord,
    Window,
    build_plan_segment,
    check_plan,
    make_plan_file,
)
from missions.plan_json import build_plan_document, is_day_plan, read_any_plan, read_day_plan, read_plan, write_plan
from missions.pricing import PricedMoves, Pricing, build_priced_instance, build_priced_sorties
from missions.qgc import QgcPlan, format_qgc_plan, format_qgc_waypoints, parse_qgc_plan, parse_qgc_waypoints
from missions.readers import (
    SNAP_M,
    MendingLimits,
    NetworkImport,
    Remark,
    RemarkTopic,
    Selection,
    build_network_document,
    default_network_path,
    import_network,
    parse_where,
    read_network,
    read_station_points,
)
from missions.routes import build_flight_path, continue_path
from missions.safety import HeightReference, Layers, check_separation, plan_layers, tracks_m
from missions.setup import FlightSetup, Inspection, plan_flight_setup
from missions.tasks import Task, build_open_task
from missions.validation import format_first_error
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
    "Frame",
    "Geofence",
    "GroundStationFailsafe",
    "HeightOverGround",
    "HeightReference",
    "Inspection",
    "Layers",
    "LegEstimate",
    "LocalFrame",
    "MendingLimits",
    "MissionFileError",
    "MissionItem",
    "MissionKind",
    "MissionsError",
    "ModeNumber",
    "Modes",
    "Network",
    "NetworkError",
    "NetworkImport",
    "Pace",
    "Pad",
    "Performance",
    "Phase",
    "PlanFile",
    "PlanFileError",
    "PlanSegment",
    "PricedMoves",
    "Pricing",
    "Pylon",
    "QgcPlan",
    "Ramp",
    "Remark",
    "RemarkTopic",
    "ReturnParameters",
    "SafetyError",
    "Segment",
    "Selection",
    "SetCurrent",
    "SolverRecord",
    "StartStep",
    "Task",
    "ThresholdUnit",
    "Tuning",
    "Waypoint",
    "Window",
    "Words",
    "apply_tunings",
    "build_flight_path",
    "build_network_document",
    "build_open_task",
    "build_plan_document",
    "build_plan_segment",
    "build_priced_instance",
    "build_priced_sorties",
    "check_ceiling",
    "check_clearance",
    "check_day_plan",
    "check_line_heights",
    "check_network_clearance",
    "check_plan",
    "check_separation",
    "column_radius_m",
    "continue_path",
    "count_common_items",
    "default_network_path",
    "dialect_for",
    "dialect_of",
    "encode",
    "estimate",
    "find_height_extremes",
    "find_max_return_height",
    "find_mission_differences",
    "flag_current",
    "format_first_error",
    "format_qgc_plan",
    "format_qgc_waypoints",
    "import_network",
    "is_day_plan",
    "make_plan_file",
    "margin_m",
    "max_return_height_m",
    "min_height_over_tops_m",
    "parse_json",
    "parse_qgc_plan",
    "parse_qgc_waypoints",
    "parse_where",
    "place_pads",
    "plan_flight_setup",
    "plan_layers",
    "read_any_plan",
    "read_day_plan",
    "read_network",
    "read_plan",
    "read_station_points",
    "read_text",
    "tracks_m",
    "with_heights",
    "write_plan",
]

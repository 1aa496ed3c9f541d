# Part of faultline.
"""Model the power line, the flights over it, and mission items as data: all steps between a plan and a MAVLink message.

>>> network = read_network(default_network_path(), radius_m=700)
>>> setup = plan_flight_setup(network, ["uav1", "uav2"], Inspection())
>>> path = build_flight_path(setup, "uav1", [0, 2, 4])
>>> mission = encode(path, PX4)
>>> mission.items[0].command.name
'NAV_TAKEOFF'
"""

from missions.autopilots.dialect import (
    ARDUPILOT,
    AUTOPILOTS,
    PX4,
    BatteryLevel,
    Dialect,
    ModeNumber,
    ReturnParameters,
    StartStep,
    ThresholdUnit,
    Words,
    add_first_names,
    dialect_for,
    dialect_of,
    find_name_on_board,
    list_other_names,
)
from missions.clearance import (
    check_ceiling,
    check_clearance,
    check_network_clearance,
    find_height_extremes,
    find_max_return_height,
    margin_m,
    max_return_height_m,
    min_height_over_tops_m,
)
from missions.encode import EncodedMission, encode, flag_current
from missions.errors import (
    EncodeError,
    MissionFileError,
    MissionsError,
    NetworkError,
    PlanFileError,
    SafetyError,
)
from missions.files import NESTED
from missions.flight_model import (
    Base,
    Estimate,
    FlightModel,
    LegEstimate,
    Pace,
    Performance,
    Ramp,
    apply_tunings,
    estimate,
)
from missions.geo import LocalFrame
from missions.inspection_defaults import Inspection
from missions.items import Command, Frame, MissionItem, MissionKind, compute_list_checksum
from missions.layers_and_rtl_heights import HeightReference, plan_layers, tracks_m
from missions.line_heights import check_line_heights, with_heights
from missions.mission_comparison import count_common_items, find_mission_differences
from missions.network import Network, Pylon, Segment
from missions.pads import Pad, column_radius_m, place_pads
from missions.plan_check import check_plan
from missions.plan_file import DayPlanFile, PlanFile, build_plan_segment, make_plan_file
from missions.plan_json import build_plan_document, is_day_plan, read_any_plan, read_day_plan, read_plan, write_plan
from missions.plan_parts import (
    COVERAGE_COST,
    WINDOW_COST,
    BasePlace,
    BreakingLoss,
    CoverageChance,
    SolverRecord,
    Window,
)
from missions.pricing import Pricing, Task, build_open_task, build_priced_instance
from missions.readers import (
    NetworkImport,
    Selection,
    build_network_document,
    default_network_path,
    import_network,
    read_network,
    read_station_points,
)
from missions.readers.network_build import SNAP_M, MendingLimits
from missions.readers.raw_network import Remark, RemarkTopic, parse_where
from missions.routes import build_flight_path, continue_path
from missions.setup import FlightSetup, check_separation, plan_flight_setup
from missions.validation import format_first_error
from missions.waypoints import FlightPath, Phase, Waypoint

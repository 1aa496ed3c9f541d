"""A module's tests are found by its name: beside it in the mirrored folder, or in the list that says where they are."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

from tests.test_architecture import PACKAGES, ROOT, modules

SHOWN_ELSEWHERE: dict[str, tuple[str, ...]] = {
    "tests/test_lines.py": ("executor/core/interface/check_codes.py", "executor/core/interface/commands.py"),
    "tests/executor/core/operator/test_intent_refusals.py": ("executor/core/interface/intents.py",),
    "tests/simulator/test_fences.py": ("simulator/fence.py", "simulator/lists_ardupilot.py"),
    "tests/benchmarks/test_reallogs.py": (
        "benchmarks/detectionbench.py",
        "benchmarks/reallogspage.py",
        "benchmarks/witness/dataflash_log.py",
        "benchmarks/witness/px4_log.py",
        "benchmarks/witness/scoring.py",
    ),
    "tests/benchmarks/virtual/test_areas.py": ("missions/area_check.py",),
    "tests/executor/cli/test_areas.py": (
        "executor/site/site_areas.py",
        "executor/site/tables/area_tables.py",
        "missions/outlines.py",
        "missions/reachability.py",
    ),
    "tests/properties/test_missions_areas.py": ("missions/areas.py", "missions/shortest_ways.py"),
    "tests/executor/replay/test_learning.py": ("executor/replay/learned_toml.py",),
    "tests/benchmarks/witness/test_verdicts.py": (
        "benchmarks/witness/hands.py",
        "benchmarks/witness/packs.py",
        "benchmarks/witness/statements.py",
        "benchmarks/witness/telemetry_log.py",
        "benchmarks/witness/log_evidence.py",
    ),
    "tests/e2e/test_fleet.py": (
        "executor/flight/flight_request.py",
        "executor/flight/run_flight.py",
        "executor/flight/open_links.py",
        "executor/flight/preparation.py",
        "executor/flight/flight_recorder.py",
        "executor/simulated/injected_faults.py",
    ),
    "tests/e2e/test_given_back.py": (
        "executor/cli/restore.py",
        "executor/flight/restore_vehicles.py",
        "executor/flight/concurrency.py",
    ),
    "tests/e2e/test_told_to_end.py": ("executor/flight/operator_interrupts.py",),
    "tests/executor/adapters/test_fleet_time.py": ("simulator/common_time.py",),
    "tests/executor/adapters/logs/test_damaged_logs.py": (
        "executor/adapters/logs/dataflash.py",
        "executor/adapters/logs/ulog.py",
    ),
    "tests/executor/adapters/logs/test_odd_dataflash.py": (
        "executor/adapters/logs/ardupilot_boot.py",
        "executor/adapters/logs/dataflash_rows.py",
    ),
    "tests/executor/adapters/logs/test_who_and_why.py": (
        "executor/adapters/logs/ardupilot_codes.py",
        "executor/adapters/logs/px4_vehicle.py",
    ),
    "tests/executor/adapters/mavlink/test_codec.py": (
        "executor/adapters/mavlink/message_readers.py",
        "executor/adapters/mavlink/integers.py",
        "executor/adapters/mavlink/statustext.py",
    ),
    "tests/executor/adapters/mavlink/test_tlog_reader.py": (
        "executor/adapters/mavlink/frame_layout.py",
        "executor/adapters/chunks.py",
        "executor/adapters/mavlink/tlog_kinds.py",
    ),
    "tests/executor/adapters/mavsdk/test_mavsdk_link.py": ("executor/adapters/mavsdk/library.py",),
    "tests/executor/adapters/mqtt/test_client.py": (
        "executor/adapters/mqtt/broker.py",
        "executor/adapters/mqtt/outbox.py",
    ),
    "tests/executor/adapters/web/test_server.py": (
        "executor/adapters/web/guard.py",
        "executor/adapters/web/snapshot.py",
        "executor/adapters/web/stream.py",
    ),
    "tests/executor/analysis/pictures/test_pictures.py": (
        "executor/analysis/pictures/battery_figure.py",
        "executor/analysis/pictures/front_figure.py",
        "executor/analysis/pictures/map_figures.py",
        "executor/analysis/pictures/label_placement.py",
        "executor/analysis/pictures/map_sheet.py",
        "executor/analysis/pictures/style.py",
        "executor/analysis/pictures/window_figure.py",
    ),
    "tests/executor/analysis/test_report.py": ("executor/adapters/document.py", "executor/analysis/documents.py"),
    "tests/benchmarks/virtual/test_learned.py": ("executor/analysis/learned_document.py",),
    "tests/benchmarks/table/test_cells.py": (
        "benchmarks/machine.py",
        "benchmarks/markdown.py",
        "benchmarks/table/report.py",
        "benchmarks/table/settings.py",
    ),
    "tests/benchmarks/table/test_make.py": (
        "benchmarks/table/command.py",
        "benchmarks/table/picture.py",
        "benchmarks/table/tasks.py",
    ),
    "tests/benchmarks/test_detection.py": (
        "benchmarks/detectionpage.py",
        "benchmarks/flightmodel.py",
    ),
    "tests/benchmarks/test_fleet.py": (
        "benchmarks/codec_cost.py",
        "benchmarks/browser.py",
        "benchmarks/fleetsite.py",
        "benchmarks/garbage.py",
    ),
    "tests/benchmarks/test_parts.py": (
        "benchmarks/all_parts.py",
        "benchmarks/parts/csum.py",
        "benchmarks/parts/exact.py",
        "benchmarks/parts/mtsp.py",
        "benchmarks/parts/replan.py",
        "benchmarks/parts/scale.py",
        "benchmarks/parts/setting.py",
        "benchmarks/parts/start.py",
        "benchmarks/peer.py",
    ),
    "tests/benchmarks/test_single.py": (
        "benchmarks/data.py",
        "benchmarks/problems.py",
        "benchmarks/solvers.py",
    ),
    "tests/benchmarks/test_upload.py": (
        "benchmarks/mavsdk_upload.py",
        "benchmarks/commands.py",
        "benchmarks/options.py",
    ),
    "tests/executor/cli/test_network.py": (
        "executor/analysis/pictures/network_figure.py",
        "executor/cli/network_options.py",
        "missions/readers/archives.py",
        "missions/readers/xml_tree.py",
    ),
    "tests/missions/exports/test_exports.py": (
        "missions/exports/geojson_export.py",
        "missions/exports/gpx_export.py",
        "missions/exports/kml_export.py",
        "missions/exports/plan_features.py",
        "missions/exports/xml_text.py",
    ),
    "tests/missions/readers/test_background_files.py": (
        "missions/background.py",
        "missions/readers/imagery.py",
        "missions/readers/mbtiles.py",
    ),
    "tests/missions/readers/test_elevation_rasters.py": (
        "missions/elevation.py",
        "missions/readers/geoids.py",
        "missions/readers/kept_elevation.py",
        "missions/readers/rasters.py",
    ),
    "tests/missions/test_overland_surface.py": ("missions/terrain.py",),
    "tests/missions/test_relief.py": ("missions/grids.py",),
    "tests/executor/site/test_terrain.py": (
        "executor/analysis/pictures/profile_figure.py",
        "executor/analysis/height_profile.py",
    ),
    "tests/stories/test_pictures.py": (
        "executor/core/payload/camera_state.py",
        "simulator/camera.py",
    ),
    "tests/peers/test_mavsdk_cameras.py": ("simulator/gimbal.py",),
    "tests/executor/images/test_matching.py": (
        "executor/cli/images.py",
        "executor/images/clock_offsets.py",
        "executor/images/exif.py",
        "executor/images/asset_pages.py",
        "executor/images/index_rows.py",
        "executor/images/index_files.py",
        "executor/simulated/cards.py",
    ),
    "tests/executor/site/test_camera_tasks.py": ("executor/site/tables/camera_tables.py",),
    "tests/missions/test_camera_items.py": ("missions/cameras.py",),
    "tests/missions/readers/test_whole.py": ("missions/readers/shape_parts.py",),
    "tests/missions/readers/test_network_build.py": (
        "missions/readers/network_checks.py",
        "missions/readers/read_options.py",
        "missions/readers/nodes.py",
        "missions/readers/planar.py",
    ),
    "tests/missions/readers/test_formats.py": (
        "missions/readers/attributes.py",
        "missions/readers/crs.py",
        "missions/readers/raw_network.py",
        "missions/readers/features.py",
        "missions/readers/geopackage.py",
        "missions/readers/gpx.py",
        "missions/readers/kml.py",
        "missions/readers/osm.py",
        "missions/readers/shapes.py",
        "missions/readers/network_import.py",
    ),
    "tests/executor/cli/test_init_site.py": ("executor/site/template.py",),
    "tests/executor/cli/test_main.py": (
        "executor/cli/flights.py",
        "executor/cli/options.py",
        "executor/cli/plan_inputs.py",
        "executor/cli/plans.py",
    ),
    "tests/executor/core/battery/test_account.py": ("executor/core/battery/charge_counter.py",),
    "tests/executor/core/battery/test_pack_condition.py": (
        "executor/core/battery/resting_voltage.py",
        "executor/core/battery/voltage_sag.py",
    ),
    "tests/executor/core/inflight/custody/test_mode_causes_distinguished.py": (
        "executor/core/inflight/custody/mode_attribution.py",
    ),
    "tests/executor/core/inflight/faults/test_watchpoints.py": (
        "executor/core/inflight/faults/battery_watchpoints.py",
        "executor/core/inflight/faults/watchpoint_types.py",
    ),
    "tests/executor/core/telemetry/test_message_update.py": ("executor/core/telemetry/battery_reports.py",),
    "tests/executor/core/replanning/test_replan_cycle_losses.py": ("executor/runtime/loss_judging.py",),
    "tests/executor/core/test_fleet_step.py": ("executor/core/inflight/custody/mission_check.py",),
    "tests/executor/core/test_fleet_step_messages.py": ("executor/core/inflight/closest_approach.py",),
    "tests/executor/core/state/test_vehicle_parts.py": (
        "executor/core/interface/ports.py",
        "executor/core/interface/recorded_log.py",
    ),
    "tests/executor/core/state/test_vehicle_position.py": ("executor/core/interface/messages.py",),
    "tests/executor/flight/test_checkpoint_files.py": ("executor/flight/checkpointer.py",),
    "tests/executor/flight/test_parameter_changes.py": (
        "executor/flight/board_record.py",
        "executor/runtime/board_restore.py",
    ),
    "tests/executor/flight/test_resume_flight.py": (
        "executor/adapters/clock.py",
        "executor/adapters/run_directory.py",
        "executor/flight/run_start.py",
    ),
    "tests/executor/replay/test_log_replay.py": (
        "executor/cli/replay.py",
        "executor/replay/replay_page.py",
        "executor/replay/timeline.py",
    ),
    "tests/executor/replay/test_log_replay_of_real_flights.py": (
        "executor/replay/ground_truth.py",
        "executor/replay/open_log.py",
    ),
    "tests/executor/replay/test_pack_book.py": ("executor/replay/packs_file.py",),
    "tests/executor/runtime/test_turnaround.py": ("executor/runtime/turnaround_check.py",),
    "tests/benchmarks/test_distance.py": (
        "benchmarks/distancepage.py",
        "benchmarks/report.py",
        "benchmarks/separation.py",
    ),
    "tests/benchmarks/test_pictures.py": ("benchmarks/picturespage.py",),
    "tests/benchmarks/test_sorties.py": (
        "benchmarks/sortiespage.py",
        "benchmarks/pad_crew.py",
    ),
    "tests/benchmarks/test_prediction.py": ("benchmarks/predictionpage.py",),
    "tests/benchmarks/test_failures.py": (
        "benchmarks/failurespage.py",
        "benchmarks/least.py",
        "benchmarks/scenario.py",
        "benchmarks/failures_command.py",
        "benchmarks/warm_sorties.py",
    ),
    "tests/benchmarks/test_window.py": (
        "benchmarks/branches.py",
        "benchmarks/virtual_site.py",
        "benchmarks/windowpage.py",
        "benchmarks/flight_commands.py",
    ),
    "tests/benchmarks/test_virtual_flight.py": (
        "benchmarks/virtual/memory_flight.py",
        "benchmarks/virtual/radio.py",
        "benchmarks/virtual/in_process_solver.py",
    ),
    "tests/benchmarks/test_tuning.py": (
        "benchmarks/few_lines_detector.py",
        "benchmarks/tuning_picture.py",
    ),
    "tests/executor/runtime/test_vehicle_preflight.py": ("executor/runtime/stream_requests.py",),
    "tests/executor/simulated/test_demo_site.py": ("executor/simulated/simulated_fleet.py",),
    "tests/simulator/test_ardupilot.py": ("simulator/mission_ardupilot.py",),
    "tests/simulator/test_leg_times.py": (
        "simulator/scurves.py",
        "simulator/px4_trajectory.py",
        "simulator/px4_velocity_smoothing.py",
        "simulator/position_drift.py",
    ),
    "tests/simulator/test_physics.py": ("simulator/guidance.py",),
    "tests/simulator/test_px4.py": (
        "simulator/mission_px4.py",
        "simulator/modes_px4.py",
    ),
    "tests/simulator/test_vehicle.py": (
        "simulator/airframe.py",
        "simulator/messages.py",
        "simulator/mission_store.py",
        "simulator/route.py",
        "simulator/telemetry.py",
        "simulator/vehicle_outbox.py",
    ),
    "tests/simulator/test_wire.py": ("simulator/streams.py",),
    "tests/executor/site/test_site_file.py": (
        "executor/site/tables/aircraft.py",
        "executor/site/tables/ground.py",
        "executor/site/tables/links.py",
    ),
    "tests/executor/site/test_planned_heights.py": ("executor/site/site_model.py",),
    "tests/executor/site/test_site_planning_asked.py": (
        "executor/flight/checklist.py",
        "executor/flight/checklist_only.py",
        "executor/site/plan_summary.py",
    ),
    "tests/executor/site/test_campaign_risk.py": (
        "executor/analysis/pictures/risk_figure.py",
        "executor/cli/risk.py",
    ),
    "tests/missions/autopilots/test_dialect.py": ("missions/autopilots/registry.py",),
    "tests/missions/test_encode.py": (
        "missions/autopilots/ardupilot.py",
        "missions/autopilots/px4.py",
    ),
    "tests/missions/test_plan_file.py": ("missions/plan_json.py", "missions/plan_json_v1.py"),
    "tests/missions/test_routes.py": ("missions/setup.py",),
    "tests/missions/test_tasks.py": ("missions/flight_model.py", "missions/pricing.py"),
    "tests/benchmarks/scenarios/test_losses.py": ("benchmarks/scenarios/road_graph.py",),
    "tests/planner/test_exact.py": (
        "planner/highs.py",
        "planner/partition.py",
    ),
    "tests/planner/test_grasp.py": ("planner/kernels/grasp_walk.py",),
    "tests/planner/test_large.py": (
        "planner/decomposition.py",
        "benchmarks/synthetic.py",
    ),
    "tests/planner/test_risk.py": ("planner/after_losses.py",),
    "tests/planner/test_window_search.py": (
        "benchmarks/table/window_bound.py",
        "planner/kernels/plan_changes.py",
        "planner/kernels/robust_walk.py",
        "planner/pareto_front.py",
    ),
    "tests/planner/test_search.py": (
        "planner/construct.py",
        "planner/cost.py",
        "planner/kernels/ruin.py",
        "planner/model.py",
        "planner/result.py",
        "planner/solve.py",
        "planner/plan_search.py",
    ),
    "tests/planner/test_window.py": (
        "planner/kernels/loss_problem.py",
        "planner/kernels/repair.py",
        "planner/kernels/window_scan.py",
        "planner/loss_scan.py",
    ),
    "tests/properties/test_geometry.py": ("missions/geometry.py",),
    "tests/properties/test_planner_bounds.py": (
        "planner/bounds.py",
        "planner/kernels/tree_bound.py",
    ),
    "tests/properties/test_planner_kernels.py": (
        "planner/kernels/anneal.py",
        "planner/kernels/random_numbers.py",
        "planner/kernels/compiled.py",
        "planner/kernels/insertion.py",
        "planner/kernels/tours.py",
    ),
    "tests/properties/test_planner_sorties.py": (
        "planner/kernels/sortie_insertion.py",
        "planner/kernels/sortie_schedule.py",
        "planner/kernels/sortie_search.py",
        "planner/sorties/sortie_state.py",
        "planner/sorties/sortie_evaluation.py",
        "planner/sorties/sortie_annealing.py",
        "planner/sorties/sortie_solve.py",
    ),
    "tests/benchmarks/test_exact_sorties.py": ("benchmarks/row_matrix.py", "planner/sorties/sortie_model.py"),
    "tests/executor/cli/test_day.py": (
        "executor/analysis/pictures/gantt_figure.py",
        "executor/site/day_summary.py",
        "executor/site/tables/day_tables.py",
        "missions/day_plan.py",
    ),
    "tests/executor/site/test_day_flight.py": ("executor/site/site_bases.py",),
    "tests/benchmarks/test_day.py": (
        "benchmarks/daypage.py",
        "benchmarks/day_command.py",
    ),
    "tests/properties/test_planner_subsets.py": (
        "planner/kernels/subset_dynamics.py",
        "planner/subset_routes.py",
    ),
    "tests/test_docs.py": (
        "scripts/pages/page_types.py",
        "scripts/pages/reference.py",
        "scripts/pages/states.py",
    ),
    "tests/test_extras.py": ("executor/adapters/extras.py",),
}
"""By a test file, the modules that it shows beside what it is called after."""


COMMANDS = ROOT / "executor" / "cli" / "commandline.py"


def does(path: Path) -> bool:
    """Tell whether a module does anything: what only defines data and constants is shown by who uses it."""
    return any(isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) for node in ast.walk(parsed(path)))


def own(module: str) -> list[Path]:
    """Return the test files that are called after a module."""
    path = ROOT / "tests" / module
    return [*path.parent.glob(f"test_{path.stem}.py"), *path.parent.glob(f"test_{path.stem}_*.py")]


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imported(path: Path) -> frozenset[Path]:
    """Return the files of ours that a file imports, at its top or later."""
    names: set[str] = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    places = [ROOT.joinpath(*name.split(".")) for name in names]
    files = [file for place in places for file in (place.with_suffix(".py"), place / "__init__.py")]
    found = frozenset(file for file in files if file.is_file())
    if path == COMMANDS:  # it imports a command once that is called
        text = path.read_text(encoding="utf-8")
        named = re.findall(r'"((?:executor|benchmarks)(?:\.\w+)+)(?::\w+)?"', text)
        found |= {ROOT.joinpath(*name.split(".")).with_suffix(".py") for name in named}
    # The flights' tests start the program itself.
    return found | {ROOT / "executor" / "__main__.py"} if path.parent == ROOT / "tests" / "e2e" else found


@cache
def reached(path: Path) -> frozenset[Path]:
    """Return the files that a file imports, directly or through what it imports."""
    found: set[Path] = set()
    waiting = [path]
    while waiting:
        new = imported(waiting.pop()) - found
        found |= new
        waiting += new
    return frozenset(found)


ALL = {
    str(path.relative_to(ROOT))
    for path in modules(*PACKAGES, "scripts")
    if path.name not in ("__init__.py", "__main__.py")
}
LISTED = [(test, module) for test, listed in SHOWN_ELSEWHERE.items() for module in listed]


def test_every_module_that_does_something_has_its_tests_or_says_where_they_are() -> None:
    listed = {module for _, module in LISTED}
    assert {module for module in ALL - listed if does(ROOT / module) and not own(module)} == set()


def test_what_is_listed_is_there_once_and_does_something() -> None:
    names = [module for _, module in LISTED]
    assert [module for module in names if names.count(module) > 1 or module not in ALL] == []
    assert [module for module in names if not does(ROOT / module)] == []
    assert [test for test in SHOWN_ELSEWHERE if not (ROOT / test).is_file()] == []


def test_nothing_is_listed_that_has_tests_of_its_own_name() -> None:
    assert [module for _, module in LISTED if own(module)] == []


def test_whoever_shows_a_module_uses_it() -> None:
    assert [(test, module) for test, module in LISTED if ROOT / module not in reached(ROOT / test)] == []

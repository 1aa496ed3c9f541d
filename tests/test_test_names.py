"""A module's tests are found by its name: in the mirrored folder, or in the list of exceptions."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

from tests.test_architecture import PACKAGES, ROOT, modules

SHOWN_ELSEWHERE: dict[str, tuple[str, ...]] = {
    "tests/benchmarks/dataset/test_checker.py": ("benchmarks/dataset/convert.py",),
    "tests/benchmarks/dataset/test_verify.py": (
        "benchmarks/dataset/catalogue.py",
        "benchmarks/dataset/compare.py",
        "benchmarks/dataset_commands.py",
    ),
    "tests/benchmarks/scenarios/test_losses.py": ("benchmarks/scenarios/road_graph.py",),
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
    "tests/benchmarks/test_day.py": (
        "benchmarks/day_command.py",
        "benchmarks/daypage.py",
    ),
    "tests/benchmarks/test_detection.py": (
        "benchmarks/detectionpage.py",
        "benchmarks/flightmodel.py",
    ),
    "tests/benchmarks/test_distance.py": (
        "benchmarks/distancepage.py",
        "benchmarks/report.py",
        "benchmarks/separation.py",
    ),
    "tests/benchmarks/test_exact_sorties.py": (
        "benchmarks/highs.py",
        "benchmarks/row_matrix.py",
    ),
    "tests/benchmarks/test_failures.py": (
        "benchmarks/failures_command.py",
        "benchmarks/failurespage.py",
        "benchmarks/least.py",
        "benchmarks/scenario.py",
        "benchmarks/warm_sorties.py",
    ),
    "tests/benchmarks/test_fleet.py": (
        "benchmarks/browser.py",
        "benchmarks/codec_cost.py",
        "benchmarks/fleetsite.py",
        "benchmarks/garbage.py",
    ),
    "tests/benchmarks/test_parts.py": (
        "benchmarks/all_parts.py",
        "benchmarks/parts/bounds.py",
        "benchmarks/parts/csum.py",
        "benchmarks/parts/exact.py",
        "benchmarks/parts/mtsp.py",
        "benchmarks/parts/onboard.py",
        "benchmarks/parts/replan.py",
        "benchmarks/parts/scale.py",
        "benchmarks/parts/setting.py",
        "benchmarks/parts/start.py",
        "benchmarks/peer.py",
    ),
    "tests/benchmarks/test_pictures.py": ("benchmarks/picturespage.py",),
    "tests/benchmarks/test_prediction.py": ("benchmarks/predictionpage.py",),
    "tests/benchmarks/test_reallogs.py": (
        "benchmarks/detectionbench.py",
        "benchmarks/reallogspage.py",
        "benchmarks/witness/dataflash_log.py",
        "benchmarks/witness/px4_log.py",
        "benchmarks/witness/scoring.py",
    ),
    "tests/benchmarks/test_single.py": (
        "benchmarks/data.py",
        "benchmarks/problems.py",
        "benchmarks/solvers.py",
    ),
    "tests/benchmarks/test_sorties.py": (
        "benchmarks/pad_crew.py",
        "benchmarks/sortiespage.py",
    ),
    "tests/benchmarks/test_tuning.py": (
        "benchmarks/few_lines_detector.py",
        "benchmarks/tuning_picture.py",
    ),
    "tests/benchmarks/test_upload.py": (
        "benchmarks/commands.py",
        "benchmarks/mavsdk_upload.py",
        "benchmarks/options.py",
    ),
    "tests/benchmarks/test_virtual_flight.py": (
        "benchmarks/virtual/in_process_solver.py",
        "benchmarks/virtual/memory_flight.py",
        "benchmarks/virtual/radio.py",
    ),
    "tests/benchmarks/test_window.py": (
        "benchmarks/branches.py",
        "benchmarks/flight_commands.py",
        "benchmarks/virtual_site.py",
        "benchmarks/windowpage.py",
    ),
    "tests/benchmarks/virtual/test_areas.py": ("missions/area_rules.py",),
    "tests/benchmarks/witness/test_verdicts.py": (
        "benchmarks/witness/hands.py",
        "benchmarks/witness/log_evidence.py",
        "benchmarks/witness/packs.py",
        "benchmarks/witness/statements.py",
        "benchmarks/witness/telemetry_log.py",
    ),
    "tests/e2e/test_fleet.py": (
        "executor/flight/run_flight.py",
        "executor/flight/run_start.py",
        "executor/simulated/fault_truths.py",
    ),
    "tests/e2e/test_given_back.py": (
        "executor/cli/flights.py",
        "executor/flight/restore_vehicles.py",
    ),
    "tests/e2e/test_report.py": ("executor/analysis/report_map.py",),
    "tests/executor/adapters/test_interrupts.py": ("executor/cli/exit_codes.py",),
    "tests/executor/adapters/logs/test_damaged_logs.py": (
        "executor/adapters/logs/dataflash.py",
        "executor/adapters/logs/ulog.py",
    ),
    "tests/executor/adapters/logs/test_odd_dataflash.py": ("executor/adapters/logs/ardupilot_boot.py",),
    "tests/executor/adapters/mavlink/test_endpoints_link.py": ("executor/adapters/listeners.py",),
    "tests/executor/adapters/mavlink/test_tlog_reader.py": ("executor/adapters/chunks.py",),
    "tests/executor/adapters/mqtt/test_publisher.py": ("executor/adapters/mqtt/topics.py",),
    "tests/executor/adapters/web/test_server.py": (
        "executor/adapters/web/page_server.py",
        "executor/adapters/web/snapshot.py",
    ),
    "tests/executor/cli/test_network_init.py": ("executor/site/new_site.py",),
    "tests/executor/analysis/pictures/test_pictures.py": (
        "executor/analysis/pictures/battery_figure.py",
        "executor/analysis/pictures/chart_figures.py",
        "executor/analysis/pictures/map_figures.py",
        "executor/analysis/pictures/style.py",
    ),
    "tests/executor/analysis/test_report.py": ("executor/adapters/run_directory.py",),
    "tests/executor/cli/test_areas.py": (
        "executor/site/site_keys.py",
        "missions/no_fly_areas.py",
    ),
    "tests/executor/cli/test_main.py": (
        "executor/cli/options.py",
        "executor/cli/plans.py",
    ),
    "tests/executor/cli/test_network.py": (
        "missions/readers/archives.py",
        "missions/readers/xml_files.py",
    ),
    "tests/executor/core/battery/test_account.py": ("executor/core/battery/charge_counter.py",),
    "tests/executor/core/operator/test_intent_refusals.py": ("executor/core/interface/intents.py",),
    "tests/executor/core/state/test_vehicle_parts.py": (
        "executor/core/interface/ports.py",
        "executor/core/interface/recorded_log.py",
    ),
    "tests/executor/core/state/test_vehicle_position.py": ("executor/core/interface/messages.py",),
    "tests/executor/core/telemetry/test_message_update.py": ("executor/core/telemetry/battery_reports.py",),
    "tests/executor/core/test_reason_codes.py": ("executor/core/interface/codes.py",),
    "tests/executor/images/test_matching.py": (
        "executor/cli/images.py",
        "executor/images/index_files.py",
    ),
    "tests/executor/plan_page/test_planning.py": (
        "executor/plan_page/plan_store.py",
        "executor/plan_page/plan_work.py",
    ),
    "tests/executor/plan_page/test_server.py": (
        "executor/plan_page/api.py",
        "executor/plan_page/site_files.py",
        "executor/plan_page/site_problems.py",
        "executor/plan_page/site_view.py",
        "executor/plan_page/workspace.py",
    ),
    "tests/executor/plan_page/test_site_document.py": ("executor/plan_page/site_history.py",),
    "tests/executor/replay/test_log_replay.py": (
        "executor/cli/replay.py",
        "executor/replay/timeline.py",
    ),
    "tests/executor/replay/test_log_replay_of_real_flights.py": (
        "benchmarks/recorded_truths.py",
        "executor/replay/open_log.py",
    ),
    "tests/executor/runtime/test_two_links.py": ("executor/runtime/link_changes.py",),
    "tests/executor/site/test_plan_summary_heights.py": ("executor/site/site_model.py",),
    "tests/executor/site/test_terrain.py": ("executor/analysis/height_profile.py",),
    "tests/executor/site/test_site_file.py": (
        "executor/site/flight_keys.py",
        "executor/site/mqtt_and_web_keys.py",
    ),
    "tests/missions/readers/test_elevation_rasters.py": ("missions/terrain.py",),
    "tests/missions/readers/test_formats.py": (
        "missions/readers/attributes.py",
        "missions/readers/features.py",
        "missions/readers/layer_files.py",
    ),
    "tests/missions/readers/test_network_build.py": ("missions/readers/raw_network.py",),
    "tests/missions/test_encode_cameras.py": ("missions/cameras.py",),
    "tests/missions/test_plan_file.py": (
        "missions/plan_check.py",
        "missions/plan_json.py",
        "missions/plan_json_v1.py",
        "missions/plan_parts.py",
    ),
    "tests/missions/test_setup.py": ("missions/waypoints.py",),
    "tests/planner/test_coverage.py": ("planner/coverage_search.py",),
    "tests/planner/test_grasp.py": ("planner/kernels/grasp_walk.py",),
    "tests/planner/test_large.py": ("benchmarks/synthetic.py",),
    "tests/planner/test_proofs.py": ("planner/columns.py",),
    "tests/planner/test_search.py": (
        "planner/plan_search.py",
        "planner/solve.py",
    ),
    "tests/planner/test_second_loss.py": ("planner/fleet_state.py",),
    "tests/planner/test_window.py": (
        "planner/kernels/repair.py",
        "planner/loss_scan.py",
    ),
    "tests/planner/test_window_search.py": ("planner/kernels/robust_walk.py",),
    "tests/properties/test_geometry.py": ("missions/geometry.py",),
    "tests/properties/test_missions_areas.py": ("missions/shortest_ways.py",),
    "tests/properties/test_planner_bounds.py": (
        "planner/bounds.py",
        "planner/kernels/proofs.py",
    ),
    "tests/properties/test_planner_kernels.py": (
        "planner/kernels/anneal.py",
        "planner/kernels/tours.py",
    ),
    "tests/properties/test_planner_sorties.py": (
        "planner/kernels/sortie_schedule.py",
        "planner/kernels/sortie_search.py",
        "planner/sorties/sortie_annealing.py",
        "planner/sorties/sortie_model.py",
    ),
    "tests/simulator/test_ardupilot.py": ("simulator/mission_ardupilot.py",),
    "tests/simulator/test_fleet_vehicle.py": (
        "simulator/airframe.py",
        "simulator/messages.py",
    ),
    "tests/simulator/test_guided.py": ("simulator/px4_guided.py", "simulator/telemetry.py"),
    "tests/simulator/test_leg_times.py": ("simulator/leg_trajectories.py",),
    "tests/simulator/test_physics.py": ("simulator/guidance.py",),
    "tests/simulator/test_px4.py": ("simulator/mission_px4.py",),
    "tests/simulator/test_wire.py": ("simulator/streams.py",),
    "tests/stories/test_pictures.py": ("simulator/camera.py",),
    "tests/test_docs.py": (
        "scripts/pages/library.py",
        "executor/site/site_schema.py",
        "scripts/pages/page_types.py",
        "scripts/pages/plan_api.py",
        "scripts/pages/reference.py",
        "scripts/pages/states.py",
    ),
    "tests/test_extras.py": ("executor/adapters/extras.py",),
    "tests/test_lines.py": ("executor/core/interface/commands.py",),
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


def test_every_shown_module_is_used() -> None:
    assert [(test, module) for test, module in LISTED if ROOT / module not in reached(ROOT / test)] == []

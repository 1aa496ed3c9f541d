"""A module's tests are found by its name: beside it in the mirrored folder, or in the list that says where they are."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

from tests.test_architecture import PACKAGES, ROOT, modules

SHOWN_ELSEWHERE: dict[str, tuple[str, ...]] = {
    "tests/executor/flight/test_fencing.py": ("executor/flight/kept_lists.py",),
    "tests/simulator/test_fences.py": ("simulator/fence.py", "simulator/lists_ardupilot.py"),
    "tests/benchmarks/test_reallogs.py": (
        "benchmarks/detectionbench.py",
        "benchmarks/reallogspage.py",
        "executor/replay/witness/onboard.py",
        "executor/replay/witness/px4.py",
        "benchmarks/witness/scoring.py",
    ),
    "tests/executor/virtual/test_areas.py": ("executor/core/preflight/areas.py", "missions/areacheck.py"),
    "tests/executor/cli/test_areas.py": (
        "executor/site/areas.py",
        "executor/site/tables/areas.py",
        "missions/outlines.py",
        "missions/plansetup.py",
        "missions/reach.py",
    ),
    "tests/properties/test_missions_areas.py": ("missions/areas.py", "missions/ways.py"),
    "tests/executor/replay/test_learning.py": ("executor/replay/learnedfile.py",),
    "tests/benchmarks/witness/test_verdicts.py": (
        "benchmarks/witness/hands.py",
        "benchmarks/witness/packs.py",
        "executor/replay/witness/statements.py",
        "executor/replay/witness/telemetry.py",
        "executor/replay/witness/testimony.py",
    ),
    "tests/e2e/test_fleet.py": (
        "executor/flight/flight_order.py",
        "executor/flight/fly.py",
        "executor/flight/linking.py",
        "executor/flight/preparing.py",
        "executor/flight/recorder.py",
        "executor/simulated/injected.py",
    ),
    "tests/e2e/test_given_back.py": (
        "executor/cli/restore.py",
        "executor/flight/restore.py",
        "executor/flight/side_by_side.py",
    ),
    "tests/e2e/test_told_to_end.py": ("executor/flight/leaving.py",),
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
        "executor/adapters/mavlink/integers.py",
        "executor/adapters/mavlink/texts.py",
    ),
    "tests/executor/adapters/mavlink/test_tlog_reader.py": (
        "executor/adapters/mavlink/checksum.py",
        "executor/adapters/pieces.py",
        "executor/adapters/mavlink/tlog_kinds.py",
    ),
    "tests/executor/adapters/mavsdk/test_link.py": ("executor/adapters/mavsdk/library.py",),
    "tests/executor/adapters/mqtt/test_client.py": (
        "executor/adapters/mqtt/broker.py",
        "executor/adapters/mqtt/outbox.py",
    ),
    "tests/executor/adapters/web/test_server.py": (
        "executor/adapters/web/guard.py",
        "executor/adapters/web/present.py",
        "executor/adapters/web/stream.py",
    ),
    "tests/executor/analysis/pictures/test_pictures.py": (
        "executor/analysis/pictures/battery.py",
        "executor/analysis/pictures/front.py",
        "executor/analysis/pictures/maps.py",
        "executor/analysis/pictures/placing.py",
        "executor/analysis/pictures/sheet.py",
        "executor/analysis/pictures/style.py",
        "executor/analysis/pictures/window.py",
    ),
    "tests/executor/analysis/test_report.py": ("executor/adapters/document.py", "executor/analysis/documents.py"),
    "tests/executor/virtual/test_learned.py": ("executor/analysis/learned.py",),
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
        "executor/adapters/mavlink/bare.py",
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
        "executor/adapters/mavsdk/upload.py",
        "benchmarks/commands.py",
    ),
    "tests/executor/cli/test_network.py": (
        "executor/analysis/pictures/network.py",
        "executor/cli/network_options.py",
        "missions/readers/opened.py",
        "missions/readers/xmltree.py",
    ),
    "tests/missions/exports/test_exports.py": (
        "missions/exports/geojson.py",
        "missions/exports/gpx.py",
        "missions/exports/kml.py",
        "missions/exports/plan.py",
        "missions/exports/xmltext.py",
    ),
    "tests/missions/readers/test_background.py": (
        "missions/background.py",
        "missions/readers/imagery.py",
        "missions/readers/mbtiles.py",
        "missions/readers/picture.py",
    ),
    "tests/missions/readers/test_elevation.py": (
        "missions/elevation.py",
        "missions/readers/geoids.py",
        "missions/readers/kept_elevation.py",
    ),
    "tests/missions/test_overland.py": ("missions/terrain.py",),
    "tests/missions/test_relief.py": ("missions/grids.py",),
    "tests/executor/site/test_terrain.py": (
        "executor/analysis/pictures/profile.py",
        "executor/analysis/profile.py",
    ),
    "tests/stories/test_pictures.py": (
        "executor/core/payload/pictures.py",
        "simulator/camera.py",
    ),
    "tests/peers/test_mavsdk_cameras.py": ("simulator/gimbal.py",),
    "tests/executor/images/test_matching.py": (
        "executor/cli/images.py",
        "executor/images/clocks.py",
        "executor/images/exif.py",
        "executor/images/pages.py",
        "executor/images/rows.py",
        "executor/images/store.py",
        "executor/simulated/cards.py",
    ),
    "tests/executor/site/test_looks.py": ("executor/site/tables/cameras.py",),
    "tests/missions/test_payload.py": ("missions/cameras.py",),
    "tests/missions/readers/test_whole.py": ("missions/readers/shapeparts.py",),
    "tests/missions/readers/test_build.py": (
        "missions/readers/aftermath.py",
        "missions/readers/choice.py",
        "missions/readers/nodes.py",
        "missions/readers/planar.py",
    ),
    "tests/missions/readers/test_formats.py": (
        "missions/readers/attributes.py",
        "missions/readers/crs.py",
        "missions/readers/drawing.py",
        "missions/readers/features.py",
        "missions/readers/geopackage.py",
        "missions/readers/gpx.py",
        "missions/readers/kml.py",
        "missions/readers/osm.py",
        "missions/readers/shapes.py",
        "missions/readers/written.py",
    ),
    "tests/executor/cli/test_init_site.py": ("executor/site/template.py",),
    "tests/executor/cli/test_main.py": (
        "executor/cli/flights.py",
        "executor/cli/options.py",
        "executor/cli/planning.py",
        "executor/cli/plans.py",
    ),
    "tests/executor/core/battery/test_account.py": ("executor/core/battery/counter.py",),
    "tests/executor/core/battery/test_pack.py": (
        "executor/core/battery/resting.py",
        "executor/core/battery/sag.py",
    ),
    "tests/executor/core/custody/test_causes_told_apart.py": ("executor/core/custody/actors.py",),
    "tests/executor/core/faults/test_watchpoints.py": (
        "executor/core/faults/batteries.py",
        "executor/core/faults/watching.py",
    ),
    "tests/executor/core/hearing/test_fold.py": ("executor/core/hearing/charge.py",),
    "tests/executor/core/operator/test_handling_out_of_the_plan.py": ("executor/core/roster/withdraw.py",),
    "tests/executor/core/replan/test_what_if.py": ("executor/runtime/outlook.py",),
    "tests/executor/core/test_fleet.py": ("executor/core/custody/reading.py",),
    "tests/executor/core/test_fleet_disarmed.py": ("executor/core/homing/landing.py",),
    "tests/executor/core/test_fleet_heard.py": ("executor/core/separation.py",),
    "tests/executor/core/test_fleet_uploads.py": ("executor/core/uploaded.py",),
    "tests/executor/core/operator/test_handling_back_in_the_plan.py": ("executor/core/roster/service.py",),
    "tests/executor/core/test_parts.py": (
        "executor/core/ports.py",
        "executor/core/recording.py",
    ),
    "tests/executor/core/test_places.py": ("executor/core/messages.py",),
    "tests/executor/flight/test_checkpoints.py": ("executor/flight/checkpointing.py",),
    "tests/executor/flight/test_parameter_changes.py": (
        "executor/flight/changed_parameters.py",
        "executor/runtime/parameters.py",
    ),
    "tests/executor/flight/test_resume.py": (
        "executor/adapters/clock.py",
        "executor/adapters/run_directory.py",
        "executor/flight/run_start.py",
    ),
    "tests/executor/replay/test_logs.py": (
        "executor/cli/replay.py",
        "executor/replay/page.py",
        "executor/replay/pictures.py",
    ),
    "tests/executor/replay/test_logs_of_real_flights.py": (
        "executor/replay/ground_truth.py",
        "executor/replay/open_log.py",
    ),
    "tests/executor/replay/test_packs.py": ("executor/replay/packs_file.py",),
    "tests/executor/runtime/test_turnaround.py": (
        "executor/core/sorties.py",
        "executor/runtime/examination.py",
    ),
    "tests/benchmarks/test_distance.py": ("benchmarks/distancepage.py",),
    "tests/benchmarks/test_pictures.py": ("benchmarks/picturespage.py",),
    "tests/benchmarks/test_sorties.py": ("benchmarks/sortiespage.py", "executor/virtual/crew.py"),
    "tests/benchmarks/test_prediction.py": ("benchmarks/predictionpage.py",),
    "tests/benchmarks/test_failures.py": (
        "benchmarks/failurespage.py",
        "benchmarks/least.py",
        "benchmarks/scenario.py",
        "benchmarks/failures_command.py",
    ),
    "tests/benchmarks/test_window.py": (
        "executor/virtual/branches.py",
        "executor/virtual/site.py",
        "benchmarks/windowpage.py",
        "benchmarks/flight_commands.py",
    ),
    "tests/executor/virtual/test_flight.py": (
        "executor/virtual/radio.py",
        "executor/virtual/solver.py",
    ),
    "tests/benchmarks/test_tuning.py": (
        "benchmarks/few_lines_detector.py",
        "benchmarks/tuning_picture.py",
    ),
    "tests/executor/runtime/test_preflight.py": ("executor/runtime/streams.py",),
    "tests/executor/simulated/test_demo_site.py": ("executor/simulated/fleet.py",),
    "tests/simulator/test_ardupilot.py": ("simulator/mission_ardupilot.py",),
    "tests/simulator/test_leg_times.py": (
        "simulator/curves.py",
        "simulator/gliding.py",
        "simulator/smoothing.py",
        "simulator/wander.py",
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
        "simulator/voice.py",
    ),
    "tests/simulator/test_wire.py": ("simulator/streams.py",),
    "tests/executor/site/test_config.py": (
        "executor/site/tables/aircraft.py",
        "executor/site/tables/ground.py",
        "executor/site/tables/links.py",
    ),
    "tests/executor/site/test_heights.py": (
        "executor/core/preflight/heights.py",
        "executor/site/assembly.py",
    ),
    "tests/executor/site/test_planning_asked.py": (
        "executor/flight/checklist.py",
        "executor/flight/examination.py",
        "executor/site/plan_words.py",
    ),
    "tests/executor/site/test_risk.py": (
        "executor/analysis/pictures/risk.py",
        "executor/cli/risk.py",
    ),
    "tests/missions/autopilots/test_dialect.py": ("missions/autopilots/registry.py",),
    "tests/missions/test_encode.py": (
        "missions/autopilots/ardupilot.py",
        "missions/autopilots/px4.py",
    ),
    "tests/missions/test_planfile.py": ("missions/planjson.py",),
    "tests/missions/test_routes.py": ("missions/setup.py",),
    "tests/missions/test_tasks.py": ("missions/flight_model.py", "missions/pricing.py"),
    "tests/benchmarks/scenarios/test_losses.py": ("planner/streets.py",),
    "tests/benchmarks/scenarios/test_search.py": (
        "benchmarks/scenarios/evaluate.py",
        "benchmarks/scenarios/model.py",
        "benchmarks/scenarios/solve.py",
    ),
    "tests/planner/test_exact.py": (
        "planner/highs.py",
        "planner/partition.py",
    ),
    "tests/planner/test_grasp.py": ("planner/kernels/grasp.py",),
    "tests/planner/test_large.py": (
        "planner/parts.py",
        "planner/synthetic.py",
    ),
    "tests/planner/test_risk.py": ("planner/aftermath.py",),
    "tests/planner/test_robust.py": (
        "planner/kernels/change.py",
        "planner/kernels/robust.py",
    ),
    "tests/planner/test_search.py": (
        "planner/construct.py",
        "planner/cost.py",
        "planner/kernels/ruin.py",
        "planner/model.py",
        "planner/result.py",
        "planner/solve.py",
        "planner/rounds.py",
        "planner/starts.py",
    ),
    "tests/benchmarks/scenarios/test_properties.py": (
        "benchmarks/scenarios/construct.py",
        "benchmarks/scenarios/kernels/day.py",
        "benchmarks/scenarios/kernels/dayinsertion.py",
        "benchmarks/scenarios/kernels/daysearch.py",
    ),
    "tests/planner/test_window.py": (
        "planner/kernels/loss.py",
        "planner/kernels/repair.py",
        "planner/kernels/window.py",
        "planner/losses.py",
    ),
    "tests/properties/test_geometry.py": ("missions/geometry.py",),
    "tests/properties/test_planner_bounds.py": (
        "planner/bounds.py",
        "planner/kernels/bounds.py",
    ),
    "tests/properties/test_planner_kernels.py": (
        "planner/kernels/anneal.py",
        "planner/kernels/chance.py",
        "planner/kernels/compiled.py",
        "planner/kernels/insertion.py",
        "planner/kernels/tours.py",
    ),
    "tests/properties/test_planner_sorties.py": (
        "planner/kernels/sortieinsertion.py",
        "planner/kernels/sorties.py",
        "planner/kernels/sortiesearch.py",
        "planner/sorties/construct.py",
        "planner/sorties/evaluate.py",
        "planner/sorties/search.py",
        "planner/sorties/solve.py",
    ),
    "tests/planner/sorties/test_exact.py": ("planner/sorties/model.py",),
    "tests/executor/cli/test_day.py": (
        "executor/analysis/pictures/gantt.py",
        "executor/site/day_words.py",
        "executor/site/sorties.py",
        "executor/site/tables/day.py",
        "missions/dayplan.py",
        "missions/dayplanjson.py",
        "missions/sorties.py",
    ),
    "tests/benchmarks/test_day.py": (
        "benchmarks/daypage.py",
        "benchmarks/day_command.py",
    ),
    "tests/properties/test_planner_subsets.py": (
        "planner/kernels/subsets.py",
        "planner/subsets.py",
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
        named = re.findall(r'"((?:executor|benchmarks)(?:\.\w+)+)"', text)
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

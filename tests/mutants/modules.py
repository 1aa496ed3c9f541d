"""Which files the modules are, and which tests are theirs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

READERS = ("planner/*.py", "missions/**/*.py", "executor/**/*.py")


@dataclass(frozen=True, slots=True)
class Module:
    """Some files that decide one thing, and the tests that are to show it."""

    files: tuple[str, ...]
    """Patterns."""
    tests: tuple[str, ...]
    readers: tuple[str, ...] = READERS
    """Patterns of the files that may read what its files define."""

    def paths(self, root: Path) -> list[str]:
        """Return its files, from the root of the tree."""
        return sorted(str(path.relative_to(root)) for pattern in self.files for path in root.glob(pattern))


MODULES = {
    "core": Module(
        ("executor/core/**/*.py", "executor/analysis/flight_record.py", "missions/autopilots/dialect.py"),
        (
            "tests/executor/core",
            "tests/executor/site/test_plan_summary_heights.py",
            "tests/executor/analysis/test_flight_record.py",
            "tests/executor/analysis/test_flight_record_read_run.py",
            "tests/executor/replay/test_log_replay.py",
            "tests/executor/flight/test_publication.py",
            "tests/properties/test_outbox.py",
            "tests/properties/test_texts.py",
            "tests/properties/test_wire.py",
            "tests/properties/test_wishes.py",
            "tests/test_architecture.py",
        ),
    ),
    "protocols": Module(
        ("executor/protocols/*.py",),
        (
            "tests/executor/protocols",
            "tests/executor/runtime/test_dialogue.py",
            "tests/executor/runtime/test_procedures.py",
            "tests/properties/test_command_machine.py",
            "tests/properties/test_download_machine.py",
            "tests/properties/test_upload_machine.py",
            "tests/test_architecture.py",
        ),
    ),
    "compare": Module(
        ("missions/mission_comparison.py",),
        ("tests/missions/test_mission_comparison.py", "tests/properties/test_missions_items.py"),
    ),
    "geometry": Module(
        ("missions/geometry.py",), ("tests/properties/test_geometry.py", "tests/missions/test_setup.py")
    ),
    "safety": Module(
        ("missions/setup.py", "missions/layers_and_rtl_heights.py", "missions/waypoints.py"),
        (
            "tests/missions/test_setup.py",
            "tests/missions/test_layers_and_rtl_heights.py",
            "tests/missions/test_clearance.py",
        ),
    ),
    "replan": Module(("planner/replan.py",), ("tests/planner/test_replan.py", "tests/planner/test_window.py")),
    "window": Module(
        ("planner/window.py",), ("tests/planner/test_window.py", "tests/properties/test_planner_window.py")
    ),
}

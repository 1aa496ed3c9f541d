"""Rules for the whole tree: imports, lengths, and the numbers of MAVLink."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from collections.abc import Iterator
from enum import IntEnum
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega
from pymavlink.dialects.v20 import common as mav

from executor.core import radio_budget
from executor.protocols import mission_transfer, vehicle_commands
from missions import ARDUPILOT, PX4, Command, Dialect, Frame
from simulator import messages
from tests.patience import PATIENCE_S

ROOT = Path(__file__).parents[1]
PACKAGES = ("faultline", "planner", "missions", "simulator", "executor", "benchmarks")
MOST_LINES = 600
MOST_FUNCTION_LINES = 60


def modules(*folders: str) -> list[Path]:
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))


def functions(path: Path) -> Iterator[tuple[str, int]]:
    """Yield each function of a file with its lines of code: the docstring promises, it does not do."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0]
            said = first.end_lineno - first.lineno + 1 if ast.get_docstring(node) and first.end_lineno else 0
            assert node.end_lineno is not None
            yield f"{path.relative_to(ROOT)}:{node.name}", node.end_lineno - node.lineno + 1 - said


def linted(root: Path) -> subprocess.CompletedProcess[str]:
    """Hold a tree against the import contracts in its pyproject.toml."""
    linter = Path(sys.executable).with_name("lint-imports")
    return subprocess.run(
        [linter, "--no-cache"], cwd=root, capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )


def test_the_import_contracts_hold() -> None:
    done = linted(ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_breach_in_any_folder_is_found(tmp_path: Path) -> None:
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__", "*.json*"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    folders = [init.parent for package in PACKAGES for init in (tmp_path / package).rglob("__init__.py")]
    for folder in folders:
        (folder / "breach.py").write_text("import executor.__main__\nimport faultline\n", encoding="utf-8")
    (tmp_path / "executor" / "core" / "homeless").mkdir()
    (tmp_path / "executor" / "core" / "homeless" / "__init__.py").write_text("", encoding="utf-8")
    done = linted(tmp_path)
    # What lies in a container of its own is not in the list of its floors.
    assert done.returncode == 1
    names = {".".join(folder.relative_to(tmp_path).parts) for folder in folders} - {"executor", "executor.core"}
    above = ("benchmarks", "faultline")  # they may import all of it
    below = {name for name in names if not name.startswith(above)}
    assert {name for name in below if f"{name}.breach -> executor.__main__" not in done.stdout} == set()
    assert {name for name in names - {"faultline"} if f"{name}.breach -> faultline" not in done.stdout} == set()
    assert "executor.core.homeless" in done.stdout


def test_no_file_is_too_long() -> None:
    lengths = {
        str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in modules(*PACKAGES)
    }
    assert {name: lines for name, lines in lengths.items() if lines > MOST_LINES} == {}


def test_no_function_is_too_long() -> None:
    lengths = dict(one for path in modules(*PACKAGES) for one in functions(path))
    assert {name: lines for name, lines in lengths.items() if lines > MOST_FUNCTION_LINES} == {}


def test_nothing_imports_the_tests() -> None:
    for path in modules(*PACKAGES):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not any(name.partition(".")[0] == "tests" for name in names), path


@pytest.mark.parametrize("package", PACKAGES)
def test_every_module_says_what_it_is(package: str) -> None:
    silent = [path for path in modules(package) if not ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))]
    assert silent == []


def test_importing_the_planner_does_not_load_the_compiler() -> None:
    """The command line's help must not wait for numba."""
    code = "import sys, executor.cli.commandline; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False, timeout=PATIENCE_S).returncode == 0


@pytest.mark.parametrize(
    ("member", "prefix"), [*((one, "MAV_CMD_") for one in Command), *((one, "MAV_FRAME_") for one in Frame)]
)
def test_the_numbers_of_items_are_mavlinks(member: Command | Frame, prefix: str) -> None:
    assert getattr(mav, prefix + member.name) == member.value


COMMANDS = ("DO_SET_MODE", "DO_CHANGE_SPEED", "MISSION_START", "COMPONENT_ARM_DISARM", "RUN_PREARM_CHECKS",
            "GET_MESSAGE_INTERVAL", "SET_MESSAGE_INTERVAL", "REQUEST_MESSAGE")  # fmt: skip
MESSAGES = ("AUTOPILOT_VERSION", "CAMERA_IMAGE_CAPTURED")
STREAMS = ("HEARTBEAT", "GLOBAL_POSITION_INT", "SYS_STATUS", "MISSION_CURRENT", "BATTERY_STATUS", "EXTENDED_SYS_STATE",
           "ATTITUDE", "GPS_RAW_INT", "RC_CHANNELS")  # fmt: skip


DIALOGUE = {"NEVER_US", "UNASKED_US", "PERIOD_S", "TRIES", "IN_PROGRESS_S", "RESULT_NAMES", "_CODES"}
"""Beside them: how often a message comes, how a command is repeated, and what its results are called."""


def test_the_numbers_of_orders_are_mavlinks() -> None:
    ours = {name: value for name, value in vars(vehicle_commands).items() if name.isupper() and name not in DIALOGUE}
    assert ours == {name: getattr(mav, f"MAV_CMD_{name}") for name in COMMANDS} | {
        name: getattr(ardupilotmega, f"MAVLINK_MSG_ID_{name}") for name in MESSAGES
    } | {"DO_SEND_BANNER": ardupilotmega.MAV_CMD_DO_SEND_BANNER}
    assert {name: getattr(radio_budget, name) for name in STREAMS} == {
        name: getattr(ardupilotmega, f"MAVLINK_MSG_ID_{name}") for name in STREAMS
    }


def members(enum: str) -> dict[int, str]:
    """Return an enum of MAVLink without its end mark."""
    return {number: entry.name for number, entry in mav.enums[enum].items() if not entry.name.endswith("ENUM_END")}


def test_the_results_have_mavlinks_numbers() -> None:
    mission = members("MAV_MISSION_RESULT")
    assert set(mission_transfer.RESULT_NAMES) == set(mission) - {mav.MAV_MISSION_ACCEPTED}
    assert mission_transfer.RESULT_ACCEPTED == mav.MAV_MISSION_ACCEPTED
    assert mission_transfer.RESULT_ERROR == mav.MAV_MISSION_ERROR
    assert mission_transfer.RESULT_CANCELLED == mav.MAV_MISSION_OPERATION_CANCELLED
    # CANCELLED is in MAVLink's common.xml but still marked as work in progress, so pymavlink leaves it out.
    assert set(vehicle_commands.RESULT_NAMES) - set(members("MAV_RESULT")) == {6}
    assert vehicle_commands.RESULT_NAMES[mav.MAV_RESULT_DENIED] == "denied"
    assert vehicle_commands.RESULT_NAMES[mav.MAV_RESULT_UNSUPPORTED] == "unsupported"


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))
def test_the_results_of_dialects_are_mavlinks(dialect: Dialect) -> None:
    known = members("MAV_MISSION_RESULT")
    names = {known[number] for number in dialect.upload_warnings}
    assert names <= {"MAV_MISSION_INVALID_SEQUENCE"}


def test_the_autopilots_have_mavlinks_numbers() -> None:
    assert (ARDUPILOT.number, PX4.number) == (mav.MAV_AUTOPILOT_ARDUPILOTMEGA, mav.MAV_AUTOPILOT_PX4)


SIMULATED = {
    "Severity": "MAV_SEVERITY_",
    "Result": "MAV_RESULT_",
    "MissionResult": "MAV_MISSION_",
    "MavCommand": "MAV_CMD_",
    "MissionState": "MISSION_STATE_",
    "LandedState": "MAV_LANDED_STATE_",
    "FileOperation": "MAV_FTP_OPCODE_",
}


def test_the_simulator_counts_as_mavlink_does() -> None:
    """It shares no number with what flies it, so each of its enums is held against pymavlink's."""
    found = {
        name: enum for name, enum in vars(messages).items() if isinstance(enum, type(IntEnum)) and enum is not IntEnum
    }
    assert set(found) == set(SIMULATED)
    for name, enum in found.items():
        for member in enum:
            assert getattr(ardupilotmega, SIMULATED[name] + member.name) == member.value, f"{name}.{member.name}"

"""planner and missions as libraries of their own: what they need, and that they need nothing else."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import PATIENCE_S

ROOT = Path(__file__).parents[1]
ALONE = """
import sys
from importlib.metadata import packages_distributions

allowed = {*sys.argv[1].split(), "faultline"}
others = {name for name, owners in packages_distributions().items() if not allowed.intersection(owners)}
before = set(sys.modules)


class NotInstalled:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in others:
            raise ModuleNotFoundError(f"{name} is not installed here", name=name)


sys.meta_path.insert(0, NotInstalled)
{work}
loaded = {name.partition(".")[0] for name in set(sys.modules) - before}
assert "numpy" in loaded, loaded
assert not loaded & others, loaded & others
"""
PLAN = """
import planner
travel = planner.travel_for(planner.PRESETS["mavic3"], 8.0, 3.0)
fleet = [planner.Vehicle(name, (0.0, 0.0), 75.0) for name in ("uav1", "uav2")]
spans = [[[100.0 * span, 50.0], [100.0 * span + 100.0, 50.0]] for span in range(6)]
instance = planner.build_instance(spans, (0.0, 0.0), fleet, travel)
found = planner.solve(instance, cost=planner.Cost.MINMAX, stop=planner.Iterations(50))
assert found.feasible
assert not any(name.partition(".")[0] in {"missions", "executor"} for name in sys.modules)
"""
MISSIONS = """
import missions
network = missions.read_network(missions.default_network_path(), radius_m=400)
assert network.segments
assert not any(name.partition(".")[0] == "executor" for name in sys.modules)
"""


ALSO = "pydantic pydantic_core annotated-types typing_extensions typing-inspection"
"""What parameters of a search and plan files are checked with."""


@pytest.mark.parametrize(
    ("work", "distributions"),
    [(PLAN, f"{ALSO} numpy numba llvmlite"), (MISSIONS, f"{ALSO} numpy numba llvmlite pyproj certifi")],
    ids=["planner", "missions"],
)
def test_it_imports_nothing_else(work: str, distributions: str) -> None:
    command = [sys.executable, "-c", ALONE.replace("{work}", work), distributions]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr

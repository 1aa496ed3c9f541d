"""The wheel in an empty environment, from the package index: without extras it plans, checks and flies."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SITE = """
[network]
file = "default"
radius_m = 700

[[vehicle]]
name = "uav1"
connection = "udpin://127.0.0.1:14551"
sysid = 1
autopilot = "px4"
"""
PLAN = """
import sys, planner
travel = planner.travel_for(planner.PRESETS["mavic3"], 8.0, 3.0)
fleet = [planner.Vehicle(name, (0.0, 0.0), 75.0) for name in ("uav1", "uav2")]
spans = [[[100.0 * span, 50.0], [100.0 * span + 100.0, 50.0]] for span in range(6)]
instance = planner.build_instance(spans, (0.0, 0.0), fleet, travel)
assert planner.solve(instance, cost=planner.Cost.MINMAX, stop=planner.Iterations(50)).feasible
assert "site-packages" in planner.__file__, planner.__file__
"""
pytestmark = [pytest.mark.campaign, pytest.mark.timeout(1200)]


@dataclass(frozen=True, slots=True)
class Place:
    """An environment, and a folder that no source lies in."""

    folder: Path

    def run(self, program: str, *arguments: str) -> tuple[int, str, str]:
        """Run a program of the environment; it sees nothing of ours."""
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL"))}
        done = subprocess.run(
            [self.folder / "venv" / "bin" / program, *arguments], cwd=self.folder, env=environment,
            capture_output=True, text=True, check=False, timeout=900,
        )  # fmt: skip
        return done.returncode, done.stdout, done.stderr

    def install(self, *what: str) -> None:
        code, out, err = self.run("pip", "install", "--quiet", "--disable-pip-version-check", *what)
        assert code == 0, out + err


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-build-isolation", "--no-deps", "-w"]
    subprocess.run([*command, built, ROOT], check=True, timeout=200)
    [made] = built.glob("faultline-*.whl")
    return made


def place(folder: Path) -> Place:
    subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True, timeout=200)
    (folder / "site.toml").write_text(SITE, encoding="utf-8")
    return Place(folder)


def test_the_planner_alone_needs_three_packages(wheel: Path, tmp_path: Path) -> None:
    here = place(tmp_path)
    here.install("numpy", "numba", "pydantic")
    here.install("--no-deps", str(wheel))
    assert here.run("python", "-c", PLAN) == (0, "", "")


def test_the_examples_of_the_library_run_and_are_typed_for_a_user(wheel: Path, tmp_path: Path) -> None:
    here = place(tmp_path)
    here.install(str(wheel), "mypy")
    page = (ROOT / "docs" / "how-to" / "library.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    examples = [block for block in blocks if "import pandas" not in block and "import duckdb" not in block]
    assert len(examples) == 5
    for number, example in enumerate(examples, start=1):
        (tmp_path / f"example{number}.py").write_text(example, encoding="utf-8")
    names = [f"example{number}.py" for number in range(1, 6)]
    code, out, err = here.run("mypy", "--strict", *names)
    assert (code, out) == (0, "Success: no issues found in 5 source files\n"), out + err
    for name in names[:4]:  # the fifth needs a flight
        code, out, err = here.run("python", name)
        assert (code, err) == (0, ""), name + err
    code, out, err = here.run("python", names[4])
    assert (code, err.count("\n")) == (1, 1), err


def test_without_extras_it_plans_checks_and_flies(wheel: Path, tmp_path: Path) -> None:
    here = place(tmp_path)
    here.install(str(wheel))
    code, out, err = here.run("faultline", "plan", "site.toml", "--seconds", "1", "-o", "plan.json")
    assert (code, "flown as it is by" in out) == (0, True), err
    assert here.run("faultline", "check", "plan.json") == (0, "every figure is right\n", "")
    line = "faultline: --picture needs the extra pictures: pip install matplotlib\n"
    assert here.run("faultline", "plan", "site.toml", "--picture", "plan.png") == (2, "", line)
    code, out, err = here.run("faultline", "demo", "--fault", "uav2:silent@40%", "--run", "run1")
    assert code == 0, out + err
    assert "segments inspected; record in run1" in out
    assert "http://127.0.0.1:" in out + err
    assert here.run("faultline", "--version") == (0, "faultline 0.1.0\n", "")
    assert "faultline: a picture of the flight needs the extra pictures: pip install matplotlib" in err
    assert (tmp_path / "run1" / "report.html").exists()
    here.install(f"{wheel}[pictures]")
    assert here.run("faultline", "plan", "site.toml", "--seconds", "1", "--picture", "plan.png")[0] == 0
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")

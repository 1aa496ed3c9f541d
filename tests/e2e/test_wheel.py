"""The wheel in empty environments; `./scripts/try-install` runs this for several interpreters, and brings uv."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from executor import __version__

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
import planner
travel = planner.travel_for(planner.PRESETS["mavic3"], 8.0, 3.0)
fleet = [planner.Vehicle(name, (0.0, 0.0), 75.0) for name in ("uav1", "uav2")]
spans = [[[100.0 * span, 50.0], [100.0 * span + 100.0, 50.0]] for span in range(6)]
instance = planner.build_instance(spans, (0.0, 0.0), fleet, travel)
assert planner.solve(instance, cost=planner.Cost.MINMAX, stop=planner.Iterations(50)).feasible
assert "site-packages" in planner.__file__, planner.__file__
"""
VERSIONS = """
from importlib.metadata import version
print(", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "pydantic", "pyproj", "typer")))
"""
PYTHONS = os.environ.get("FAULTLINE_PYTHONS", sys.executable).split()
RESOLUTIONS = ("lowest-direct", "highest")
PATIENCE_S = 3600
"""Of a computer that does other things beside; the first plan of an environment compiles."""
SYSTEMS = ("x86_64-manylinux_2_28", "aarch64-manylinux_2_28", "aarch64-apple-darwin", "x86_64-pc-windows-msvc")
IMPORTED = {"executor", "faultline", "faultline_start", "missions", "planner", "simulator"}
pytestmark = [pytest.mark.campaign, pytest.mark.timeout(PATIENCE_S)]


@dataclass(frozen=True, slots=True)
class Place:
    """An environment, and a folder that no source lies in."""

    environment: Path
    folder: Path

    def run(self, program: str, *arguments: str, **variables: str) -> tuple[int, str, str]:
        """Run a program of the environment; it sees nothing of ours."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL"))}
        done = subprocess.run(
            [self.environment / "bin" / program, *arguments], cwd=self.folder, env=kept | variables,
            capture_output=True, text=True, check=False, timeout=PATIENCE_S,
        )  # fmt: skip
        return done.returncode, done.stdout, done.stderr

    def install(self, *what: str) -> None:
        uv("pip", "install", "--python", str(self.environment / "bin" / "python"), "--only-binary", ":all:", *what)


def uv(*words: str) -> None:
    done = subprocess.run(
        ["uv", "--quiet", *words], env=os.environ | {"MACOSX_DEPLOYMENT_TARGET": "14.0"},
        capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def make_environment(folder: Path, python: str = sys.executable) -> Place:
    uv("venv", "--no-project", "--python", os.path.realpath(shutil.which(python) or python), str(folder / "venv"))
    return Place(folder / "venv", folder)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("uv") is None:
        pytest.skip("no uv: ./scripts/try-install installs it")
    if given := os.environ.get("FAULTLINE_WHEEL"):
        return Path(given).resolve()
    built = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-build-isolation", "--no-deps", "-w"]
    subprocess.run([*command, built, ROOT], check=True, timeout=PATIENCE_S)
    [made] = built.glob("faultline_uav-*.whl")
    return made


@pytest.fixture(scope="module", params=[f"{Path(python).name} {one}" for python in PYTHONS for one in RESOLUTIONS])
def environment(
    request: pytest.FixtureRequest, wheel: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Path]:
    name, resolution = request.param.split()
    [python] = {python for python in PYTHONS if Path(python).name == name}
    made = make_environment(tmp_path_factory.mktemp("installed"), python)
    made.install("--resolution", resolution, "-r", str(ROOT / "pyproject.toml"))
    made.install("--no-deps", str(wheel))
    made.install("mypy", "pytest>=9")
    yield made.environment
    shutil.rmtree(made.environment)


@pytest.fixture
def here(environment: Path, tmp_path: Path) -> Place:
    (tmp_path / "site.toml").write_text(SITE, encoding="utf-8")
    return Place(environment, tmp_path)


def test_the_wheel_holds_the_packages_typed_and_no_test(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        [metadata] = [archive.read(name).decode() for name in archive.namelist() if name.endswith("METADATA")]
        assert [name for name in archive.namelist() if name.endswith("dist-info/licenses/LICENSE")]
    packages = {name.partition("/")[0] for name in names if "/" in name}
    assert packages | {"faultline_start"} == IMPORTED == set(re.findall(r"^Import-Name: (.*)$", metadata, re.MULTILINE))
    assert {f"{name}/py.typed" for name in packages} <= names
    assert not [name for name in names if re.search(r"/tests?[/_]", name)]


@pytest.mark.parametrize("version", ["3.11", "3.12", "3.13", "3.14"])
@pytest.mark.parametrize("system", SYSTEMS)
def test_every_system_finds_packages_that_need_no_compiler(
    wheel: Path, tmp_path: Path, system: str, version: str
) -> None:
    words = ["--dry-run", "--only-binary", ":all:", "--python-platform", system, "--python-version", version]
    for wanted in ("requirements.lock", "pyproject.toml"):
        for resolution in RESOLUTIONS:
            uv(
                "pip",
                "install",
                *words,
                "--target",
                str(tmp_path),
                "--resolution",
                resolution,
                "-r",
                str(ROOT / wanted),
            )


def test_it_names_another_projects_package(wheel: Path, tmp_path: Path) -> None:
    here = make_environment(tmp_path)
    here.install("--no-deps", str(wheel))
    here.install("--no-deps", "executor")  # of the index
    code, out, err = here.run("faultline", "--version")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("faultline: executor: expected faultline's own package, got ")


def test_the_planner_alone_needs_three_packages(wheel: Path, tmp_path: Path) -> None:
    here = make_environment(tmp_path)
    here.install("numpy", "numba", "pydantic")
    here.install("--no-deps", str(wheel))
    assert here.run("python", "-c", PLAN) == (0, "", "")


def test_it_answers_and_completes(here: Place, record_property: Callable[[str, object], None]) -> None:
    record_property("versions", here.run("python", "-c", VERSIONS)[1].strip())
    assert here.run("faultline", "--version") == (0, f"faultline {__version__}\n", "")
    code, out, err = here.run("faultline", "-h")
    assert (code, out.startswith("Usage: faultline"), err) == (0, True, "")
    asked = {"_FAULTLINE_COMPLETE": "complete_bash", "COMP_WORDS": "faultline resu", "COMP_CWORD": "1"}
    assert here.run("faultline", **asked) == (0, "resume\n", "")


def write_examples(folder: Path) -> list[str]:
    """Write the examples of the library into a folder; returns their names."""
    page = (ROOT / "docs" / "how-to" / "library.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    examples = [block for block in blocks if "import pandas" not in block and "import duckdb" not in block]
    assert len(examples) == 5
    for number, example in enumerate(examples, start=1):
        (folder / f"example{number}.py").write_text(example, encoding="utf-8")
    return [f"example{number}.py" for number in range(1, 6)]


def test_the_examples_of_the_library_run_and_are_typed_for_a_user(here: Place) -> None:
    names = write_examples(here.folder)
    code, out, err = here.run("mypy", "--strict", *names)
    assert (code, out) == (0, "Success: no issues found in 5 source files\n"), out + err
    for name in names[:4]:  # the fifth needs a flight
        code, out, err = here.run("python", name)
        assert (code, err) == (0, ""), name + err
    code, out, err = here.run("python", names[4])
    assert (code, err.count("\n")) == (1, 1), err


def test_without_extras_it_plans_checks_and_flies(here: Place) -> None:
    code, out, err = here.run("faultline", "plan", "site.toml", "--seconds", "1", "-o", "plan.json")
    assert (code, "flown as it is by" in out) == (0, True), err
    assert here.run("faultline", "check", "plan.json") == (0, "every figure is right\n", "")
    line = "faultline: --picture needs the extra pictures: pip install matplotlib\n"
    assert here.run("faultline", "plan", "site.toml", "--picture", "plan.png") == (2, "", line)
    flown = ("demo", "--vehicles", "3", "--radius", "500", "--fault", "uav2:silent@40%", "--run", "runs/last")
    code, out, err = here.run("faultline", *flown)
    assert code == 0, out + err
    assert "segments inspected; record in runs/last" in out
    assert "http://127.0.0.1:" in out + err
    assert "faultline: a picture of the flight needs the extra pictures: pip install matplotlib" in err
    assert (here.folder / "runs" / "last" / "report.html").exists()
    code, out, err = here.run("faultline", "replay", "runs/last")
    assert code == 0, out + err
    code, out, err = here.run("python", write_examples(here.folder)[4])
    assert (code, "uav2" in out and "lost" in out, err) == (0, True, ""), out + err


def test_the_plugin_serves_tests_of_another_program(here: Place) -> None:
    page = (ROOT / "docs" / "how-to" / "test-a-fleet.md").read_text(encoding="utf-8")
    shown = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    (here.folder / "test_theirs.py").write_text("\n".join(shown), encoding="utf-8")
    code, out, err = here.run("pytest", "-q", "--strict-markers")
    assert (code, "2 passed" in out) == (0, True), out + err


def test_pictures_come_with_their_extra(wheel: Path, tmp_path: Path) -> None:
    here = make_environment(tmp_path)
    (tmp_path / "site.toml").write_text(SITE, encoding="utf-8")
    here.install(f"faultline-uav[pictures] @ {wheel.as_uri()}")
    assert here.run("faultline", "plan", "site.toml", "--seconds", "1", "--picture", "plan.png")[0] == 0
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")

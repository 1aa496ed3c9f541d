"""The start of the program: packages that are not its own are named in one line, and none of them is loaded."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.abc import Loader
from importlib.util import spec_from_file_location
from pathlib import Path

import pytest

import faultline_start
from faultline_start import PACKAGES, stranger

ROOT = Path(__file__).parents[1]


def started(*before: Path) -> tuple[int, str, str]:
    """Start the program with folders before its own; returns exit code, output and errors."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (*before, ROOT)))}
    command = [sys.executable, "-c", "from faultline_start import main; main()"]
    done = subprocess.run(
        command, cwd=before[0] if before else ROOT, env=environment, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout, done.stderr


def test_the_program_starts_where_its_packages_are_its_own() -> None:
    assert [stranger(name) for name in PACKAGES] == ["", "", "", ""]
    code, out, err = started()
    assert (code, err) == (0, "")
    assert "Usage" in out


def test_a_package_is_known_by_its_file_where_its_loader_has_no_source(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pytest loads the package of a plugin by a loader of its own."""
    origin = ROOT / "simulator" / "__init__.py"
    spec = spec_from_file_location("simulator", origin, loader=Loader())
    monkeypatch.setattr(faultline_start, "find_spec", lambda _: spec)
    assert not stranger("simulator")


@pytest.mark.parametrize("name", PACKAGES)
@pytest.mark.parametrize("content", ["import pipes_of_old", "", "# Part of something else.\n"])
def test_another_projects_package_is_named_and_not_loaded(name: str, content: str, tmp_path: Path) -> None:
    package = tmp_path / name / "__init__.py"
    package.parent.mkdir()
    package.write_text(content, encoding="utf-8")
    code, out, err = started(tmp_path)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"faultline: {name}: expected faultline's own package, got {package}: uninstall")


def test_a_package_without_its_init_after_an_uninstallation_is_named(tmp_path: Path) -> None:
    for name in PACKAGES:
        (tmp_path / name).mkdir()
        (tmp_path / name / "evaluate.py").write_text("", encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    source = (ROOT / "faultline_start.py").read_text(encoding="utf-8")
    (tmp_path / "faultline_start.py").write_text(source, encoding="utf-8")
    command = [sys.executable, "-S", "-c", "from faultline_start import main; main()"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith(
        "faultline: executor: expected faultline's own package, got a folder without its __ini"
    )


def test_a_package_that_is_not_there_is_named() -> None:
    assert stranger("faultline_of_nobody").startswith(
        "faultline_of_nobody: expected faultline's own package, got none: "
    )

"""Kernels are compiled once for each state of their sources, wherever the package lies."""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import planner.kernels
from planner.kernels.compiling import compute_sources_digest, make_cache_directory

ROOT = Path(__file__).parents[3]
REPORT = """
import importlib, json, pkgutil, sys
import planner
early = "numba" in sys.modules
planner.warm_up()
import numba, planner.kernels
found = {"early": early, "hits": 0, "misses": 0, "kernels": 0, "directory": str(numba.config.CACHE_DIR)}
for module in pkgutil.iter_modules(planner.kernels.__path__):
    members = vars(importlib.import_module(f"planner.kernels.{module.name}"))
    for member in members.values():
        if isinstance(member, numba.core.dispatcher.Dispatcher) and member.__module__.endswith(module.name):
            found["kernels"] += 1
            found["hits"] += sum(member.stats.cache_hits.values())
            found["misses"] += sum(member.stats.cache_misses.values())
            assert len(member.signatures) == 1, (member, member.signatures)
print(json.dumps(found))
"""


def test_a_second_process_compiles_nothing(tmp_path: Path) -> None:
    # Every kernel, those of the paper's solver and of the window too: whichever of them a test before this one used.
    for module in pkgutil.iter_modules(planner.kernels.__path__):
        importlib.import_module(f"planner.kernels.{module.name}")
    compiled = make_cache_directory(numba.__version__)
    # A copy: other processes may use the cache of all tests meanwhile.
    shutil.copytree(compiled, tmp_path / compiled.name)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", REPORT], env=environment, capture_output=True, text=True, check=True)
    second = json.loads(done.stdout)
    assert not second["early"]  # importing the planner had not loaded numba
    assert second["kernels"] > 50
    assert (second["hits"], second["misses"]) == (second["kernels"], 0)
    assert Path(second["directory"]).parent == tmp_path
    package = Path(__file__).parents[3] / "planner"
    assert not list(package.rglob("*.nbi"))  # nothing is written beside the sources


def test_the_users_own_cache_is_the_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(sys, "platform", "linux")
    assert make_cache_directory("1.0").parent == tmp_path / "faultline"


def test_each_numba_has_its_own_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert make_cache_directory("1.0") != make_cache_directory("1.1")
    assert make_cache_directory("1.0").name == f"kernels-{compute_sources_digest('1.0')}"


def test_where_nothing_can_be_written_a_private_directory_serves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_the_way = tmp_path / "file"
    in_the_way.write_text("not a directory")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(in_the_way / "below"))
    private = make_cache_directory("1.0")
    assert private.is_dir()
    assert in_the_way not in private.parents
    assert private.stat().st_mode & 0o077 == 0


KERNELS = """
import logging
from planner.kernels.compiling import kernel
logging.basicConfig(format="%(message)s", level=logging.INFO)

@kernel()
def double(number: int) -> int:
    return 2 * number

@kernel()
def halve(number: float) -> float:
    return 0.5 * number
"""


def test_a_first_start_says_once_that_it_compiles(tmp_path: Path) -> None:
    script = tmp_path / "kernels.py"
    script.write_text(KERNELS)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}
    first, second = (
        subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, check=True)
        for _ in range(2)
    )
    assert first.stderr == "compiling the planner for this computer, once: about half a minute\n"
    assert second.stderr == ""

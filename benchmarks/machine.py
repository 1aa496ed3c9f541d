"""Hardware and software of the measurement."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""The tree of the program."""
PACKAGES = ("numpy", "numba", "highspy", "pyvrp")


def cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def machine() -> dict[str, object]:
    """Return processor, cores, versions, and the commit if this is a working copy."""
    return {
        "processor": _processor(),
        "cores": cores(),
        "python": platform.python_version(),
        "commit": _commit(),
        **{name: _version(name) for name in PACKAGES},
    }


def head(kind: str, command: str) -> dict[str, object]:
    """Return the head of a measurement's JSON; the kind includes its version, as `window/2`."""
    return {"format": f"faultline-bench-{kind}", "machine": machine(), "command": command}


def machine_line(content: dict[str, object]) -> str:
    """Return the machine in one line."""
    versions = ", ".join(f"{name} {content[name]}" for name in ("python", *PACKAGES) if content.get(name))
    return f"Measured on {content['cores']} cores ({content['processor']}), {versions}; commit {content['commit']}."


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _commit() -> str:
    """Return the commit, and whether the program differs from it; changed results do not count."""
    code = ["planner", "missions", "executor"]
    commit = _git("rev-parse", "--short", "HEAD")
    return "unknown" if commit is None else commit + (" with changes" if _git("status", "-s", "--", *code) else "")


def _git(*arguments: str) -> str | None:
    try:
        done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True, timeout=20)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()

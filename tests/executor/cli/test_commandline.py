"""The overview of the commands: made without importing one of them, and true to their own help."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from executor.cli import commandline
from executor.cli.commandline import COMMANDS, CheckoutRequired, load_command, read_summary


@pytest.mark.parametrize("name", COMMANDS)
def test_the_overview_says_what_the_command_itself_says(name: str) -> None:
    summary = " ".join((load_command(name).help or "").split("\n\n")[0].split())
    assert summary == read_summary(name)


def test_the_overview_imports_no_command() -> None:
    code = (
        "import sys\nfrom executor.cli.main import main\n"
        "try:\n    main(['--help'])\n"
        "except SystemExit:\n    print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=100)
    loaded = set(done.stderr.split())
    assert "executor.cli.commandline" in loaded
    assert (
        loaded
        & {"numpy", "missions", "planner", "simulator", *(place.partition(":")[0] for place in COMMANDS.values())}
        == set()
    )
    assert all(f"  {name}" in done.stdout for name in COMMANDS)


def test_an_installed_package_says_where_benchmarks_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(commandline, "ROOT", tmp_path)
    with pytest.raises(CheckoutRequired, match=r"^bench: not part of the installed package; run ./scripts/bench in"):
        load_command("bench")

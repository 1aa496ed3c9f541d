"""The overview of the commands: made without importing one of them, and true to their own help."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from executor import __version__
from executor.cli import commandline
from executor.cli.commandline import COMMANDS, CheckoutRequired, load_command, read_summary
from tests.patience import PATIENCE_S


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
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=PATIENCE_S)
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


ROOT = Path(__file__).parents[3]


def run_faultline(*given: str, **environment: str) -> str:
    command = [sys.executable, "-m", "executor", *given]
    done = subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE_S,
    )
    return done.stdout


def test_the_version_is_the_package_s() -> None:
    assert run_faultline("--version") == f"faultline {__version__}\n"
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.*)$", citation, re.MULTILINE) == [__version__]


@pytest.mark.parametrize("given", [("-h",), ("plan", "-h"), ("bench", "-h")], ids=" ".join)
def test_help_is_asked_for_in_short(given: tuple[str, ...]) -> None:
    assert run_faultline(*given) == run_faultline(*given[:-1], "--help")


@pytest.mark.parametrize(
    ("words", "completed"), [("faultline resu", "resume\n"), ("faultline plan --pict", "--picture\n")]
)
def test_the_shell_completes_commands_and_options(words: str, completed: str) -> None:
    count = str(len(words.split()) - 1)
    assert run_faultline(_FAULTLINE_COMPLETE="complete_bash", COMP_WORDS=words, COMP_CWORD=count) == completed

"""What README says works as it is written there."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from executor.cli.main import main

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
SITE = re.search(r"```toml\n(.*?)```", README, re.DOTALL)
ROWS = re.findall(r"^\| (`faultline .*?) \|", README, re.MULTILINE)
CALLS = [call for row in ROWS for call in re.findall(r"`faultline ([^`]*)`", row)]
NEEDS_VEHICLES = ("simulate", "fly", "preflight", "resume", "restore", "demo")
NEEDS_LOGS_OR_HOURS = ("replay", "bench")
RUNS = [call for call in CALLS if not call.startswith((*NEEDS_VEHICLES, *NEEDS_LOGS_OR_HOURS))]


def call(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[object, str]:
    with pytest.raises(SystemExit) as ended:
        main(words)
    return ended.value.code, "".join(capsys.readouterr())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with README's site, and the plan of its first call."""
    assert SITE is not None
    folder = tmp_path_factory.mktemp("readme")
    (folder / "site.toml").write_text(SITE.group(1), encoding="utf-8")
    return folder


def test_there_is_something_to_try() -> None:
    assert len(RUNS) >= 8
    assert RUNS[1].startswith("plan SITE -o plan.json")


@pytest.mark.parametrize("said", RUNS)
def test_a_call_of_the_table(
    said: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    names = {"SITE": "site.toml", "PLAN": "plan.json", "DIR": "out", "NETWORK": "default"}
    if said.startswith("init"):
        names["SITE"] = "new.toml"
    if not Path("plan.json").exists():
        call(capsys, "plan", "site.toml", "--seconds", "0.5", "-o", "plan.json")
    words = [names.get(word, word) for word in shlex.split(said)]
    if words[0] == "plan":
        words += ["--seconds", "2"]
    if words[0] == "risk":
        words += ["--samples", "500", "--jobs", "1"]
    code, text = call(capsys, *words)
    assert code == 0, text


def test_the_site_is_what_init_writes(capsys: pytest.CaptureFixture[str]) -> None:
    assert SITE is not None
    code, text = call(capsys, "init", "default", "--radius", "1500")
    assert (code, text) == (0, SITE.group(1))


def test_every_command_is_one(capsys: pytest.CaptureFixture[str]) -> None:
    _, text = call(capsys, "--help")
    commands = {line.split()[0] for line in text.splitlines() if line.startswith("  ") and line.split()}
    assert {call.split()[0] for call in CALLS} <= commands

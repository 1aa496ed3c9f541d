"""The program of the how-to: it plans and flies over the plan page's API."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from tests.patience import PATIENCE_S

ROOT = Path(__file__).parents[2]


def test_the_program_of_the_how_to_plans_and_flies(tmp_path: Path) -> None:
    text = (ROOT / "docs/how-to/plan-page.md").read_text(encoding="utf-8")
    [program] = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    command = tmp_path / "bin" / "faultline"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m executor "$@"\n')
    command.chmod(0o755)
    folder = tmp_path / "empty"
    folder.mkdir()
    paths = {"PATH": f"{command.parent}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    started = subprocess.Popen(
        [sys.executable, "-c", program], cwd=folder, env=os.environ | paths, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    try:
        out, wrong = started.communicate(timeout=PATIENCE_S)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(started.pid, signal.SIGTERM)  # what it has started, where it did not come so far
    assert started.returncode == 0, wrong
    said = out.splitlines()
    inspected, total = re.findall(r"(\d+) of (\d+) segments inspected", said[-1])[0]
    assert inspected == total
    assert any(line.startswith("heights: ") for line in said)
    assert any(re.fullmatch(r"\d+ segments of uav2 go to the others, 0 are left over", line) for line in said)
    assert (folder / "plan.json").is_file()

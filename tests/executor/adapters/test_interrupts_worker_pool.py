"""Processes that work for a program end with it, however it dies."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import time
from pathlib import Path

from executor.adapters.interrupts import end_processes
from tests.patience import PATIENCE_S

ROOT = Path(__file__).parents[3]
PROGRAM = """
import os, signal, sys, time
from executor.adapters.interrupts import start_worker_pool

def begun(path):
    with open(path, "a") as file:
        file.write("working\\n")
    time.sleep(3600.0)

if __name__ == "__main__":
    pool = start_worker_pool(2)
    for number in range(2):
        pool.submit(begun, f"{sys.argv[1]}-{number}")
    while not all(os.path.exists(f"{sys.argv[1]}-{number}") for number in range(2)):
        time.sleep(0.05)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_workers_end_with_a_program_that_is_killed(tmp_path: Path) -> None:
    path = tmp_path / "program.py"
    path.write_text(PROGRAM, encoding="utf-8")
    # The workers have its output too: it is at its end once the last of them has gone.
    done = subprocess.run(
        [sys.executable, path, tmp_path / "begun"],
        env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode < 0
    assert (tmp_path / "begun-1").read_text() == "working\n"


def test_an_ended_process_is_not_killed_though_another_has_reaped_it() -> None:
    process = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(3600.0,))
    process.start()
    assert process.pid is not None
    process.terminate()
    os.waitpid(process.pid, 0)  # a pool's own thread asks for it too, and one of the two is first
    assert process.is_alive()
    assert end_processes([process]) == 0

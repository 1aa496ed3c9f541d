"""Start-up time: import, first plan with nothing compiled, first plan with everything compiled."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from statistics import median

from benchmarks.machine import ROOT
from benchmarks.markdown import figure, markdown_table
from benchmarks.parts.setting import Setting
from benchmarks.store import Json
from planner import Stopwatch

TITLE = "Start times"
WARM_STARTS = 5
NOTHING = "pass"
IMPORT = "import planner"
FIRST_PLAN = """
from benchmarks.problems import line_instance, network_of, PAPER_S
from planner import Cost, Iterations, solve
instance = line_instance(network_of(None, 2000).ends_m, 4, PAPER_S)
assert not solve(instance, cost=Cost.MINCOMB, stop=Iterations(1)).plan.uncovered
"""


def make(setting: Setting) -> Json:
    """Measure processes from their start to their end."""
    pieces = setting.pieces(WARM_STARTS, 2)
    setting.told(TITLE, 0, 1)
    with tempfile.TemporaryDirectory() as cache:
        cold = _process_s(FIRST_PLAN, cache)
        result: Json = {
            "python_s": median(_process_s(NOTHING, cache) for _ in range(pieces)),
            "import_s": median(_process_s(IMPORT, cache) for _ in range(pieces)),
            "cold_s": cold,
            "warm_s": median(_process_s(FIRST_PLAN, cache) for _ in range(pieces)),
            "starts": pieces,
        }
    setting.told(TITLE, 1, 1)
    return result


def _process_s(code: str, cache: str) -> float:
    """Return the time of a new interpreter for some code, with its own directory for compiled kernels."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache, "PYTHONPATH": str(ROOT)}
    watch = Stopwatch()
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, timeout=600)
    return watch.seconds


def report(result: Json) -> str:
    """Return its part of the page."""
    rows = [
        ("Python alone", figure(result["python_s"], 2)),
        ("import planner, less Python alone", figure(result["import_s"] - result["python_s"], 2)),
        ("first plan with nothing compiled yet", figure(result["cold_s"], 1)),
        ("first plan with compiled kernels", figure(result["warm_s"], 2)),
    ]
    return (
        "Whole processes, from start to end, on faultline's own network within 2000 m; the median of "
        f"{result['starts']}, the cold one once.\n\n" + markdown_table(("process", "seconds"), rows)
    )

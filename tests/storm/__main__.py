"""Flies random hostile stories on all processors, and shrinks those that fail: `./scripts/storm --help`."""

from __future__ import annotations

import argparse
import hashlib
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait

from executor.adapters.interrupts import defer_ctrl_c
from tests.stories.judge import told_in
from tests.storm.compose import close, composed
from tests.storm.judge import findings
from tests.storm.plot import Plot, from_json
from tests.storm.shrink import Shrunk
from tests.storm.sky import Stormed, fly
from tests.storm.table import Table
from tests.storm.work import Judged, done, quiet

TOLD_S = 10.0
AHEAD = 3
"""Stories that wait for each process."""


def _show(short: Shrunk) -> None:
    print(f"\n{short.finding}\n{short.plot}")
    print(f"  again: ./scripts/storm --story '{short.plot.to_json()}'", flush=True)


def storm(plots: Iterator[Plot], seconds: float, jobs: int, *, shrinks: bool) -> Table:
    """Fly stories until there are no more, or the time is over, or Ctrl-C; print what fails, shrunk."""
    table, began_s = Table(), time.monotonic()
    pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"), initializer=quiet)
    waiting: set[Future[Judged | Shrunk]] = set()
    told_s = began_s
    try:
        while True:
            late = time.monotonic() - began_s >= seconds
            with defer_ctrl_c():
                while len(waiting) < jobs * AHEAD and not late and (plot := next(plots, None)) is not None:
                    waiting.add(pool.submit(done, plot))
            if not waiting:
                break
            ended, waiting = wait(waiting, timeout=1.0, return_when=FIRST_COMPLETED)
            for result in [future.result() for future in ended]:
                if isinstance(result, Shrunk):
                    _show(result)
                    continue
                plot, found, busy_s = result
                for one in table.add(plot, found, busy_s):
                    print(f"seed {plot.seed}: {one}", flush=True)
                    if shrinks:
                        waiting.add(pool.submit(done, (plot, one)))
            if time.monotonic() - told_s >= TOLD_S:
                told_s = time.monotonic()
                rate = table.flown / (told_s - began_s)
                print(f"  {table.flown} stories, {table.failed} failed, {rate:.2f}/s", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        print("Ctrl-C: what was flown until now", flush=True)
        pool.shutdown(wait=False, cancel_futures=True)
        for process in multiprocessing.active_children():
            process.terminate()
    else:
        pool.shutdown()
    print("\n".join(table.lines(time.monotonic() - began_s)), flush=True)
    return table


def digest(stormed: Stormed) -> str:
    """Return a fingerprint of all that happened, was commanded and was said."""
    return hashlib.sha256(told_in(stormed.flown).encode()).hexdigest()[:16]


def _one(plot: Plot) -> int:
    print(plot)
    stormed = fly(plot)
    print(told_in(stormed.flown))
    found = findings(stormed)
    print(*found, sep="\n")
    print(f"shown at the end: {dict(stormed.shown)}\nfingerprint {digest(stormed)}")
    return 1 if found else 0


def main() -> int:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(prog="storm", description=__doc__)
    parser.add_argument("--stories", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1, help="of the first story; the others follow")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="no new story after this")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--one", type=int, metavar="SEED", help="fly one story again, and tell all of it")
    parser.add_argument("--close", action="store_true", help="of one vehicle: what happens to it comes close together")
    parser.add_argument("--story", metavar="JSON", help="the same for a story that was shrunk")
    parser.add_argument("--as-it-is", action="store_true", help="do not shrink what fails")
    given = parser.parse_args()
    if given.story is not None:
        return _one(from_json(given.story))
    tells = close if given.close else composed
    if given.one is not None:
        return _one(tells(given.one))
    plots = map(tells, range(given.seed, given.seed + given.stories))
    return 1 if storm(plots, given.seconds, given.jobs, shrinks=not given.as_it_is).failed else 0


if __name__ == "__main__":
    sys.exit(main())

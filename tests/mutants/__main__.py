"""Changes the decisions a little, at random, and shows which changes no test notices: `./scripts/mutants --help`."""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.mutants.judge import AlreadyFailing, Limits
from tests.mutants.modules import MODULES
from tests.mutants.mutate import Verdict
from tests.mutants.run import EQUIVALENTS, BadList, at_place, candidates, chosen, equivalents, run

ROOT = Path(__file__).parents[2]
NEEDED = ("executor", "missions", "planner", "tests", "scripts", "docs", "pyproject.toml", "README.md")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="mutants", description=__doc__)
    parser.add_argument("--module", action="append", choices=MODULES, help="only this one; may be given again")
    parser.add_argument("--at", metavar="FILE[:LINE]", help="all changes of a file or of a line")
    parser.add_argument("--count", type=int, default=300, help="how many changes, chosen at random")
    parser.add_argument("--seed", type=int, default=1, help="of the choice")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="no new change after this")
    parser.add_argument("--patience", type=float, default=60.0, help="seconds of tests for each, the best first")
    parser.add_argument("--least", type=float, default=0.9, help="the share that tests have to notice")
    parser.add_argument("--list", action="store_true", help="print the changes that would be tried, and try none")
    parser.add_argument("--store", type=Path, help=argparse.SUPPRESS)
    return parser.parse_args()


def _in_copy() -> int:
    """Do the same in a copy of the tree, so that this one is never changed."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        for name in NEEDED:
            # With the times of the files, so that what was compiled of them stays valid.
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, Path(folder, name), symlinks=True)
            else:
                shutil.copy2(ROOT / name, Path(folder, name))
        command = [sys.executable, "-m", "tests.mutants", *sys.argv[1:], "--store", str(ROOT / ".mutants")]
        return subprocess.run(command, cwd=folder, check=False).returncode


def main() -> int:
    """Do what the command line says."""
    given = _arguments()
    if given.store is None and not given.list:
        return _in_copy()
    began_s = time.monotonic()
    found = candidates(MODULES, ROOT)
    try:
        reasons = equivalents(EQUIVALENTS, found)
    except BadList as why:
        print(why, file=sys.stderr)
        return 2
    asked = [one for one in found if not given.module or one.module in given.module]
    if given.at is not None:
        asked = at_place(asked, given.at)
    todo = chosen(asked, given.count, given.seed)
    print(f"{len(todo)} of {len(asked)} changes, seed {given.seed}", flush=True)
    if given.list:
        print(*(one.shown() for one in todo), sep="\n\n")
        return 0
    try:
        results = run(todo, MODULES, reasons, given.store, Limits(given.seconds, given.patience))
    except AlreadyFailing as why:
        print(why, file=sys.stderr)
        return 2
    for one, verdict in results.judged:
        if verdict is Verdict.EQUIVALENT:
            print(f"{one.shown()}\n  equivalent: {reasons[one.key]}\n")
    print(*results.lines(), sep="\n")
    print(f"{time.monotonic() - began_s:.0f} s")
    return 0 if results.rate() >= given.least else 1


if __name__ == "__main__":
    sys.exit(main())

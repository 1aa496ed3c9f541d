"""A coverage-guided run over one target: `python -m tests.fuzz.guided TARGET --seconds S [--corpus DIR]`.

It needs atheris (`pip install atheris`). An input that takes more than five seconds, or a process that grows beyond
2 GB, counts as a find, as any exception does that the target does not expect; the input is then left in a file.
"""

from __future__ import annotations

import argparse
import atexit
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

PACKAGES = ["executor", "missions"]
HANG_S = 5
MOST_MB = 2048
STEADY = 0.25
"""The part of a run after which its memory is looked at first: caches are filled by then."""


class Watched:
    """A target that is counted, and the memory that it leaves behind."""

    def __init__(self, name: str, target: Callable[[bytes], None], seconds: float) -> None:
        self.name, self.target = name, target
        self.began_s = time.monotonic()
        self.steady_s = self.began_s + STEADY * seconds
        self.inputs = 0
        self.steady_mb: float | None = None

    def __call__(self, data: bytes) -> None:
        self.inputs += 1
        if self.steady_mb is None and self.inputs % 1000 == 0 and time.monotonic() > self.steady_s:
            self.steady_mb = memory_mb()
        self.target(bytes(data))

    def tell(self) -> None:
        """Say how far it came."""
        took_s = time.monotonic() - self.began_s
        grew = "" if self.steady_mb is None else f", from {self.steady_mb:.0f} MB after {STEADY:.0%} of the time"
        print(f"{self.name}: {self.inputs} inputs in {took_s:.0f} s; {memory_mb():.0f} MB{grew}", flush=True)


def memory_mb() -> float:
    """Return what the process holds at the moment."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def main() -> None:
    """Run until the time is over or something is found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target")
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--corpus", type=Path, default=None, metavar="DIR", help="what earlier runs found interesting")
    given = parser.parse_args()
    try:
        import atheris
    except ImportError:
        print("fuzz: atheris is not installed (pip install atheris)", file=sys.stderr)
        sys.exit(2)
    with atheris.instrument_imports(include=PACKAGES):
        from tests.fuzz.targets import TARGETS, seeds
    if given.target not in TARGETS:
        print(f"fuzz: expected one of {', '.join(TARGETS)}, got '{given.target}'", file=sys.stderr)
        sys.exit(2)
    corpus = given.corpus or Path(tempfile.mkdtemp(prefix=f"faultline-fuzz-{given.target}-"))
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(seeds(given.target)):
        (corpus / f"seed-{number}").write_bytes(seed)
    watched = Watched(given.target, TARGETS[given.target], given.seconds)
    atexit.register(watched.tell)
    options = [f"-max_total_time={given.seconds}", f"-timeout={HANG_S}", f"-rss_limit_mb={MOST_MB}", "-max_len=8192"]
    options += ["-verbosity=0", "-print_final_stats=0", f"-artifact_prefix={given.target}-"]
    atheris.Setup([sys.argv[0], *options, str(corpus)], watched)
    atheris.Fuzz()


if __name__ == "__main__":
    main()

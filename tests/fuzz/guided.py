"""A coverage-guided run over one target: `python -m tests.fuzz.guided TARGET --seconds S [--corpus DIR]`.

It needs atheris (`pip install atheris`). An input that takes more than ten seconds, or a process that grows beyond
2 GB, counts as a find, as any exception does that the target does not expect; the input is then left in a file.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

FOLLOWED = {
    "packets": ["executor.adapters.mavlink"],
    "flight": ["executor.adapters.mavlink", "executor.core"],
    "site": ["executor.site.site_file", "executor.core.interface.connection"],
    "mqtt": ["executor.adapters.mqtt"],
    "web": [
        "executor.adapters.web",
        "executor.core.operator.intent_handling",
        "executor.core.operator.intent_refusals",
    ],
}
"""Whose branches guide the search for a target; all others run at their full speed."""
HANG_S = 10
MOST_MB = 2048
MOST_BYTES = 1500
LOOKED_AT = (0.25, 0.5, 0.75, 0.97)
"""The parts of a run after which its memory is looked at."""


class Watched:
    """A target that is counted, and the memory that it leaves behind."""

    def __init__(self, name: str, target: Callable[[bytes], None], seconds: float) -> None:
        self.name, self.target = name, target
        self.began_s = time.monotonic()
        self.marks = [(self.began_s + part * seconds, part) for part in LOOKED_AT]
        self.inputs = 0

    def __call__(self, data: bytes) -> None:
        self.inputs += 1
        if self.marks and self.inputs % 100 == 0 and time.monotonic() > self.marks[0][0]:
            self.tell(self.marks.pop(0)[1])
        self.target(bytes(data))

    def tell(self, part: float) -> None:
        """Say how far it came: libFuzzer ends the process itself."""
        took_s = time.monotonic() - self.began_s
        print(f"{self.name}: {part:4.0%}, {self.inputs} inputs in {took_s:.0f} s, {memory_mb():.0f} MB", flush=True)


def memory_mb() -> float:
    """Return what the process holds at the moment."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def main() -> None:
    """Run until the time is over or something is found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target", choices=sorted(FOLLOWED))
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--corpus", type=Path, default=None, metavar="DIR", help="what earlier runs found interesting")
    given = parser.parse_args()
    try:
        import atheris
    except ImportError:
        print("fuzz: atheris is not installed (pip install atheris)", file=sys.stderr)
        sys.exit(2)
    with atheris.instrument_imports(include=FOLLOWED[given.target]):
        from tests.fuzz.targets import TARGETS, seeds
    corpus = given.corpus or Path(tempfile.mkdtemp(prefix=f"faultline-fuzz-{given.target}-"))
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(seeds(given.target)):
        (corpus / f"seed-{number}").write_bytes(seed)
        TARGETS[given.target](seed)  # what is made once is not the first input's fault
    watched = Watched(given.target, TARGETS[given.target], given.seconds)
    options = [
        f"-max_total_time={given.seconds}",
        f"-timeout={HANG_S}",
        f"-rss_limit_mb={MOST_MB}",
        f"-max_len={MOST_BYTES}",
    ]
    options += ["-verbosity=0", "-print_final_stats=1", f"-artifact_prefix={given.target}-"]
    atheris.Setup([sys.argv[0], *options, str(corpus)], watched)
    atheris.Fuzz()


if __name__ == "__main__":
    main()

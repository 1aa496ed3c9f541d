"""All parts of the measurements: each makes its page and its JSON."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.errors import BenchError
from benchmarks.machine import machine, machine_line
from benchmarks.markdown import markdown_page
from benchmarks.parts import bounds, csum, exact, mtsp, onboard, replan, scale, start
from benchmarks.parts.names import PartName
from benchmarks.parts.setting import Setting
from benchmarks.progress import ShownProgress
from benchmarks.store import Json, Store, write_result, write_text
from executor.adapters.extras import Extra, require_extra


@dataclass(frozen=True, slots=True)
class _Work:
    title: str
    make: Callable[[Setting], Json]
    report: Callable[[Json], str]
    draw: Callable[[Json, Path], None] | None = None


WORK = {
    PartName.CSUM: _Work(csum.TITLE, csum.make, csum.report),
    PartName.MTSP: _Work(mtsp.TITLE, mtsp.make, mtsp.report),
    PartName.EXACT: _Work(exact.TITLE, exact.make, exact.report),
    PartName.BOUNDS: _Work(bounds.TITLE, bounds.make, bounds.report),
    PartName.REPLAN: _Work(replan.TITLE, replan.make, replan.report),
    PartName.SCALE: _Work(scale.TITLE, scale.make, scale.report, scale.draw_scale),
    PartName.START: _Work(start.TITLE, start.make, start.report),
    PartName.ONBOARD: _Work(onboard.TITLE, onboard.make, onboard.report),
}
NEED_DATA = frozenset({PartName.CSUM, PartName.MTSP, PartName.BOUNDS})


def make_parts(parts: Sequence[PartName], data: Path | None, out: Path, *, seed: int, quick: bool, fresh: bool) -> None:
    """Measure the parts one after the other, and write solvers-<part>.md and .json of each.

    Raises:
        ExtraMissing: a part has a picture, and no drawing library is installed.
        BenchError: a measurement is not possible, or the directory cannot be written.
    """
    for part in parts:
        if WORK[part].draw is not None:
            require_extra(Extra.PICTURES, f"bench solvers --part {part.value}")
    for part in parts:
        if data is None and part in NEED_DATA:
            missing = "no ../shared/data next to the project or the working directory; --data DIR names it"
            print(f"faultline: {part.value} is left out: {missing}", file=sys.stderr)
            continue
        work = WORK[part]
        store = Store(out / "solvers" / part.value, fresh=fresh)
        with ShownProgress() as shown:
            result = work.make(Setting(data, store, shown.show_stage, seed, quick))
        about = machine()
        write_result(out / f"solvers-{part.value}.json", {"machine": about, "seed": seed, "quick": quick, **result})
        tried = "**Only tried: a tenth of every time, and fewer pieces.**" if quick else ""
        write_text(
            out / f"solvers-{part.value}.md", markdown_page(work.title, machine_line(about), tried, work.report(result))
        )
        if work.draw is not None:
            try:
                work.draw(result, out / f"solvers-{part.value}.png")
            except OSError as error:
                raise BenchError(f"{out}: cannot be written: {error.strerror}") from error
        print(f"{out / f'solvers-{part.value}.md'} is written")

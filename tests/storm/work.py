"""What the processes of a storm do: fly and judge, and shrink."""

from __future__ import annotations

import gc
import signal
import time

from executor.adapters.interrupts import end_with_parent
from tests.stories.judge import Finding
from tests.storm.judge import findings
from tests.storm.plot import Plot
from tests.storm.shrink import Shrunk, shrunk
from tests.storm.sky import fly

STUCK_S = 120
"""Of the processor: a story that takes longer stands still in virtual time."""


Judged = tuple[Plot, tuple[Finding, ...], float]
"""A story, what must not be in it, and what it took of a processor."""


class Stuck(SystemExit):
    """A story that takes for ever; what ends a process passes through an event loop."""


def _ring(*_: object) -> None:
    raise Stuck("stuck")


def judged(plot: Plot) -> tuple[Finding, ...]:
    """Fly a story and return what must not be in it."""
    signal.signal(signal.SIGVTALRM, _ring)
    signal.setitimer(signal.ITIMER_VIRTUAL, STUCK_S)
    gc.disable()
    try:
        return tuple(findings(fly(plot)))
    except Stuck:
        return (Finding("stuck", 0.0, f"more than {STUCK_S} s of the processor"),)
    except Exception as error:  # noqa: BLE001 - whatever breaks a story is what is looked for
        return (Finding("broken", 0.0, f"{type(error).__name__}: {error}"),)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        gc.enable()
        gc.collect()
        gc.freeze()  # what is there now stays: to look through it after every story takes a fifth of the time


def done(order: Plot | tuple[Plot, Finding]) -> Judged | Shrunk:
    """Fly a story; or shrink one that fails."""
    if isinstance(order, tuple):
        return shrunk(*order, judged)
    began_s = time.process_time()
    return order, judged(order), time.process_time() - began_s


def quiet() -> None:
    """Leave Ctrl-C to the process that everybody works for, and end with it; what is imported is no story's garbage."""
    end_with_parent()
    gc.freeze()
    signal.signal(signal.SIGINT, signal.SIG_IGN)

"""What a simulated fleet notes beside a run: which fault was injected, and when it really happened."""

from __future__ import annotations

from pathlib import Path

from executor.adapters.clock import SystemClock
from executor.adapters.run_directory import RunDirectory
from executor.analysis.report import Happening
from executor.simulator.truth import read_truths

KINDS = {
    "silent": "link",
    "battery-step": "battery",
    "drain": "battery",
    "crash": "interruption",
    "reboot": "interruption",
    "refuse-upload": "interruption",
    "half-upload": "interruption",
}
"""What a fault that the simulator injects should be declared as."""


def happenings(run: Path, clock: SystemClock) -> list[Happening]:
    """Return when the ordered faults really happened, in the ground station's time."""
    path = RunDirectory(run).truths
    if not path.exists():
        return []
    found = []
    for truth in read_truths(path):
        if not truth.what.startswith("fault "):
            continue
        name = truth.what.partition(":")[2].partition("@")[0].partition("=")[0]
        at_s = (truth.unix_s - clock.began_unix_s) * clock.speedup
        found.append(Happening(truth.vehicle, KINDS.get(name, name), at_s))
    return found

"""Ground truth of a simulated fleet: the injected faults, and when they really happened."""

from __future__ import annotations

from pathlib import Path

from executor.adapters.clock import SystemClock
from executor.adapters.run_directory import RunDirectory
from executor.analysis.report import InjectedFault
from simulator.truth import Truth, read_truths

KINDS = {
    "silent": "link", "battery-step": "battery", "drain": "battery", "crash": "interruption", "weak": "interruption",
    "reboot": "interruption", "refuse-upload": "interruption", "half-upload": "interruption", "fence": "fence",
    "gps": "interruption", "camera-silent": "payload", "camera-mute": "payload", "card-full": "payload",
    "gimbal-stuck": "payload",
}  # fmt: skip
"""Expected fault kind for each fault that the simulator injects."""


def read_injected_faults(run: Path, clock: SystemClock) -> list[InjectedFault]:
    """Return when the injected faults really happened, in the ground station's time."""
    path = RunDirectory(run).truths
    if not path.exists():
        return []
    dated = ((truth, (truth.unix_s - clock.began_unix_s) * clock.speedup) for truth in read_truths(path))
    return [one for truth, at_s in dated if (one := find_injected_fault(truth, at_s)) is not None]


def find_injected_fault(truth: Truth, at_s: float) -> InjectedFault | None:
    """Return a truth's injected fault, with its time on the ground station's clock; None if it has none."""
    if not truth.what.startswith("fault "):
        return None
    name = truth.what.partition(":")[2].partition("@")[0].partition("=")[0]
    return InjectedFault(truth.vehicle, KINDS.get(name, name), at_s)

"""The judge of storms sees what must not be, and excuses what nobody on the ground can help; by truths made for it."""

from __future__ import annotations

import pytest

from executor.core.events import LaunchOrdered
from executor.simulator.truth import Truth
from tests.stories.story import Story
from tests.stories.world import Flown
from tests.storm.judge import findings
from tests.storm.plot import Happening, Plot
from tests.storm.sky import Stormed

PADS = {"uav1": (49.6, 15.6), "uav2": (49.602, 15.6)}
LAUNCH_S, END_S = 10.0, 400.0
BEGUN = ((10.5, "order command 400 1"), (10.6, "armed"), (10.8, "mode AUTO"), (11.0, "took_off"))
ENDED = ((300.0, "descends"), (320.0, "landed"), (322.0, "disarmed"))
SPACING_M = 6.0


def truth(name: str, t_s: float, what: str, place: tuple[float, float], up_m: float = 0.0) -> Truth:
    sender = 255 if what.startswith("order") else None
    return Truth(name, what, t_s, t_s, sender, *place, up_m, 90.0)


def stormed(
    *happened: tuple[str, float, str], truths: tuple[Truth, ...] = (), began: tuple[Happening, ...] = ()
) -> Stormed:
    """Return the flight of two vehicles with nothing to inspect in which this happened, each over its pad."""
    told = [truth(name, 0.0, "at", place) for name, place in PADS.items()]
    told += [truth(name, t_s, what, place) for name, place in PADS.items() for t_s, what in (*BEGUN, *ENDED)]
    told += [truth(name, t_s, what, PADS[name]) for name, t_s, what in happened]
    flown = Flown(
        Story("test", ()), "ardupilot", (*told, *truths), ((LAUNCH_S, LaunchOrdered()),), (), (), (), LAUNCH_S, END_S,
        END_S, {"uav1": 1, "uav2": 2}, PADS, {}, {}, frozenset(), 20.0, 0,
    )  # fmt: skip
    plot = Plot(1, "ardupilot", "line", dict.fromkeys(PADS, ()), began)
    shown = dict.fromkeys(PADS, "landed")
    return Stormed(plot, flown, tuple((one.at_s, one) for one in began), (), False, shown, SPACING_M)


def rules(told: Stormed) -> set[str]:
    return {finding.rule for finding in findings(told)}


@pytest.mark.parametrize(("falls", "found"), [(None, {"apart"}), ("reboot", set()), ("crash", set())])
def test_who_falls_through_anothers_layer_did_not_fly_there(falls: str | None, found: set[str]) -> None:
    near = tuple(truth(name, 100.0, "at", PADS["uav1"], up_m) for name, up_m in (("uav1", 12.0), ("uav2", 14.0)))
    fault = (("uav2", 99.0, f"fault uav2:{falls}@0s"),) if falls else ()
    assert rules(stormed(*fault, truths=near)) == found

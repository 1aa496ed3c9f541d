"""The judge of storms detects failures, and excuses what no ground station can know, on truths made for it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import Level, Say
from executor.core.interface.events import LaunchOrdered
from simulator.truth import Truth
from tests.stories.story import Story
from tests.stories.world import Flown, Shown
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
    *happened: tuple[str, float, str],
    truths: tuple[Truth, ...] = (),
    began: tuple[Happening, ...] = (),
    ended: tuple[str, ...] = tuple(PADS),
) -> Stormed:
    """Return the flight of two vehicles with nothing to inspect in which this happened, each over its pad.

    Args:
        happened: Who, when and what.
        truths: The same with more of it.
        began: What the story holds.
        ended: Who lands in the end.
    """
    told = [truth(name, 0.0, "at", place) for name, place in PADS.items()]
    told += [truth(name, t_s, what, place) for name, place in PADS.items() for t_s, what in BEGUN]
    told += [truth(name, t_s, what, PADS[name]) for name in ended for t_s, what in ENDED]
    told += [truth(name, t_s, what, PADS[name]) for name, t_s, what in happened]
    flown = Flown(
        Story("test", ()), "ardupilot", (*told, *truths), ((LAUNCH_S, LaunchOrdered()),), (), (), (), LAUNCH_S, END_S,
        END_S, {"uav1": 1, "uav2": 2}, PADS, {}, {}, frozenset(), 20.0, 0,
    )  # fmt: skip
    plot = Plot(1, "ardupilot", "line", dict.fromkeys(PADS, ()), began)
    shown = dict.fromkeys(PADS, "landed")
    return Stormed(plot, flown, tuple((one.at_s, one) for one in began), (), False, shown, SPACING_M)


def said(told: Stormed, at_s: float, text: str) -> Stormed:
    return replace(told, flown=replace(told.flown, said=(*told.flown.said, (at_s, Say(Level.INFO, text)))))


def rules(told: Stormed) -> set[str]:
    return {finding.rule for finding in findings(told)}


@pytest.mark.parametrize(("falls", "found"), [(None, {"apart"}), ("reboot", set()), ("crash", set())])
def test_a_fall_through_anothers_layer_is_no_flight_in_it(falls: str | None, found: set[str]) -> None:
    near = tuple(truth(name, 100.0, "at", PADS["uav1"], up_m) for name, up_m in (("uav1", 12.0), ("uav2", 14.0)))
    fault = (("uav2", 99.0, f"fault uav2:{falls}@0s"),) if falls else ()
    assert rules(stormed(*fault, truths=near)) == found


@pytest.mark.parametrize(("left_pct", "found"), [(1.0, {"apart"}), (0.0, set())])
def test_a_fall_with_an_empty_battery_is_no_flight_in_anothers_layer(left_pct: float, found: set[str]) -> None:
    at = {name: truth(name, 120.0, "at", PADS["uav1"], 30.0) for name in PADS}
    at["uav2"] = replace(at["uav2"], charge_pct=left_pct)
    assert {one.rule for one in findings(stormed(truths=tuple(at.values())))} == found


@pytest.mark.parametrize(("unseen", "ends", "found", "on_page"), [
    (True, "fell", set(), set()), (False, "fell", {"line"}, {"page"}), (True, "crash", {"line"}, set()),
])  # fmt: skip
def test_an_unobserved_soft_drop_onto_the_pad_counts_as_landed(
    unseen: bool, ends: str, found: set[str], on_page: set[str]
) -> None:
    silence = (("uav1", 100.0, "fault uav1:silent=60s@0s"),) if unseen else ()
    stopped = truth("uav1", 120.0, "kill", PADS["uav1"], up_m=2.6)
    falls = (("uav1", 120.0, "disarmed"), ("uav1", 120.7, ends))
    told = stormed(*silence, *falls, truths=(stopped,), ended=("uav2",))
    assert rules(said(told, 163.0, "uav1: landed with 90 %")) == found
    shown = replace(told.flown, shown=(Shown(170.0, "uav1", "landed"),))
    assert rules(replace(told, flown=shown)) == on_page


@pytest.mark.parametrize(("killed_s", "found"), [(320.0, set()), (310.0, {"line"}), (None, {"line"})])
def test_a_kill_at_touchdown_may_be_either(killed_s: float | None, found: set[str]) -> None:
    kill = () if killed_s is None else (("uav1", killed_s, "kill"),)
    line = "uav1: down at 49.60000, 15.60000, disarmed"
    assert rules(said(stormed(*kill), 324.0, line)) == found


@pytest.mark.parametrize(("kind", "found"), [("bursts", set()), ("wind", {"page"})])
def test_a_mode_of_pilot_and_failsafe_in_one_burst_has_an_unknown_source(kind: str, found: set[str]) -> None:
    began = (Happening(kind, "uav1", 95.0, 10.0),)
    told = stormed(("uav1", 100.0, "pilot LAND"), ("uav1", 100.0, "mode LAND"), began=began)
    shown = replace(told.flown, shown=(Shown(120.0, "uav1", "returning"),))
    assert rules(replace(told, flown=shown)) == found


@pytest.mark.parametrize(("kind", "found"), [("downlink lost", set()), ("wind", {"page"})])
def test_an_rtl_ordered_without_a_link_may_be_the_failsafes(kind: str, found: set[str]) -> None:
    began = (Happening(kind, "uav1", 80.0, 25.0),)
    chosen = (("uav1", 99.0, "pilot LAND"), ("uav1", 99.0, "mode LAND"), ("uav1", 100.0, "pilot RTL"))
    told = stormed(*chosen, ("uav1", 100.0, "mode RTL"), began=began)
    shown = replace(told.flown, shown=(Shown(130.0, "uav1", "returning"),))
    assert rules(replace(told, flown=shown)) == found


@pytest.mark.parametrize(("acts", "mode", "found"), [
    (True, "LAND", set()), (True, "LOITER", {"line"}), (False, "LAND", {"line"}),
])  # fmt: skip
def test_a_pilots_return_during_a_failsafe_return_is_not_distinguished(acts: bool, mode: str, found: set[str]) -> None:
    acted = (("uav1", 100.0, "failsafe fence"),) if acts else ()
    told = stormed(*acted, ("uav1", 100.7, f"pilot {mode}"), ("uav1", 100.7, f"mode {mode}"))
    told = said(told, 101.5, "uav1: fence, its fence is breached; returning or landing by itself, not commanded")
    assert rules(told) & {"line"} == found


def test_a_crash_during_boot_sends_nothing_more() -> None:
    began = (Happening("frozen", "uav1", 50.0, 48.0),)
    fell = tuple(truth("uav1", 99.0, what, (49.601, 15.6)) for what in ("crash", "disarmed"))
    told = stormed(("uav1", 55.0, "fault uav1:reboot@0s"), truths=fell, began=began, ended=("uav2",))
    assert "elsewhere" not in rules(told)


@pytest.mark.parametrize(("silent", "found"), [(("uav1", "uav2"), set()), (("uav1",), {"ends"})])
def test_a_resumed_flight_without_any_answer_does_not_end(silent: tuple[str, ...], found: set[str]) -> None:
    never = tuple((name, 200.0, f"fault {name}:silent@0s") for name in silent)
    told = stormed(*never, began=(Happening("ground killed", "ground", 190.0, 30.0),))
    assert rules(replace(told, flown=replace(told.flown, ended_s=None))) == found


@pytest.mark.parametrize(("again_s", "found"), [(323.5, set()), (None, {"page"})])
def test_a_disarmed_vehicle_sent_up_again_was_landed_in_between(again_s: float | None, found: set[str]) -> None:
    """Looked at just before and just after, its motors are on."""
    ends = ((300.0, "descends"), (320.0, "landed")) if again_s is None else ENDED
    again = ((again_s, "order command 400 1"), (again_s, "armed")) if again_s is not None else ()
    told = stormed(*(("uav1", at_s, what) for at_s, what in (*ends, *again)), ended=("uav2",))
    shown = replace(told.flown, shown=(Shown(325.0, "uav1", "landed"),))
    assert rules(replace(told, flown=shown)) & {"page"} == found


def test_a_crash_after_a_stop_reports_at_once() -> None:
    began = (Happening("frozen", "uav1", 50.0, 30.0),)
    fell = tuple(truth("uav1", 90.0, what, PADS["uav1"]) for what in ("crash", "disarmed"))
    told = stormed(truths=fell, began=began, ended=("uav2",))
    shown = replace(told.flown, shown=(Shown(96.0, "uav1", "returning"),))
    assert "page" not in rules(replace(told, flown=shown))


@pytest.mark.parametrize(("fell_s", "found"), [(120.4, set()), (123.0, {"line"})])
def test_a_vehicle_disarmed_a_hands_breadth_over_the_ground_has_landed(fell_s: float, found: set[str]) -> None:
    stopped = truth("uav1", 120.0, "kill", PADS["uav1"], up_m=0.3)
    told = stormed(("uav1", 120.0, "disarmed"), ("uav1", fell_s, "fell"), truths=(stopped,), ended=("uav2",))
    assert rules(said(told, 120.1, "uav1: landed by its pilot")) == found


@pytest.mark.parametrize(("kind", "found"), [("bad link", set()), ("wind", {"line"})])
def test_what_comes_late_over_a_bad_link_is_heard(kind: str, found: set[str]) -> None:
    began = (Happening(kind, "uav1", 90.0, 60.0),)
    told = stormed(("uav1", 100.0, "crash"), ("uav1", 100.0, "disarmed"), began=began, ended=("uav2",))
    assert rules(said(told, 104.7, "uav1: link regained")) & {"line"} == found


@pytest.mark.parametrize(("hovers_m", "found"), [(0.2, set()), (9.0, {"line"})])
def test_a_vehicle_hovering_low_over_its_pad_until_empty_has_landed(hovers_m: float, found: set[str]) -> None:
    hover = tuple(truth("uav1", at_s, "at", PADS["uav1"], hovers_m) for at_s in (118.0, 119.0))
    told = stormed(("uav1", 120.0, "fell"), ("uav1", 120.0, "disarmed"), truths=hover, ended=("uav2",))
    assert rules(said(told, 120.5, "uav1: landed by its pilot")) & {"line"} == found


@pytest.mark.parametrize(("wrecked", "found"), [(True, set()), (False, {"line"})])
def test_a_fall_out_of_the_fence_may_be_named_for_either(wrecked: bool, found: set[str]) -> None:
    wreck = (("uav1", 99.0, "fault uav1:wreck@0s"),) if wrecked else ()
    told = stormed(*wreck, ("uav1", 100.0, "failsafe fence"))
    line = "uav1: interruption, falls at 10.8 m/s; returning or landing by itself, not commanded"
    assert rules(said(told, 100.3, line)) & {"line"} == found


@pytest.mark.parametrize(("lied", "found"), [(True, set()), (False, {"line"})])
def test_a_radio_line_without_a_radio_needs_a_forged_sender(lied: bool, found: set[str]) -> None:
    began = (Happening("forged disarmed", "uav1", 98.0, word="1"),) if lied else ()
    told = said(stormed(began=began), 100.0, "uav1: radio signal 5 over noise 200 here")
    assert rules(told) & {"line"} == found


@pytest.mark.parametrize(("asleep_s", "found"), [(40.0, set()), (20.0, {"line"})])
def test_a_ground_station_that_slept_hears_what_came_in_that_time(asleep_s: float, found: set[str]) -> None:
    began = (Happening("ground sleeps", "ground", 100.0, asleep_s),)
    told = stormed(("uav1", 99.0, "crash"), ("uav1", 99.0, "disarmed"), began=began, ended=("uav2",))
    assert rules(said(told, 140.1, "uav1: link regained")) & {"line"} == found


@pytest.mark.parametrize(("acted_s", "late_s", "found"), [
    (100.2, 1.0, set()), (100.2, 5.0, {"page"}), (107.0, 1.0, set()), (None, 1.0, {"page"}),
])  # fmt: skip
def test_a_takeover_during_a_failsafe_is_shown_a_moment_later(
    acted_s: float | None, late_s: float, found: set[str]
) -> None:
    acted = () if acted_s is None else (("uav1", acted_s, "failsafe ekf"),)
    taken = (("uav1", 99.9, "pilot LOITER"), ("uav1", 99.9, "mode LOITER"), *acted)
    told = stormed(*taken, ("uav1", 110.0, "station BRAKE"), ("uav1", 110.0, "mode BRAKE"))
    shown = replace(told.flown, shown=(Shown(110.0 + late_s, "uav1", "returning"),))
    assert rules(replace(told, flown=shown)) & {"page"} == found


@pytest.mark.parametrize(("who", "found"), [("operator, excluded", set()), ("interruption, LAND", {"line"})])
def test_an_exclusion_during_a_fence_action_counts_as_the_crews(who: str, found: set[str]) -> None:
    told = stormed(("uav1", 100.0, "failsafe fence"))
    line = f"uav1: {who}; returning or landing by itself, not commanded"
    assert rules(said(told, 100.5, line)) & {"line"} == found


@pytest.mark.parametrize(("kind", "found"), [("no battery", set()), ("wind", {"line"})])
def test_what_its_battery_held_is_what_was_reported_last(kind: str, found: set[str]) -> None:
    told = stormed(began=(Happening(kind, "uav1", 315.0, 10.0),))
    assert rules(said(told, 323.0, "uav1: landed with 12 %")) & {"line"} == found


@pytest.mark.parametrize(("last", "found"), [("mode AUTO", set()), ("failsafe fence", {"emergency"})])
def test_a_failsafe_that_a_start_ended_in_the_same_moment_does_not_act(last: str, found: set[str]) -> None:
    same = ("failsafe fence", "mode RTL") if last == "mode AUTO" else ("mode AUTO",)
    happened = (*(("uav1", 11.5, what) for what in (*same, last)), ("uav1", 14.0, "order command 21"))
    assert rules(stormed(*happened)) == found

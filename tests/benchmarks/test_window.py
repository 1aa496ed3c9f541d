"""The window bench on a short line: what is claimed, what is drawn, what is flown, and how it is judged."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from benchmarks.branches import Branch, fly_branches
from benchmarks.commands import cli
from benchmarks.errors import FlightNotFlown
from benchmarks.virtual_flight import VirtualFlight
from benchmarks.virtual_site import dearest_route_pct, size_batteries
from benchmarks.window import (
    Claim,
    LossOutcome,
    RandomLoss,
    Trial,
    WindowSettings,
    fly_losses,
    judge_loss,
    losses,
    plan_claim,
    results,
)
from benchmarks.windowpage import report_window, window_document
from tests.benchmarks.virtual.short_line import shared, short_ground, write_line

CRASH = RandomLoss(0, "uav2", "crash", 40.0)


def fly_loss(claim: Claim, loss: RandomLoss) -> LossOutcome:
    (outcome,) = fly_losses(claim, [loss])
    return outcome


@pytest.fixture(scope="module")
def claim(tmp_path_factory: pytest.TempPathFactory) -> Claim:
    """Return two vehicles with a run of two segments each, and a claim that nobody has computed."""
    ground = short_ground(tmp_path_factory.mktemp("line"), 2, "ardupilot")
    plan = shared(ground)
    return Claim(ground, plan, 30.0, max(plan.durations_s))


def test_a_claim_can_be_flown_in_other_processes(claim: Claim) -> None:
    assert pickle.dumps(claim)


def test_losses_are_drawn_in_their_time_and_among_flying_vehicles(claim: Claim) -> None:
    ends_s = {vehicle.name: end for vehicle, end in zip(claim.plan.vehicles, claim.plan.durations_s, strict=True)}
    after = losses(claim, 60, seed=1)
    assert {(loss.vehicle, loss.kind) for loss in after} == {
        (name, kind) for name in ("uav1", "uav2") for kind in ("crash", "silent")
    }
    assert all(30.0 <= loss.at_s <= ends_s[loss.vehicle] for loss in after)
    before = losses(claim, 20, seed=1, before=True)
    assert all(10.0 <= loss.at_s <= 30.0 for loss in before)
    assert losses(claim, 60, seed=1) == after != losses(claim, 60, seed=2)
    assert losses(replace(claim, earliest_s=0.0), 5, seed=1, before=True) == []


def test_a_loss_that_the_other_can_bear_is_finished(claim: Claim) -> None:
    outcome = fly_loss(claim, CRASH)
    assert (outcome.finished, outcome.wrong, outcome.uncovered) == (True, (), ())
    assert 15.0 < outcome.least_pct < 100.0


def test_a_loss_that_it_cannot_bear_names_what_is_left(claim: Claim) -> None:
    small = size_batteries(claim.ground, claim.plan, 75.0)
    outcome = fly_loss(Claim(small, shared(small), 30.0, claim.longest_s), CRASH)
    assert not outcome.finished
    assert outcome.named
    assert 0 < len(outcome.uncovered) <= 2
    assert outcome.wrong == (f"{len(outcome.uncovered)} segments not inspected",)
    assert outcome.least_pct >= 15.0


def test_a_survivor_must_be_at_home_above_its_reserve(claim: Claim) -> None:
    from benchmarks.virtual_flight import fly_virtual

    flight: VirtualFlight = fly_virtual(claim.ground, claim.plan, faults=[CRASH.spec])
    assert judge_loss(flight, CRASH).finished
    assert judge_loss(flight, RandomLoss(0, "uav1", "crash", 40.0)).wrong == ("uav2 not at home",)
    one = flight.crafts["uav1"]
    for changed, wrong in (
        (replace(one, charge_pct=14.9), "uav1 landed with 14.9 %, reserve 15 %"),
        (replace(one, armed=True), "uav1 not at home"),
        (replace(one, from_pad_m=9.0), "uav1 not at home"),
    ):
        outcome = judge_loss(replace(flight, crafts={**flight.crafts, "uav1": changed}), CRASH)
        assert (outcome.finished, outcome.wrong) == (False, (wrong,))
    left = flight.report.model_copy(update={"segments_uncovered": (3,)})
    assert not judge_loss(replace(flight, report=left), CRASH).named
    assert judge_loss(replace(flight, ended=False), CRASH).wrong == ("the supervision did not end",)


def test_the_batteries_are_as_tight_as_asked(tmp_path: Path) -> None:
    settings = WindowSettings(write_line(tmp_path / "line.geojson"), None, "px4", vehicles=2, seconds=0.4, starts=1)
    half, most = (plan_claim(replace(settings, tightness=tightness)) for tightness in (0.5, 0.8))
    assert half.ground.drone.capacity_ah > 1.3 * most.ground.drone.capacity_ah
    assert half.earliest_s <= most.earliest_s < most.longest_s
    # A plan that is chosen for its window may have a dearer route.
    assert dearest_route_pct(most.ground, most.plan) > 0.8 * 28.0 - 0.1
    assert {vehicle.budget_pct for vehicle in most.plan.vehicles} == {28.0}


def test_losses_that_share_a_beginning_end_as_they_would_alone(claim: Claim) -> None:
    drawn = [
        CRASH, RandomLoss(1, "uav1", "silent", 45.0), RandomLoss(2, "uav1", "crash", 25.0),
        RandomLoss(3, "uav2", "silent", 9000.0),
    ]  # fmt: skip
    together = fly_losses(claim, drawn, jobs=2)
    assert together == [fly_loss(claim, loss) for loss in drawn]
    # Whose time never came changes nothing.
    assert together[3].finished
    assert len({outcome.flown_s for outcome in together}) == 4


def test_a_flight_that_fails_says_so(claim: Claim) -> None:
    def judged(_: VirtualFlight, number: int) -> int:
        if number == 0:
            raise ValueError
        return number

    branches = [Branch("uav2", at_s, f"uav2:crash@{at_s}s") for at_s in (30.0, 40.0)]
    with pytest.raises(FlightNotFlown, match=r"uav2:crash@30\.0s: its process ended"):
        fly_branches(claim.ground, claim.plan, branches, judged)


def test_the_command_and_its_page(tmp_path: Path) -> None:
    line = write_line(tmp_path / "line.geojson")
    asked = ["--network", str(line), "--radius", "1000", "--vehicles", "2", "--tightness", "0.5", "--losses", "2"]
    done = CliRunner().invoke(
        cli, ["window", *asked, "--seed", "1", "--seconds", "0.4", "--jobs", "1", "-o", str(tmp_path), "--json"]
    )
    content = json.loads(done.stdout)
    assert (content["losses_after"], content["losses_before"]) == (2, 0)
    assert done.exit_code == int(content["finished_after"] != 2)
    (plan,) = content["plans"]
    assert 0.0 <= plan["claimed_earliest_s"] < plan["longest_route_s"]
    assert len(plan["losses"]) == 2
    assert json.loads((tmp_path / "window.json").read_text()) == content
    assert "| after the claimed time | 2 |" in (tmp_path / "window.md").read_text()


def test_what_is_not_finished_is_shown(claim: Claim, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = fly_loss(claim, CRASH)
    bad = replace(good, finished=False, wrong=("2 segments not inspected",), uncovered=(3, 4), named=False)
    settings = WindowSettings(None, 700.0, "px4")
    content = window_document(settings, "faultline bench window", results([Trial(settings, claim, (good,), (bad,))]))
    assert (content["finished_after"], content["finished_before"], content["unnamed_before"]) == (1, 0, 1)
    report_window(content).keep(tmp_path)
    page = (tmp_path / "window.md").read_text()
    assert "| before it | 1 | 0 | in 0 of 1 |" in page
    assert "| uav2:crash@40s | before | 2 segments not inspected | 3, 4 |" in page
    report_window(content).show()
    assert "uav2:crash@40s" in capsys.readouterr().out

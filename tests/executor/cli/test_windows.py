"""The command line's plans for losses: the window, plans chosen for it, trade-offs, and the other solvers."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from executor.cli import plans
from missions import read_plan
from planner import replan_window
from tests.executor.cli.test_main import Place


@pytest.fixture
def place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Place:
    return Place(tmp_path, capsys)


def tight(place: Place) -> None:
    """Give both vehicles little more than half of the work takes: what one cannot do for both from the start."""
    needed = max(read_plan(Path(place.planned())).energies_pct)
    place.site(budget_pct=round(1.3 * needed, 2))


def test_a_loose_plan_has_a_full_window(place: Place) -> None:
    plan = place.planned()
    code, out, _ = place.run("window", plan, "--json")
    answer = json.loads(out)
    assert code == 0
    assert (answer["window_pct"], answer["earliest_s"], answer["certified_earliest_s"]) == (100.0, 0.0, 0.0)
    assert answer["breaking"] is None
    assert answer["longest_route_s"] == pytest.approx(max(read_plan(Path(plan)).durations_s))
    assert "from 0 s the fleet can absorb the loss of any one vehicle" in place.run("window", plan)[1]


def test_what_breaks_a_tight_plan_is_named(place: Place) -> None:
    tight(place)
    plan = place.path("tight.json")
    place.run("plan", place.path("site.toml"), "--cost", "minmax", "--all-vehicles", "--seconds", "0.2", "-o", plan)
    code, out, _ = place.run("window", plan, "--json", "--picture", place.path("window.png"))
    answer = json.loads(out)
    assert code == 0
    assert 0 < answer["earliest_s"] < answer["longest_route_s"]
    assert answer["breaking"]["vehicle"] in {"uav1", "uav2"}
    assert answer["breaking"]["to_s"] == answer["earliest_s"]
    assert answer["breaking"]["from_s"] < answer["breaking"]["to_s"]
    assert answer["certified_earliest_s"] <= answer["earliest_s"]
    assert Path(place.path("window.png")).read_bytes().startswith(b"\x89PNG")
    lost, at_s = answer["breaking"]["vehicle"], str(answer["breaking"]["from_s"])
    assert place.run("replan", plan, "--lost", lost, "--at", at_s, "--seconds", "0.2")[0] == 1


def test_a_proof_bounds_the_window_of_this_plan_and_of_any(place: Place) -> None:
    pytest.importorskip("highspy")
    tight(place)
    plan = place.path("tight.json")
    place.run("plan", place.path("site.toml"), "--cost", "minmax", "--all-vehicles", "--seconds", "0.2", "-o", plan)
    code, out, _ = place.run("window", plan, "--prove", "--json")
    answer = json.loads(out)
    assert code == 0
    assert 0 <= answer["any_plan_earliest_s"] <= answer["earliest_s"]
    assert answer["certified_earliest_s"] <= answer["earliest_s"]
    assert "no window of any plan begins before" in place.run("window", plan, "--prove")[1]


def test_a_plan_chosen_by_its_window_is_no_worse_and_checks(place: Place) -> None:
    tight(place)
    site, plan, chosen = place.path("site.toml"), place.path("plan.json"), place.path("chosen.json")
    place.run("plan", site, "--cost", "minmax", "--all-vehicles", "--seconds", "0.2", "-o", plan)
    code, out, _ = place.run(
        "plan", site, "--cost", "window", "--stretch", "20", "--all-vehicles", "--seconds", "1", "--json", "-o", chosen
    )
    answer = json.loads(out)
    assert code == 0
    assert answer["cost"] == {"name": "window", "value": answer["window"]["earliest_s"]}
    assert answer["window"]["earliest_s"] <= json.loads(place.run("window", plan, "--json")[1])["earliest_s"]
    assert answer["window"]["longest_route_s"] <= 1.2 * max(read_plan(Path(plan)).durations_s) + 1e-6
    assert place.run("check", chosen)[:2] == (0, "every figure is right\n")


def test_a_plan_against_two_losses_names_them_and_checks(place: Place) -> None:
    place.site(vehicles=3)
    site, chosen = place.path("site.toml"), place.path("two.json")
    code, out, _ = place.run("plan", site, "--losses", "2", "--iterations", "2000", "-o", chosen)
    assert code == 0
    assert "the loss of any two vehicles, one after the other or at once" in out
    assert read_plan(Path(chosen)).window is not None
    answer = json.loads(place.run("window", chosen, "--losses", "2", "--json")[1])
    assert answer["losses"] == 2
    assert answer["earliest_s"] == json.loads(Path(chosen).read_text(encoding="utf-8"))["window"]["earliest_s"]
    assert place.run("check", chosen)[:2] == (0, "every figure is right\n")


def test_two_losses_are_refused_where_nobody_looks_at_them(place: Place) -> None:
    plan, site = place.planned(), place.path("site.toml")
    for words, why in (
        (("window", plan, "--losses", "2"), "2 vehicles, expected 3 or more"),
        (
            ("window", plan, "--losses", "2", "--picture", place.path("window.png")),
            "--losses: expected 1 with --picture",
        ),
        (("plan", site, "--losses", "2"), "2 vehicles, expected 3 or more"),
        (("plan", site, "--losses", "2", "--cost", "minmax"), "--losses: expected 1 with --cost minmax, got 2"),
        (("plan", site, "--losses", "2", "--day"), "--losses: expected none with --day"),
        (("plan", site, "--losses", "2", "--solver", "grasp"), "--solver: expected search for --cost window"),
    ):
        code, _, err = place.run(*words)
        (line,) = (one for one in err.splitlines() if one.startswith("faultline: "))
        assert code == 2
        assert why in line


def test_the_trade_offs_are_plans_that_check(place: Place) -> None:
    tight(place)
    folder, picture = Path(place.path("front")), Path(place.path("front.png"))
    code, out, _ = place.run(
        "plan", place.path("site.toml"), "--front", "--seconds", "1", "-o", str(folder), "--picture", str(picture)
    )
    files = sorted(folder.glob("plan-*.json"))
    assert code == 0
    assert len(files) >= 1
    assert len(out.splitlines()) == 1 + len(files) + 3  # a heading, the plans, one for each of the paper's costs
    assert picture.read_bytes().startswith(b"\x89PNG")
    for file in files:
        assert place.run("check", str(file))[0] == 0


@pytest.mark.parametrize("solver", ["grasp", "exact"])
def test_the_other_solvers_plan_too(place: Place, solver: str) -> None:
    code, out, _ = place.run(
        "plan", place.path("site.toml"), "--solver", solver, "--cost", "minsum", "--seconds", "1", "--json"
    )
    answer = json.loads(out)
    assert (code, answer["solver"], answer["uncovered"]) == (0, solver, [])


def test_a_window_is_for_the_search_alone(place: Place) -> None:
    said = place.refused("plan", place.path("site.toml"), "--cost", "window", "--solver", "grasp")
    assert said == "--solver: expected search for --cost window, got grasp"


def test_a_plan_chosen_by_its_coverage_checks_and_is_what_risk_says(place: Place) -> None:
    tight(place)
    site, plan = place.path("site.toml"), place.path("plan.json")
    code, out, _ = place.run(
        "plan", site, "--cost", "coverage", "--mtbf", "0.5", "--iterations", "20000", "--seconds", "600",
        "--seed", "3", "-o", plan,
    )  # fmt: skip
    assert code == 0
    assert "everything inspected: " in out
    content = read_plan(Path(plan))
    assert content.coverage is not None
    assert (content.cost.name, content.cost.value) == ("coverage", content.coverage.probability)
    assert place.run("check", plan)[:2] == (0, "every figure is right\n")
    flown = ("--samples", str(content.coverage.flights), "--seed", "3", "--jobs", "1", "--json")
    last = json.loads(place.run("risk", plan, "--mtbf", "0.5", *flown)[1])["finishing"][-1]
    assert [last[key] for key in ("probability", "low_95", "high_95", "expected_uninspected_m")] == [
        content.coverage.probability, content.coverage.low_95, content.coverage.high_95,
        content.coverage.uninspected_m,
    ]  # fmt: skip


def test_a_changed_probability_is_found(place: Place) -> None:
    plan = Path(place.path("plan.json"))
    place.run(
        "plan", place.path("site.toml"), "--cost", "coverage", "--mtbf", "0.5", "--iterations", "20000",
        "--seconds", "600", "-o", str(plan),
    )  # fmt: skip
    document = json.loads(plan.read_text(encoding="utf-8"))
    document["coverage"]["probability"] = document["cost"]["value"] = 0.125
    plan.write_text(json.dumps(document), encoding="utf-8")
    code, out, _ = place.run("check", str(plan))
    assert code == 1
    assert "coverage.probability is 0.125, its content gives " in out


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--cost", "coverage"), "--mtbf: expected flight hours between failures with --cost coverage, got none"),
        (("--cost", "window", "--mtbf", "5"), "--mtbf: expected none without --cost coverage"),
        (("--front", "--cost", "coverage", "--mtbf", "5"), "--mtbf: expected none without --cost coverage"),
        (("--cost", "coverage", "--mtbf", "5", "--solver", "grasp"),
         "--solver: expected search for --cost coverage, got grasp"),
        (("--day", "--mtbf", "5"), "--mtbf: expected none with --day"),
    ],
)  # fmt: skip
def test_coverage_is_refused_where_it_makes_no_sense(place: Place, options: tuple[str, ...], reason: str) -> None:
    assert place.refused("plan", place.path("site.toml"), *options) == reason


def test_a_certificate_that_certifies_nothing_is_not_shown(place: Place) -> None:
    tight(place)
    plan = place.path("tight.json")
    place.run("plan", place.path("site.toml"), "--cost", "minmax", "--all-vehicles", "--iterations", "500", "-o", plan)
    content = read_plan(Path(plan))
    found = replan_window(content.build_instance(), content.plan)
    assert found.breaking is not None
    for certified_s, lines in ((found.earliest_s, 3), (0.0, 2)):
        said = list(plans._describe_found_window(content, replace(found, certified_earliest_s=certified_s), None))
        assert len(said) == lines

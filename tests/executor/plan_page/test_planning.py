from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

import missions
from executor.cli.main import main
from executor.plan_page.plan_work import PlanSettings, answer_loss, make_plans
from executor.plan_page.site_view import read_site_model
from tests.executor.plan_page.opened import DEMO_RADIUS, Opened, make_demo_site, opened
from tests.patience import PATIENCE_S

MOST_S = PATIENCE_S
"""Of searches that end once they are settled."""


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    """A page whose site is planned for."""
    root = tmp_path_factory.mktemp("planned")
    with opened(root, make_demo_site(root)) as one:
        one.checked()
        plan(one)
        yield one


def plan(one: Opened, **wish: Any) -> Any:
    """Plan, and return the workspace with the plans."""
    revision = one.get("/api/workspace")["revision"]
    body: dict[str, Any] = {"seconds": MOST_S, **wish}
    job = one.post("/api/plan", revision=revision, **body)["job"]
    assert (job["state"], job["error"]) == ("running", None)
    workspace = one.follow_job(job["id"])
    assert (workspace["job"]["state"], workspace["job"]["error"]) == ("done", None)
    return workspace


def figures(path: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(path.read_text())
    return {key: one for key, one in document.items() if key != "solver"}


def test_what_the_page_saves_is_planned_alike_by_the_command_line(planned: Opened, tmp_path: Path) -> None:
    root = planned.root
    made = missions.read_plan(root / "plan.json")
    with pytest.raises(SystemExit) as ended:
        main(["plan", str(root / "site.toml"), "--seconds", str(MOST_S), "-o", str(tmp_path / "cli.json")])
    assert ended.value.code == 0
    again = missions.read_plan(tmp_path / "cli.json")
    assert (made.network_routes, made.window, made.cost) == (again.network_routes, again.window, again.cost)
    [summary] = [one for one in planned.get("/api/workspace")["plans"] if one["file"]]
    assert (summary["file"], summary["stale"], summary["uncovered"]) == ("plan.json", False, 0)
    assert summary["longest_s"] == max(made.durations_s)


def test_so_many_iterations_give_the_same_plan_however_long_they_take(planned: Opened, tmp_path: Path) -> None:
    chosen = plan(planned, cost="minsum", iterations=3000, seed=7)["chosen"]
    made = missions.read_plan(planned.root / "plan.json")
    words = ["--cost", "minsum", "--iterations", "3000", "--seed", "7", "--seconds", str(MOST_S)]
    with pytest.raises(SystemExit):
        main(["plan", str(planned.root / "site.toml"), *words, "-o", str(tmp_path / "cli.json")])
    again = missions.read_plan(tmp_path / "cli.json")
    assert (made.network_routes, made.cost) == (again.network_routes, again.cost)
    assert chosen
    plan(planned)


def test_a_plan_of_the_command_line_is_loaded(planned: Opened) -> None:
    before = planned.get("/api/workspace")["chosen"]
    with pytest.raises(SystemExit):
        main(
            [
                "plan",
                str(planned.root / "site.toml"),
                "--cost",
                "minsum",
                "--seconds",
                "1",
                "-o",
                str(planned.root / "plan.json"),
            ]
        )
    workspace = planned.follow_until(lambda news: news["chosen"] != before)
    [chosen] = [one for one in workspace["plans"] if one["id"] == workspace["chosen"]]
    assert chosen["cost"] == "minsum"
    planned.post(f"/api/plans/{before}/choose")
    assert planned.get("/api/workspace")["chosen"] == before


def test_positions_and_batteries_over_time(planned: Opened) -> None:
    workspace = planned.get("/api/workspace")
    shown = planned.get(f"/api/plans/{workspace['chosen']}")
    longest_s = shown["summary"]["longest_s"]
    network = planned.get("/api/network")
    assert [one["name"] for one in shown["vehicles"]] == ["uav1", "uav2", "uav3"]
    seen = []
    for vehicle in shown["vehicles"]:
        [route] = vehicle["routes"]
        times = [row[0] for row in route["track"]]
        assert times == sorted(times)
        assert times[-1] == pytest.approx(longest_s, rel=0.2)
        assert route["track"][0][4] == 100.0
        assert route["track"][-1][4] == pytest.approx(100.0 - route["energy_pct"], abs=0.01)
        assert vehicle["profile"][0][1:] == [route["track"][0][3], None]
        seen += [visit["segment"] for visit in route["visits"]]
        for visit in route["visits"]:
            segment = network["segments"][visit["segment"]]
            ends = [segment["b"], segment["a"]] if visit["reversed"] else [segment["a"], segment["b"]]
            at = next(row for row in route["track"] if row[0] >= visit["to_s"])
            assert at[1:3] == [pytest.approx(one, abs=2e-4) for one in ends[1]]
    assert sorted(seen) == [one["id"] for one in network["segments"]]
    assert any(line.startswith("heights: ") for line in shown["lines"])


def test_a_loss_is_answered_while_the_slider_is_dragged(planned: Opened) -> None:
    chosen = planned.get("/api/workspace")["chosen"]
    shown = planned.get(f"/api/plans/{chosen}")
    [lost] = [one for one in shown["vehicles"] if one["name"] == "uav2"]
    [route] = lost["routes"]
    at_s = route["visits"][4]["to_s"] + 1.0
    answer = planned.post(f"/api/plans/{chosen}/loss", vehicle="uav2", at_s=at_s)
    assert (answer["complete"], answer["uncovered"]) == (True, [])
    assert answer["recovered"] == len(route["visits"]) - 5
    flown = {visit["segment"] for one in answer["routes"] for way in one["routes"] for visit in way["visits"]}
    assert flown | {visit["segment"] for visit in route["visits"][:5]} == set(
        range(len(planned.get("/api/network")["segments"]))
    )
    assert not next(one for one in answer["routes"] if one["name"] == "uav2")["routes"]
    assert planned.post(f"/api/plans/{chosen}/loss", 422, vehicle="uav9", at_s=0)["error"].endswith("got uav9")


def test_a_loss_of_eighty_segments_takes_less_than_half_a_second(tmp_path: Path) -> None:
    fourth = '[[vehicle]]\nname = "uav4"\nconnection = "udpin://0.0.0.0:14554"\nsysid = 4\nautopilot = "px4"'
    text = make_demo_site(tmp_path, fourth).read_text().replace(DEMO_RADIUS, "radius_m = 2200")
    settings = PlanSettings(seconds=MOST_S, iterations=2000, cost="minmax")
    [made] = make_plans(text, tmp_path, settings, tmp_path, 1)
    path = tmp_path / f"{made.id}.json"
    answer_loss(text, tmp_path, path, "uav2", 0.0)
    for at_s in (0.0, 400.0, 900.0):
        began_s = time.process_time()  # a busy computer takes longer, and that is not meant
        answer = answer_loss(text, tmp_path, path, "uav2", at_s)
        assert time.process_time() - began_s < 0.5
    assert len(missions.read_plan(path).segments) >= 80
    assert answer["recovered"] > 0


def test_a_network_that_is_another_one_is_planned_for_as_it_is(tmp_path: Path) -> None:
    site = make_demo_site(tmp_path)
    network = tmp_path / "line.geojson"
    shutil.copy(missions.default_network_path(), network)
    text = site.read_text().replace('file = "default"', 'file = "line.geojson"')
    before = read_site_model(text, tmp_path)
    assert read_site_model(text, tmp_path) is before
    document = json.loads(network.read_text())
    document["features"] = [one for one in document["features"] if "V102" not in json.dumps(one)]
    network.write_text(json.dumps(document))
    assert len(read_site_model(text, tmp_path).network.segments) < len(before.network.segments)


def test_changes_by_hand_are_checked_and_priced(planned: Opened) -> None:
    chosen = planned.get("/api/workspace")["chosen"]
    before = planned.get(f"/api/plans/{chosen}")
    mine = before["vehicles"][0]["routes"][0]["visits"]
    given, turned, dropped = mine[0], mine[1], mine[2]
    changes = [
        {"segment": given["segment"], "vehicle": "uav3", "position": 0},
        {"segment": turned["segment"], "reversed": not turned["reversed"]},
        {"segment": dropped["segment"], "vehicle": ""},
    ]
    answer = planned.post(f"/api/plans/{chosen}/change", changes=changes)
    assert answer["violations"] == []
    assert answer["window_was"] == before["summary"]["window_pct"]
    routes = {one["name"]: one["routes"][0]["visits"] for one in answer["plan"]["vehicles"]}
    assert routes["uav3"][0]["segment"] == given["segment"]
    assert (routes["uav1"][0]["segment"], routes["uav1"][0]["reversed"]) == (turned["segment"], not turned["reversed"])
    assert dropped["segment"] not in [visit["segment"] for visits in routes.values() for visit in visits]
    assert planned.get("/api/workspace")["chosen"] == chosen
    kept = planned.post(f"/api/plans/{chosen}/change", changes=changes[:1], keep=True)
    assert planned.get("/api/workspace")["chosen"] == kept["plan"]["summary"]["id"]
    by_hand = missions.read_plan(planned.root / "plan.json")
    assert missions.check_plan(by_hand) == []
    planned.post(f"/api/plans/{chosen}/choose")


def test_a_change_beyond_a_budget_is_named(planned: Opened) -> None:
    chosen = planned.get("/api/workspace")["chosen"]
    count = len(planned.get("/api/network")["segments"])
    lower = planned.set("vehicle", 0, "budget_pct", value=5)
    changes = [{"segment": one, "vehicle": "uav1"} for one in range(count)]
    answer = planned.post(f"/api/plans/{chosen}/change", changes=changes)
    [violation] = answer["violations"]
    assert violation.startswith("uav1 spends ")
    assert answer["window_is"] == 0.0
    planned.post("/api/undo", revision=lower["revision"])


def test_a_lock_that_a_change_breaks_is_named_and_the_plan_priced_all_the_same(planned: Opened) -> None:
    segment, pylon = planned.get("/api/network")["segments"][2], planned.get("/api/network")["pylons"][2]
    assert pylon["place"] == segment["a"]
    lock = {"segments": [segment["name"]], "vehicle": "uav1", "from": pylon["name"]}
    locked = planned.edit({"op": "add", "path": ["lock"], "value": lock})
    assert planned.checked()["problems"] == []
    chosen = plan(planned)["chosen"]
    shown = planned.get(f"/api/plans/{chosen}")
    [visit] = [
        visit for one in shown["vehicles"] for route in one["routes"] for visit in route["visits"]
        if one["name"] == "uav1" and visit["segment"] == 2
    ]  # fmt: skip
    assert visit["reversed"] is False
    changes = [{"segment": 2, "vehicle": "uav2", "reversed": True}]
    answer = planned.post(f"/api/plans/{chosen}/change", changes=changes)
    name = segment["name"]
    assert answer["violations"] == [f"{name} is locked to uav1, got uav2", f"{name} is locked in the other direction"]
    assert all(pct < 100 for pct in answer["plan"]["summary"]["energy_pct"].values())
    planned.post("/api/undo", revision=locked["revision"])
    plan(planned)


def test_a_plan_of_another_site_is_stale_and_one_of_other_connections_is_not(planned: Opened) -> None:
    def stale() -> bool:
        workspace = planned.get("/api/workspace")
        [found] = [one["stale"] for one in workspace["plans"] if one["id"] == workspace["chosen"]]
        return bool(found)

    planned.set("vehicle", 0, "connection", value="udpin://0.0.0.0:15551")
    planned.checked()
    assert not stale()
    changed = planned.set("inspection", "height_m", value=21)
    assert stale()
    planned.post("/api/undo", revision=changed["revision"])
    assert not stale()


def test_a_front_is_several_plans_and_chooses_none(planned: Opened) -> None:
    chosen = planned.get("/api/workspace")["chosen"]
    workspace = plan(planned, front=True, iterations=200_000)
    assert workspace["chosen"] == chosen
    assert 2 <= len(workspace["job"]["plans"]) <= 12
    assert set(workspace["job"]["plans"]) <= {one["id"] for one in workspace["plans"]}


def test_days_are_planned(planned: Opened) -> None:
    chosen = planned.get("/api/workspace")["chosen"]
    workspace = plan(planned, day=True, iterations=300)
    [summary] = [one for one in workspace["plans"] if one["id"] == workspace["chosen"]]
    assert (summary["kind"], summary["window_pct"]) == ("day", None)
    shown = planned.get(f"/api/plans/{workspace['chosen']}")
    assert all(route["start_s"] >= 8 * 3600 for one in shown["vehicles"] for route in one["routes"])
    [lost] = [one for one in shown["vehicles"] if one["name"] == "uav1"]
    way = lost["routes"][0]
    at_s = way["start_s"] + way["duration_s"] / 2
    answer = planned.post(f"/api/plans/{workspace['chosen']}/loss", vehicle="uav1", at_s=at_s)
    assert (answer["complete"], answer["recovered"]) == (True, sum(len(one["visits"]) for one in lost["routes"]))
    assert [one["name"] for one in answer["routes"] if not one["routes"]] == ["uav1"]
    planned.post(f"/api/plans/{chosen}/choose")


def test_a_job_is_cancelled_and_nothing_of_it_stays(planned: Opened) -> None:
    before = planned.get("/api/workspace")
    body: dict[str, Any] = {"revision": before["revision"], "seconds": 600, "iterations": 10**9, "cost": "minsum"}
    job = planned.post("/api/plan", **body)["job"]
    assert planned.post("/api/plan", 422, **body)["error"].startswith("expected nothing to be planned already")
    running = planned.follow_until(lambda news: news["job"]["value"] is not None)["job"]
    assert (running["state"], running["limit_s"]) == ("running", 600)
    assert running["better_pct"] >= 0
    ended = planned.post("/api/cancel", job=job["id"])
    assert ended["job"]["state"] == "cancelled"
    assert ended["plans"] == before["plans"]


def test_a_site_that_cannot_be_planned_for_fails_with_its_problem(planned: Opened) -> None:
    wrong = planned.set("vehicle", 0, "budget_pct", value=400)
    job = planned.post("/api/plan", revision=wrong["revision"])["job"]
    failed = planned.follow_job(job["id"])["job"]
    assert failed["state"] == "failed"
    assert failed["error"] == "vehicle[0].budget_pct: expected less than or equal to 100, got 400"
    planned.post("/api/undo", revision=wrong["revision"])


@pytest.mark.parametrize("name", ["..", "%2e%2e", "0" * 12, "plan", "a" * 4000])
def test_no_other_file_is_shown_as_a_plan(planned: Opened, name: str) -> None:
    assert planned.client.get(f"/api/plans/{name}").status_code in {404, 422}


def test_a_server_that_is_killed_loses_nothing(tmp_path: Path) -> None:
    make_demo_site(tmp_path)
    command = [sys.executable, "-m", "executor", "open", "--no-browser"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        address = server.stdout.readline().split()[1]
        with httpx.Client(base_url=address, timeout=PATIENCE_S) as client:
            workspace = client.get("/api/workspace").json()
            body = {
                "revision": workspace["revision"],
                "label": "higher",
                "edits": [{"op": "set", "path": ["inspection", "height_m"], "value": 31}],
            }
            assert client.post("/api/edits", json=body).status_code == 200
            server.kill()
    with opened(tmp_path, tmp_path / "site.toml") as one:
        again = one.get("/api/workspace")
        assert (again["values"]["inspection"]["height_m"], again["undo"]) == (31, "higher")
        assert again["revision"] > workspace["revision"]

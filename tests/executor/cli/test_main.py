"""The command line: exit 0 for done, 1 for 'the answer is no', 2 for bad input with one line that says why."""

from __future__ import annotations

import json
import shutil
import socket
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executor.adapters.run_directory import RunDirectory, lock_run_directory
from executor.cli import commandline
from executor.cli.main import main
from executor.core.battery.kalman import Prior
from executor.core.preflight.parameter_changes import ChangeStage, KeptParameter
from executor.core.vehicle_learning import KnownVehicle, PaceEstimate
from executor.flight.restore_vehicles import PARAMETERS
from executor.site.learned_files import build_learned_document
from missions import Pace, read_plan
from planner import PRESETS
from tests.executor.flights import short_report
from tests.missions.qgc_files import read_qgc_plan
from tests.ports import free_ports

DEPOT = (49.6, 15.6)
STEP_LON_DEG = 0.00083
"""60 m eastward at the depot's latitude."""
LINE = [(DEPOT[1] + STEP_LON_DEG * number, DEPOT[0]) for number in range(1, 6)]


def feature(geometry: dict[str, object] | None, **properties: object) -> dict[str, object]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def point(name: str, lon: float, lat: float) -> dict[str, object]:
    return feature({"type": "Point", "coordinates": [lon, lat]}, id=name)


def line(*places: tuple[float, float]) -> list[dict[str, object]]:
    """Return pylons and the line over them; places are longitude and latitude."""
    pylons = [point(f"P{number}", *place) for number, place in enumerate(places, start=1)]
    return [*pylons, feature({"type": "LineString", "coordinates": [list(place) for place in places]})]


class Place:
    """A folder with a site and its network, and the command line in it."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder = folder
        self._capsys = capsys
        self.network(*line(*LINE))
        self.site()

    def network(self, *features: dict[str, object], text: str | None = None) -> None:
        content = json.dumps({"type": "FeatureCollection", "features": list(features)})
        (self.folder / "line.geojson").write_text(content if text is None else text, encoding="utf-8")

    def site(
        self, *, file: str = "line.geojson", budget_pct: float = 75.0, extra: str = "", heights: str = "flat",
        vehicles: int = 2,
    ) -> None:  # fmt: skip
        fleet = "".join(
            f'[[vehicle]]\nname = "uav{number}"\nconnection = "udpin://127.0.0.1:{port}"\nsysid = {number}\n'
            f'autopilot = "ardupilot"\nbudget_pct = {budget_pct}\n'
            for number, port in enumerate(free_ports(vehicles), start=1)
        )
        depot = f"[depot]\nlat_deg = {DEPOT[0]}\nlon_deg = {DEPOT[1]}\n"
        network = f'[network]\nfile = "{file}"\n{extra}\n[inspection]\nheights = "{heights}"\n'
        text = depot + network + fleet
        (self.folder / "site.toml").write_text(text, encoding="utf-8")

    def path(self, name: str) -> str:
        return str(self.folder / name)

    def run(self, *arguments: str) -> tuple[int, str, str]:
        """Run the command line; returns its exit code, standard output and standard error."""
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        said = self._capsys.readouterr()
        code = ended.value.code
        assert isinstance(code, int)
        return code, said.out, said.err

    def refused(self, *arguments: str) -> str:
        """Run what must be refused; returns the one line that says why."""
        code, out, err = self.run(*arguments)
        assert (code, out) == (2, "")
        [reason] = err.splitlines()
        assert reason.startswith("faultline: ")
        return reason.removeprefix("faultline: ")

    def planned(self, **site: Any) -> str:
        """Make a plan file, and return its path."""
        if site:
            self.site(**site)
        plan = self.path("plan.json")
        code, _, _ = self.run(
            "plan", self.path("site.toml"), "--seconds", "0.2", "--all-vehicles", "--json", "-o", plan
        )
        assert code == 0
        return plan


@pytest.fixture
def place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Place:
    return Place(tmp_path, capsys)


OPTIONS = {
    "demo": ["--network", "--radius", "--vehicles", "--speedup", "--seed", "--fault", "--autopilot", "--run", "--json"],
    "plan": [
        "--cost",
        "--mtbf",
        "--solver",
        "--stretch",
        "--all-vehicles",
        "--seconds",
        "--seed",
        "--starts",
        "--search",
        "--front",
        "--after",
        "--output",
        "--picture",
        "--json",
    ],
    "check": ["--json"],
    "window": ["--seed", "--picture", "--json"],
    "risk": ["--mtbf", "--samples", "--seed", "--dask", "--jobs", "--picture", "--json"],
    "bench": ["solvers", "table", "upload"],
    "replan": ["--lost", "--at", "--cost", "--seconds", "--seed", "--output", "--json"],
    "export": ["--output", "--format", "--autopilot"],
    "simulate": ["--speedup", "--fault", "--seed", "--wind", "--truth", "--failsafe", "--radio"],
    "fly": ["--plan", "--after", "--run", "--yes", "--json"],
    "restore": ["--yes", "--json", "--quiet"],
}


def test_what_a_flight_left_over_is_planned(place: Place) -> None:
    shutil.copyfile(place.planned(), place.folder / "plan-000.json")
    short_report([1, 3]).write(place.folder / "report.json")
    code, out, _ = place.run(
        "plan", place.path("site.toml"), "--after", str(place.folder), "--seconds", "0.2", "--json"
    )
    assert code == 0
    assert [segment["id"] for segment in json.loads(out)["segments"]] == [1, 3]
    assert place.refused("fly", place.path("site.toml"), "--plan", "x", "--after", "y") == (
        "--after: expected none with --plan, which is flown unchanged"
    )


@pytest.mark.parametrize(("command", "options"), OPTIONS.items(), ids=OPTIONS)
def test_the_help_of_a_command_names_its_options(place: Place, command: str, options: list[str]) -> None:
    code, out, _ = place.run(command, "--help")
    assert code == 0
    words = set(out.replace(",", " ").split())
    assert [option for option in options if option not in words] == []


def test_the_help_names_every_command(place: Place) -> None:
    code, out, _ = place.run("--help")
    assert code == 0
    assert all(f"\n  {command} " in out for command in OPTIONS)


def test_a_plan_is_made_written_and_checked(place: Place) -> None:
    code, out, err = place.run(
        "plan", place.path("site.toml"), "--seconds", "0.2", "--json", "-o", place.path("p.json")
    )
    assert (code, err) == (0, "")
    answer = json.loads(out)
    assert sorted(visit["segment"] for route in answer["routes"] for visit in route["visits"]) == [0, 1, 2, 3]
    assert answer["uncovered"] == []
    content = read_plan(Path(place.path("p.json")))
    assert [vehicle.name for vehicle in content.vehicles] == ["uav1", "uav2"]
    assert place.run("check", place.path("p.json"))[:2] == (0, "every figure is right\n")
    code, out, _ = place.run("check", place.path("p.json"), "--json")
    assert (code, json.loads(out)) == (0, {"ok": True, "wrong": []})


def test_a_plan_in_words(place: Place) -> None:
    code, out, _ = place.run("plan", place.path("site.toml"), "--seconds", "0.2", "--all-vehicles")
    assert code == 0
    assert "uav1: " in out
    assert "(budget 75 %)" in out


def test_a_plan_that_does_not_hold_is_a_no(place: Place) -> None:
    plan = Path(place.planned())
    content = json.loads(plan.read_text(encoding="utf-8"))
    content["routes"][0]["energy_pct"] += 5.0
    plan.write_text(json.dumps(content), encoding="utf-8")
    code, out, _ = place.run("check", str(plan))
    assert code == 1
    assert "energy_pct" in out
    code, out, _ = place.run("check", str(plan), "--json")
    answer = json.loads(out)
    assert (code, answer["ok"], len(answer["wrong"])) == (1, False, 1)


def test_a_network_that_the_budgets_cannot_cover_is_planned_as_far_as_they_reach(place: Place) -> None:
    place.site(budget_pct=0.9)
    code, out, _ = place.run("plan", place.path("site.toml"), "--seconds", "0.2", "--json")
    assert code == 1
    answer = json.loads(out)
    assert answer["uncovered"]
    assert [one["segment"] for one in answer["left_over"]] == answer["uncovered"]
    assert {one["name"] for one in answer["left_over"]} <= {"P1-P2", "P2-P3", "P3-P4", "P4-P5"}
    code, out, _ = place.run("plan", place.path("site.toml"), "--seconds", "0.2", "-o", place.path("p.json"))
    assert code == 1
    *_, left, how = out.splitlines()
    assert left.startswith("left over, ")
    assert all(one["name"] in left for one in answer["left_over"])
    assert how == f"to fly exactly this plan: faultline fly {place.path('site.toml')} --plan {place.path('p.json')}"
    # It is written all the same: it may be what the crew wants to fly first.
    assert place.run("check", place.path("p.json"))[0] == 0


def test_what_a_loss_would_mean(place: Place) -> None:
    plan = place.planned()
    code, out, _ = place.run(
        "replan", plan, "--lost", "uav1", "--at", "10", "--seconds", "0.2", "--json", "-o", place.path("after.json")
    )
    answer = json.loads(out)
    assert (code, answer["uncovered"]) == (0, [])
    assert [route["vehicle"] for route in answer["routes"]] == ["uav2"]
    assert place.run("check", place.path("after.json"))[0] == 0


def test_a_loss_that_cannot_be_made_good_is_a_no(place: Place) -> None:
    needed = max(read_plan(Path(place.planned())).energies_pct)
    plan = place.planned(budget_pct=round(needed * 1.1, 2))
    assert read_plan(Path(plan)).plan.uncovered == ()
    code, out, _ = place.run("replan", plan, "--lost", "uav1", "--at", "0", "--seconds", "0.2", "--json")
    assert code == 1
    assert json.loads(out)["uncovered"]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_an_export_is_read_again(place: Place, autopilot: str) -> None:
    plan = place.planned()
    code, out, _ = place.run("export", plan, "-o", place.path("out"), "--autopilot", autopilot)
    assert code == 0
    names = [Path(line).name for line in out.splitlines()]
    assert names
    for name in names:
        assert read_qgc_plan(Path(place.path("out"), name).read_text(encoding="utf-8"))[0]
    code, out, _ = place.run("export", plan, "-o", place.path("out"), "--format", "waypoints")
    assert code == 0
    assert all(Path(line).read_text(encoding="utf-8").startswith("QGC WPL 110") for line in out.splitlines())


BAD_NETWORKS: dict[str, tuple[Callable[[Place], None], str]] = {
    "missing": (lambda p: p.site(file="nowhere.geojson"), "nowhere.geojson: "),
    "not JSON": (lambda p: p.network(text="{"), "line.geojson: "),
    "no network": (lambda p: p.network(text="[1, 2]"), "line.geojson: "),
    "no segment": (lambda p: p.network(point("A", *LINE[0])), "line.geojson: "),
    "unknown pylon": (lambda p: p.network(point("A", *LINE[0]), feature(None, a="A", b="Z")), "'Z'"),
    "zero-length segment": (
        lambda p: p.network(point("A", *LINE[0]), point("B", *LINE[0]), feature(None, a="A", b="B")), "same place",
    ),
    "NaN": (lambda p: p.network(*line(*LINE, (15.6, float("nan")))), "line.geojson: "),
    "swapped coordinates": (lambda p: p.network(*line(*((lat, lon) for lon, lat in LINE))), "swapped"),
    "out of this world": (lambda p: p.network(*line((15.6, 1e308), (15.7, 49.6))), "line.geojson: "),
    "out of range": (lambda p: p.network(*line((15.6, 95.0), (15.7, 95.0))), "line.geojson: "),
    "another country": (lambda p: p.network(*line((25.6, 49.6), (25.7, 49.6))), "line.geojson: "),
    "nothing near": (lambda p: p.site(extra="radius_m = 1.0"), "radius_m"),
    "unknown suffix": (lambda p: p.site(file="site.toml"), "site.toml: "),
}  # fmt: skip


@pytest.mark.parametrize(("spoil", "expected"), BAD_NETWORKS.values(), ids=BAD_NETWORKS)
def test_a_network_that_cannot_be_used(place: Place, spoil: Callable[[Place], None], expected: str) -> None:
    spoil(place)
    reason = place.refused("plan", place.path("site.toml"), "--seconds", "0.2", "--json")
    assert expected in reason
    assert str(place.folder) in reason


def test_a_site_that_cannot_be_used(place: Place) -> None:
    assert "no such file" in place.refused("plan", place.path("nowhere.toml"))
    place.site(budget_pct=-1)
    assert "vehicle[0].budget_pct: expected" in place.refused("plan", place.path("site.toml"))


def test_what_the_search_is_tuned_by(place: Place) -> None:
    tuned = Path(place.path("search.toml"))
    tuned.write_text("[annealing]\nbatch = 50\n", encoding="utf-8")
    site, search = place.path("site.toml"), ("--search", str(tuned))
    code, out, _ = place.run("plan", site, "--seconds", "0.2", "--json", *search)
    assert code == 0
    assert not json.loads(out)["uncovered"]
    reason = place.refused("plan", site, "--solver", "grasp", *search)
    assert "--search: expected none with --solver grasp" in reason
    tuned.write_text("[annealing]\nbatch = 0\n", encoding="utf-8")
    assert f"{tuned}: annealing.batch: expected greater than or equal to 1, got 0" in place.refused(
        "plan", site, *search
    )
    tuned.unlink()
    assert f"{tuned}: no such file" in place.refused("plan", site, *search)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["plan"], "Missing argument 'SITE'"),
        (["plan", "SITE", "--cost", "cheapest"], "--cost"),
        (["plan", "SITE", "--seconds", "soon"], "--seconds"),
        (["plan", "SITE", "--seconds", "0"], "--seconds"),
        (["plan", "SITE", "--seed", "-1"], "--seed"),
        (["plan", "SITE", "--sped", "1"], "--sped"),
        (["simulate", "SITE", "--speedup", "0"], "--speedup"),
        (["replan", "PLAN", "--at", "5"], "--lost"),
        (["export", "PLAN", "-o", "out", "--format", "shp"], "--format"),
        (["flie", "SITE"], "flie"),
    ],
)
def test_a_call_that_is_not_one(place: Place, arguments: list[str], expected: str) -> None:
    assert expected in place.refused(*arguments)


BAD_PLANS: dict[str, tuple[str | bytes | None, str]] = {
    "missing": (None, "No such file"),
    "not JSON": ("{", "plan.json: "),
    "another file": ('{"format": "something"}', "format"),
    "not text": (b"\xff\xfe", "plan.json: "),
    "a list": ("[]", "plan.json: "),
}


@pytest.mark.parametrize(("content", "expected"), BAD_PLANS.values(), ids=BAD_PLANS)
@pytest.mark.parametrize("command", ["check", "replan", "export"])
def test_a_plan_that_cannot_be_read(place: Place, command: str, content: str | bytes | None, expected: str) -> None:
    if content is not None:
        Path(place.path("plan.json")).write_bytes(content.encode() if isinstance(content, str) else content)
    rest = {"check": [], "replan": ["--lost", "uav1", "--at", "5"], "export": ["-o", place.path("out")]}[command]
    reason = place.refused(command, place.path("plan.json"), *rest)
    assert place.path("plan.json") in reason
    assert expected in reason


def test_a_vehicle_that_the_plan_does_not_have(place: Place) -> None:
    reason = place.refused("replan", place.planned(), "--lost", "uav9", "--at", "5")
    assert reason.endswith("--lost: expected one of uav1, uav2, got uav9")


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ("nonsense", "VEHICLE:KIND[=VALUE]@WHEN"),
        ("uav1:explode@40%", "unknown kind 'explode'"),
        ("uav9:silent@40%", "uav9"),
        ("uav1:silent@140%", "WHEN"),
        ("uav1:battery-step=lots@40%", "battery-step"),
        ("uav1:drain@40%", "drain needs a value"),
    ],
)
def test_a_fault_that_cannot_be_simulated(place: Place, spec: str, expected: str) -> None:
    reason = place.refused("simulate", place.path("site.toml"), "--fault", spec)
    assert expected in reason


def test_a_radio_that_cannot_be_simulated(place: Place) -> None:
    reason = place.refused("simulate", place.path("site.toml"), "--radio", "sick")
    assert "radio 'sick': unknown profile 'sick', expected one of sik, sik-stock" in reason


def test_a_demo_refuses_its_faults_before_anything_is_started(place: Place) -> None:
    reason = place.refused("demo", "--fault", "uav9:silent@40%", "--run", place.path("run"))
    assert reason.endswith("no vehicle 'uav9', expected one of all, uav1, uav2, uav3, uav4")


def test_a_plan_starts_from_what_a_flight_taught(place: Place) -> None:
    run, factor = place.folder / "before", PaceEstimate(1.2, 0.02**2, 30)
    run.mkdir()
    known = {"uav1": KnownVehicle(factor, factor, Prior(1.1, 0.04), 20.0, "ardupilot", PRESETS["mavic3"].name)}
    build_learned_document(known, "2026-01-02").write(RunDirectory(run).learned)
    usual = read_plan(Path(place.planned()))
    plan = place.path("learned-plan.json")
    code, _, said = place.run(
        "plan", place.path("site.toml"), "--seconds", "0.2", "--all-vehicles", "--learned", str(run), "-o", plan
    )
    assert code == 0
    assert "uav1: inspections take 120 ± 2 % of the model's time, transits 120 ± 2 %, consumption 110 ± 4 %" in said
    assert f"uav2: nothing learned in {run / 'learned.json'}; using the defaults" in said
    found = read_plan(Path(plan))
    assert [vehicle.consumption for vehicle in usual.vehicles] == [1.0, 1.0]
    assert [vehicle.consumption for vehicle in found.vehicles] == [1.1, 1.0]
    assert found.pricing is not None
    assert found.pricing.models["uav1"].pace == Pace(1.2, 1.2)


def test_a_vehicle_that_does_not_answer(place: Place) -> None:
    place.site(extra="[flight]\nconnect_timeout_s = 0.1")
    plan = place.planned()
    reason = place.refused(
        "fly", place.path("site.toml"), "--plan", plan, "--yes", "--json", "--run", place.path("run")
    )
    assert "no heartbeat of system " in reason
    assert " on udpin://127.0.0.1:" in reason
    assert "within 0.1 s" in reason


def test_a_port_that_is_taken(place: Place) -> None:
    plan = place.planned()
    content = place.folder.joinpath("site.toml").read_text(encoding="utf-8")
    port = int(content.split("udpin://127.0.0.1:")[1].split('"')[0])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plug:
        plug.bind(("127.0.0.1", port))
        reason = place.refused("fly", place.path("site.toml"), "--plan", plan, "--json", "--run", place.path("run"))
    assert reason.startswith(f"udpin://127.0.0.1:{port}: cannot be opened: ")


def test_a_plan_of_another_site(place: Place) -> None:
    plan = place.planned()
    text = place.folder.joinpath("site.toml").read_text(encoding="utf-8").replace('name = "uav1"', 'name = "falcon"')
    place.folder.joinpath("site.toml").write_text(text, encoding="utf-8")
    reason = place.refused("fly", place.path("site.toml"), "--plan", plan, "--json", "--run", place.path("run"))
    assert "vehicles: expected falcon, uav2, got uav1, uav2" in reason


def test_a_run_directory_is_not_used_twice(place: Place) -> None:
    run = place.folder / "run"
    run.mkdir()
    (run / "events.jsonl").touch()
    site, plan = place.path("site.toml"), place.planned()
    for words in (("fly", site, "--plan", plan), ("fly", site), ("day", site), ("demo",)):
        reason = place.refused(*words, "--run", str(run))  # one line: no plan was begun
        assert reason == f"{run}: --run: expected a new directory, this one holds a run already"


def test_the_record_of_a_flight_before_its_take_off_is_not_written_over(place: Place) -> None:
    """In another process, which is asking its crew."""
    run = place.folder / "run"
    run.mkdir()
    (run / "site.toml").write_text("of the other flight", encoding="utf-8")
    plan = place.planned()
    with lock_run_directory(run):
        reason = place.refused("fly", place.path("site.toml"), "--plan", plan, "--json", "--run", str(run))
    assert reason.startswith(f"{run}: another faultline flies this directory already")
    assert (run / "site.toml").read_text(encoding="utf-8") == "of the other flight"


@pytest.mark.parametrize("words", [[], ["bench"]])
def test_a_group_without_a_command_shows_its_help(place: Place, words: list[str]) -> None:
    code, out, err = place.run(*words)
    assert (code, err) == (0, "")
    assert out.startswith("Usage: faultline")
    assert len(out.splitlines()) > 20


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["window", "x", "--seed", "-5"],
            "Invalid value for '--seed': expected greater than or equal to 0. See --help.",
        ),
        (["plan", "x", "--cost", "fast"], "Invalid value for '--cost': 'fast' is not one of "),
        (["plan", "x", "--vehicle", "3"], "No such option: --vehicle (Possible options: --all-vehicles). See --help."),
        (["plam"], "No such command 'plam'. Did you mean "),
        (["plan"], "Missing argument 'SITE'. See --help."),
    ],
)
def test_a_wrong_option_is_named_in_sentences(place: Place, words: list[str], said: str) -> None:
    reason = place.refused(*words)
    assert reason.startswith(said)
    assert reason.endswith((". See --help.", "? See --help."))


@pytest.mark.parametrize("option", ["-o", "--picture"])
def test_a_place_that_cannot_be_written_to(place: Place, option: str) -> None:
    target = place.path("nowhere/plan.png")
    reason = place.refused("plan", place.path("site.toml"), "--seconds", "0.2", "--json", option, target)
    assert reason.startswith(f"{target}: cannot be written: ")


def kept(stage: ChangeStage, name: str = "RTL_ALT") -> KeptParameter:
    return KeptParameter(
        "uav1", 1, "ardupilot", name, 1500.0, 2700.0, 6, "cm", "keeps its RTL in its own layer", stage=stage
    )


def test_an_internal_error_is_kept_in_a_file_that_no_other_user_could_plant(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    def breaks(**_: object) -> int:
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr(commandline, "cli", breaks)
    monkeypatch.setattr(tempfile, "tempdir", str(place.folder))
    files = []
    for _ in range(2):
        code, out, err = place.run("check", "plan.json")
        assert (code, out) == (70, "")
        files.append(Path(err.rpartition(" with ")[2].strip()))
    assert files[0] != files[1]
    for file in files:
        assert file.parent == place.folder
        assert file.stat().st_mode & 0o777 == 0o600
        assert "ZeroDivisionError: by nothing" in file.read_text(encoding="utf-8")


def test_what_cannot_be_restored_is_refused(place: Place) -> None:
    missing = "expected a run directory with parameters.json; no parameter was changed from here"
    assert place.refused("restore", place.path("nowhere")) == f"{place.path('nowhere')}: {missing}"
    assert place.refused("restore", str(place.folder)) == f"{place.folder}: {missing}"
    path = place.folder / "parameters.json"
    for text, words in (
        ("{", "content: expected JSON: "),
        ('{"format": "faultline-parameters/2", "parameters": []}', "format: expected 'faultline-parameters/1', got "),
        ('{"format": "faultline-parameters/1"}', "parameters: expected this key, but it is missing"),
    ):
        path.write_text(text)
        assert place.refused("restore", str(place.folder)).startswith(f"{path}: {words}")
    PARAMETERS.write(place.folder, [kept(ChangeStage.SET)])
    (place.folder / "site.toml").unlink()
    assert place.refused("restore", str(place.folder)).startswith(str(place.folder / "site.toml"))


def test_a_directory_that_is_flown_from_is_not_restored_from(place: Place) -> None:
    PARAMETERS.write(place.folder, [kept(ChangeStage.SET)])
    with lock_run_directory(place.folder):
        for asked in ((), ("--yes",)):  # one line: nothing is announced, nobody is asked
            assert "another faultline flies this directory already" in place.refused(
                "restore", str(place.folder), *asked
            )


def test_nothing_to_restore_is_done(place: Place) -> None:
    for rows in ([], [kept(ChangeStage.RESTORED)]):
        PARAMETERS.write(place.folder, rows)
        assert place.run("restore", str(place.folder)) == (0, f"{place.folder}: all parameters are restored\n", "")
        assert place.run("restore", str(place.folder), "--quiet") == (0, "", "")
        code, out, _ = place.run("restore", str(place.folder), "--json")
        assert (code, json.loads(out)["restored"], len(json.loads(out)["parameters"])) == (0, True, len(rows))


def test_without_confirmation_nothing_is_sent(place: Place) -> None:
    PARAMETERS.write(place.folder, [kept(ChangeStage.SET), kept(ChangeStage.RESTORED, "RTL_CONE_SLOPE")])
    code, out, err = place.run("restore", str(place.folder))
    assert (code, out) == (1, "")
    assert [line.strip() for line in err.splitlines()] == [
        "uav1: RTL_ALT 2700 -> 1500 cm",
        "! not confirmed; nothing was sent to any vehicle",
    ]


def test_a_vehicle_that_does_not_answer_stays_as_it_is(place: Place) -> None:
    place.site(extra="[flight]\nconnect_timeout_s = 0.1")
    PARAMETERS.write(place.folder, [kept(ChangeStage.SET), replace(kept(ChangeStage.SET), vehicle="uav9", sysid=9)])
    code, out, err = place.run("restore", str(place.folder), "--yes")
    assert (code, out) == (1, f"{place.folder}: 2 of 2 not restored\n")
    assert "uav1: RTL_ALT (was 1500) not restored: does not answer" in err
    assert "uav9: RTL_ALT (was 1500) not restored: is not in the site file" in err
    assert f"uav1: to restore them: faultline restore {place.folder}" in err

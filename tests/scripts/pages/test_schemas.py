"""The published schemas hold for what the program writes, and refuse what its models refuse."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator
from copy import deepcopy
from functools import cache, partial
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from pydantic import TypeAdapter, ValidationError

from executor.analysis.report import build_report
from executor.cli.main import main
from missions import PlanFile
from planner import Cost
from scripts.pages.schemas import FILES, schemas
from tests.executor.analysis.test_report import SAID
from tests.executor.core.stories import FLEET, under_way
from tests.executor.flights import write_run

PLANS = sorted((Path(__file__).parents[2] / "missions" / "plans" / "v2").iterdir())
ODD: list[object] = [None, True, "", "x", -1, 1.5, 1e300, [], [None], {}, {"a": 1}]


@cache
def validator(name: str) -> jsonschema.Draft202012Validator:
    content = json.loads(schemas()[f"schemas/{name}.schema.json"])
    jsonschema.Draft202012Validator.check_schema(content)
    return jsonschema.Draft202012Validator(content)


@cache
def flown() -> Any:
    """Return the report of a flight in which uav2 falls silent."""
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.finish()
    return build_report(FLEET.context, flight.state, flight.now_s, said=SAID).to_plain()


def documents() -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield real documents: the name of the schema, and what makes one."""
    for path in PLANS:
        yield "dayplan" if path.stem == "days" else "plan", partial(read_json, path)
    yield "report", flown
    yield "vehicles", SAID.to_plain
    yield "site", site


def read_json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def site() -> dict[str, Any]:
    return tomllib.loads(SITE)


SITE = """
[depot]
lat_deg = 49.6
lon_deg = 15.6
[network]
file = "line.geojson"
[inspection]
wind_m_s = [3.0, -1.0]
[mqtt]
host = "10.0.0.7"
[[vehicle]]
name = "uav1"
connection = "udpin://0.0.0.0:14551"
sysid = 1
autopilot = "px4"
"""


ADAPTERS = {model: TypeAdapter[object](model) for model in FILES.values()}


def accepted(model: type[object], document: object) -> bool:
    try:
        ADAPTERS[model].validate_json(json.dumps(document))
    except ValidationError:
        return False
    return True


@pytest.mark.parametrize(("name", "make"), [*documents()])
def test_a_real_document_keeps_to_its_schema(name: str, make: Callable[[], Any]) -> None:
    validator(name).validate(make())
    assert accepted(FILES[name], make())


def test_what_the_command_line_writes_keeps_to_the_schemas(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in (
        ["init", "default", "--radius", "700", "-o", "site.toml"],
        ["plan", "site.toml", "--seconds", "0.2", "-o", "plan.json"],
    ):
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert ended.value.code == 0, capsys.readouterr().err
    validator("site").validate(tomllib.loads(Path("site.toml").read_text()))
    validator("plan").validate(json.loads(Path("plan.json").read_text()))


def test_a_run_directory_keeps_to_the_schemas(tmp_path: Path) -> None:
    write_run(tmp_path)
    for path in tmp_path.glob("plan-*.json"):
        validator("plan").validate(json.loads(path.read_text()))
    validator("report").validate(json.loads((tmp_path / "report.json").read_text()))
    validator("site").validate(tomllib.loads((tmp_path / "site.toml").read_text()))


WRONG: list[tuple[str, tuple[str | int, ...], object]] = [
    ("plan", ("format",), "faultline-plan/1"),
    ("plan", ("depot", "lat_deg"), 90.0),
    ("plan", ("depot", "alt_m"), "450"),
    ("plan", ("vehicles",), []),
    ("plan", ("vehicles", 0, "name"), "../uav1"),
    ("plan", ("vehicles", 0, "start"), [1.0, 2.0, 3.0]),
    ("plan", ("routes", 0, "visits", 0, "reversed"), 1),
    ("plan", ("cost", "name"), "best"),
    ("plan", ("seed",), -1),
    ("plan", ("segments", 0, "a"), [1.0, 2.0]),
    ("plan", ("segments", 0, "id"), True),
    ("dayplan", ("days",), []),
    ("dayplan", ("vehicles", 0, "hours"), [[1.0]]),
    ("dayplan", ("cost", "name"), "minmax"),
    ("report", ("format",), "faultline-report/2"),
    ("report", ("finished",), "yes"),
    ("report", ("faults", 0, "kind"), "tired"),
    ("report", ("vehicles", 0, "segments"), ["0"]),
    ("report", ("inspections", 0, "speed_mean_m_s"), None),
    ("report", ("checks", 0, "severity"), "grave"),
    ("vehicles", ("vehicles", 0, "pad", "alt_m"), None),
    ("vehicles", ("vehicles", 0, "stations"), [[1]]),
    ("site", ("vehicle",), []),
    ("site", ("vehicle", 0, "sysid"), 255),
    ("site", ("vehicle", 0, "autopilot"), "betaflight"),
    ("site", ("inspection", "wind_m_s"), [40.0, 0.0]),
    ("site", ("inspection", "hight_m"), 15.0),
    ("site", ("mqtt", "port"), 0),
]  # fmt: skip


@pytest.mark.parametrize(("name", "place", "value"), WRONG)
def test_what_is_wrong_is_refused_by_schema_and_model(name: str, place: tuple[str | int, ...], value: object) -> None:
    document = changed(next(make() for one, make in documents() if one == name), place, value)
    assert not validator(name).is_valid(document)
    assert not accepted(FILES[name], document)


@pytest.mark.parametrize("name", ["dayplan", "plan", "report", "vehicles"])
def test_whatever_a_schema_refuses_its_model_refuses_too(name: str) -> None:
    """The other way round a model knows more: ids that belong together, for one."""
    document = next(make() for one, make in documents() if one == name)
    refused = 0
    for place in places(document):
        for value in ODD:
            odd = changed(document, place, value)
            if not validator(name).is_valid(odd):
                refused += 1
                assert not accepted(FILES[name], odd), (place, value)
    assert refused > 200


def test_a_plan_can_be_chosen_by_every_cost() -> None:
    names = TypeAdapter(PlanFile).json_schema()["$defs"]["PlanCost"]["properties"]["name"]["enum"]
    assert names == [*(cost.value for cost in Cost), "window", "coverage"]


def places(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield the places of everything in a document, of lists their first two entries."""
    inner = value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    for key, one in inner:
        yield (*path, key)
        yield from places(one, (*path, key))


def changed(document: Any, place: tuple[str | int, ...], value: object) -> Any:
    copy = deepcopy(document)
    at = copy
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    return copy

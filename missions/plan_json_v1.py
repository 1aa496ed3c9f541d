"""Convert plan files of version 1, of a single flight and of days, to version 2."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from missions.errors import PlanFileError
from missions.files import find_object

V2 = "faultline-plan/2"
Json = dict[str, Any]


def upgrade_plan(text: str, source: str) -> str:
    """Return a plan file's text converted to version 2; a text of another or no version is returned unchanged.

    Args:
        text: The file's text.
        source: Its name, for messages.

    Raises:
        PlanFileError: it declares version 1, but lacks required keys of version 1.
    """
    document = find_object(text)
    name = document.get("format")
    upgrade = _UPGRADES.get(name) if isinstance(name, str) else None
    if upgrade is None:
        return text
    try:
        return json.dumps(upgrade(document))
    except (KeyError, ValueError, TypeError, AttributeError, IndexError) as error:
        missing = f"expected {error.args[0]!r}, but it is missing" if isinstance(error, KeyError) else str(error)
        raise PlanFileError(f"{source}: content: expected what {name} has: {missing}") from error


def _upgrade_flight(document: Json) -> Json:
    found = {**document, "format": V2, "bases": [{"name": "depot", **document["depot"]}]}
    found["vehicles"] = [_without_nulls(vehicle) for vehicle in document["vehicles"]]
    if document.get("inspection") is not None:
        inspection = _without_nulls(document["inspection"])
        found["inspection"] = {**inspection, "flat": inspection.pop("heights", "known") == "flat"}
    if document.get("model") is not None:
        found["model"] = _upgrade_model(document)
    return found


def _upgrade_model(document: Json) -> Json:
    model, travel = document["model"], document["travel"]
    speeds = {key: travel[key] for key in ("transit_speed_m_s", "inspection_speed_m_s")}
    names = [vehicle["name"] for vehicle in document["vehicles"]]
    rows = dict(zip(names, model["vehicles"], strict=False))
    found = {
        "tracks_m": model["tracks"],
        "bases": {name: row["base"] for name, row in rows.items()},
        "models": {name: _upgrade_flight_model(row, model["power"], speeds) for name, row in rows.items()},
        "pads_m": model.get("pads", []),
        "column_m": model.get("column_m", 0.0),
        "answer_s": model.get("answer_s", 0.0),
        "kept_out": [_upgrade_area(area) for area in model.get("areas", [])],
        "barred": {name: row["barred"] for name, row in rows.items() if row.get("barred")},
        "steps_m": {name: row["step_m"] for name, row in rows.items() if row.get("step_m")},
        "layered": {name: row["layered"] for name, row in rows.items() if row.get("layered")},
        "low_starts": [name for name, row in rows.items() if row.get("low_start")],
        **{key: dict(model.get(key, [])) for key in ("besides_s", "in_layer_s", "deep_m")},
    }
    if (relief := model.get("relief")) is not None:
        grid = {key: relief[key] for key in ("step_m", "heights_m")}
        found["relief"] = {"grid": {"low_m": [relief["east_m"], relief["north_m"]], **grid}}
    return found


def _upgrade_flight_model(row: Json, power: Json, speeds: Mapping[str, Any]) -> Json:
    return {"power": power, **speeds, **{key: row[key] for key in ("performance", "pace") if key in row}}


def _upgrade_area(area: Json) -> Json:
    who: Json = {key: area[key] for key in ("vehicles", "highest_m") if key in area}
    return {"area": {"rings_m" if key == "rings" else key: area[key] for key in area if key not in who}, **who}


def _upgrade_days(document: Json) -> Json:
    bases = [base["name"] for base in document["bases"]]
    vehicles = {one["name"]: one for one in document["vehicles"]}
    home = {name: one["pads"][bases.index(one["base"])] for name, one in vehicles.items()}
    values = {"finish": document["finish_s"], "flight": document["flight_s"], "swaps": float(len(document["sorties"]))}
    models = {
        name: _upgrade_flight_model(
            one, document["power"],
            {"transit_speed_m_s": one["transit_speed_m_s"], "inspection_speed_m_s": one["speed_m_s"]},
        )
        for name, one in vehicles.items()
    }  # fmt: skip
    ids = [segment["id"] for segment in document["segments"]]
    barred = {
        name: [number for number, segment in enumerate(ids) if segment not in one["segments"]]
        for name, one in vehicles.items()
        if one.get("segments") is not None
    }
    return {
        **document,
        "format": V2,
        "days": [[day["begin_s"], day["end_s"]] for day in document["days"]],
        "vehicles": [
            {**one, "start": home[name]["place_m"][:2], "hours": one["windows"]} for name, one in vehicles.items()
        ],
        "routes": document["sorties"],
        "cost": {"name": document["objective"], "value": values[document["objective"]]},
        "model": {"tracks_m": document["tracks"], "bases": home, "models": models, "barred": barred},
    }


def _without_nulls(part: Mapping[str, Any]) -> Json:
    return {key: value for key, value in part.items() if value is not None}


_UPGRADES: Mapping[str, Callable[[Json], Json]] = {
    "faultline-plan/1": _upgrade_flight,
    "faultline-dayplan/1": _upgrade_days,
}

"""A re-plan: its beginning, its answer and its end."""

from __future__ import annotations

from dataclasses import replace

from executor.core.interface.commands import Upload
from tests.executor.core.steps import (
    Stepped,
)


def without_paths(of: Stepped) -> tuple[object, ...]:
    """Return what comes of something without the paths of missions, which are shown elsewhere."""
    commands, ones, flight = of
    told = [
        f"upload {one.vehicle} {one.revision} {one.airborne}" if isinstance(one, Upload) else one for one in commands
    ]
    plan = flight.get("replan")
    if plan is not None:
        visits = {name: (mission.visits, mission.fresh) for name, mission in plan.missions.items()}
        flight = {**flight, "replan": (replace(plan, missions={}), visits)}
    return told, ones, flight

"""Keep the plans of a site on disk: those that the page made, each in a file named by its content, and the chosen one.

The chosen plan is a file next to the site file, for `faultline fly --plan`; another program may write it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from executor.errors import SiteError
from executor.plan_page.plan_work import MadePlan, name_plan
from executor.plan_page.site_store import work_folder_of
from missions.files import stamp_file, write_whole

MOST_PLANS = 24
"""Number of plans to keep; the oldest are dropped, never the chosen one."""
PLANNED_BY = frozenset({
    "depot", "network", "terrain", "inspection", "energy", "area", "place", "vehicle", "flight", "camera", "look",
    "day", "base", "fence", "learned", "lock",
})  # fmt: skip
"""Tables that a plan depends on."""
NOT_OF_VEHICLES = frozenset({"connection", "sysid", "backend"})


class PlanStore:
    """The plans of one site."""

    def __init__(self, site: Path) -> None:
        """Set the site file; `list_new` finds the plans."""
        self.site = site
        self.folder = work_folder_of(site) / "plans"
        self.file = site.with_name("plan.json" if site.stem == "site" else f"{site.stem}-plan.json")
        """File of the chosen plan."""
        self.summaries: dict[str, Mapping[str, Any]] = {}
        """Summaries by plan id, oldest first."""
        self.facts: dict[str, str] = {}
        """Fingerprint of the site for which each plan was made, or last checked to fit."""
        self.chosen: str | None = None
        self._seen: tuple[int, int] | None = None

    def path_of(self, name: str) -> Path:
        """Return the file of a plan.

        Raises:
            SiteError: there is none of this name.
        """
        if name not in self.summaries:
            raise SiteError(f"plan: expected one of {', '.join(self.summaries) or 'none'}, got {name[:20]!r}")
        return self.folder / f"{name}.json"

    def list_new(self) -> Sequence[Path]:
        """Return the files of new plans, oldest first; nothing is parsed."""
        self.take_chosen()
        with suppress(OSError, ValueError):
            self.facts = {**json.loads((self.folder / "facts").read_bytes()), **self.facts}
        with suppress(OSError):
            found = sorted(self.folder.glob("?" * 12 + ".json"), key=lambda path: path.stat().st_mtime_ns)
            return [path for path in found if path.stem not in self.summaries]
        return ()

    def take_chosen(self) -> Path | None:
        """Store a chosen plan that another program has written; return its file here if it is new."""
        try:
            if (seen := stamp_file(self.file)) == self._seen:
                return None
            content = self.file.read_bytes()
            self._seen, self.chosen = seen, name_plan(content)
            path = self.folder / f"{self.chosen}.json"
            if not path.exists():
                self.folder.mkdir(parents=True, exist_ok=True)
                write_whole(path, content)
        except OSError:
            self.chosen = None
            return None
        return path

    def add(self, made: Sequence[MadePlan], facts: str) -> None:
        """Add plans made for a site with this fingerprint; the oldest are dropped."""
        for one in made:
            self.summaries.pop(one.id, None)
            self.summaries[one.id] = one.summary
            self.facts[one.id] = facts
        for name in list(self.summaries)[: max(0, len(self.summaries) - MOST_PLANS)]:
            if name != self.chosen:
                del self.summaries[name]
                with suppress(OSError):
                    (self.folder / f"{name}.json").unlink()
        self.keep_facts()

    def keep_facts(self) -> None:
        """Record the site fingerprint of each plan."""
        with suppress(OSError):  # it is recomputed next time
            self.facts = {name: facts for name, facts in self.facts.items() if name in self.summaries}
            write_whole(self.folder / "facts", json.dumps(self.facts).encode())

    def choose(self, name: str) -> None:
        """Make a plan the one to fly.

        Raises:
            SiteError: there is none of this name, or its file cannot be written.
        """
        content = self.path_of(name).read_bytes()
        try:
            write_whole(self.file, content)
        except OSError as error:
            raise SiteError(f"{self.file}: cannot be written: {error.strerror}") from error
        self.take_chosen()

    def describe(self, name: str, facts: str) -> dict[str, Any]:
        """Return a plan's entry in the page's list; `facts` is the present fingerprint of the site."""
        return {
            "id": name, "file": self.file.name if name == self.chosen else None,
            "stale": self.facts.get(name) != facts, **self.summaries[name],
        }  # fmt: skip


def sum_up_facts(values: Mapping[str, Any], stamps: Sequence[object]) -> str:
    """Return a fingerprint of everything that a plan depends on."""
    told = {key: one for key, one in values.items() if key in PLANNED_BY}
    fleet = told.get("vehicle")
    if isinstance(fleet, list):
        told["vehicle"] = [
            {key: value for key, value in one.items() if key not in NOT_OF_VEHICLES} if isinstance(one, dict) else one
            for one in fleet
        ]
    return sha256(json.dumps([told, list(stamps)], sort_keys=True, default=str).encode()).hexdigest()[:16]

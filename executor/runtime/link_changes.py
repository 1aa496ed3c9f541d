"""Tell the crew when commands to a vehicle switch to another of its links."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from executor.core.interface.commands import Say
from executor.core.interface.ports import Link
from executor.core.lines import link

SAYS_AGAIN_S = 20.0
"""Seconds between two lines about one vehicle; a change that was reverted meanwhile is not reported."""


class LinkChanges:
    """Link in use of each vehicle, as last reported."""

    def __init__(self, links: Mapping[str, Link]) -> None:
        self._links = links
        self._used = {name: one.ways[0] for name, one in links.items()}
        self._said_s: dict[str, float] = {}

    def list_to_say(self, now_s: float) -> Iterator[Say]:
        """Yield a line for each vehicle whose commands use another link than last reported."""
        for name, one in self._links.items():
            used, before = one.ways[0], self._used[name]
            if used is before or now_s - self._said_s.get(name, float("-inf")) < SAYS_AGAIN_S:
                continue
            self._used[name], self._said_s[name] = used, now_s
            preferred = one.describe_links()[0].connection == used.connection
            line = link.MOVED_BACK if preferred else link.MOVED_TO_BETTER
            line = line if before.is_alive else link.MOVED_FROM_SILENT
            yield line.say(vehicle=name, left=before.connection, used=used.connection)

"""What came of a network file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from missions.network import Network
from missions.readers.network_build import MendingLimits
from missions.readers.raw_network import Remark
from missions.readers.read_options import Comparison


@dataclass(frozen=True, slots=True)
class Selection:
    """What of a file is wanted, and how far it may be mended."""

    layers: tuple[str, ...] = ()
    where: tuple[Comparison, ...] = ()
    crs: str | None = None
    """Of a file that does not say its own; of a graph file the map grid of its metres."""
    mending: MendingLimits = field(default_factory=MendingLimits)
    encoding: str | None = None
    """Of a table in text that is not UTF-8; None to try."""


@dataclass(frozen=True, slots=True)
class NetworkImport:
    """A network, and how it came out of its file."""

    network: Network
    format: str
    crs: str
    has_depot: bool
    """Whether the depot is known; otherwise the network's is the middle of its poles."""
    lines: Mapping[str, str]
    """The line of each segment, by the segment's label; empty where there is none."""
    found: tuple[Remark, ...]
    """What was mended or left out, and what is worth a look."""

"""Response models of the plan page's API; tests check every response against them."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from missions import BreakingLoss
from planner.sorties import LossWindow

Place = tuple[float, float]
"""Latitude and longitude in degrees."""


class Answer(BaseModel):
    """A JSON object."""

    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True)


class ErrorAnswer(Answer):
    """Reason for a refusal."""

    error: str
    """Error message, one line."""
    path: list[str | int] | None
    """Site-file key that caused the error, if there is one."""


class ProblemPart(Answer):
    """Problem of the site."""

    path: list[str | int] | None
    """Site-file key that caused the problem, if known."""
    message: str
    """Same text as on the command line."""


class SitePart(Answer):
    """The site file."""

    path: str
    name: str
    text: str


class NetworkPart(Answer):
    """The network of the site."""

    digest: str
    """Changes whenever the answer of `GET /api/network` changes."""
    segments: int


class PlanSummary(Answer):
    """Plan in a list."""

    id: str
    file: str | None
    """File that `fly` takes; only the chosen plan has one."""
    stale: bool
    """Whether the site has changed since the plan was made."""
    kind: Literal["flight", "day"]
    longest_s: float
    energy_pct: dict[str, float]
    """Battery used by each vehicle; for days, by all its sorties."""
    window_pct: float | None
    window_from_s: float | None
    breaking: BreakingLoss | None
    """Latest loss that no re-plan covers, just before the window."""
    uncovered: int
    """Number of segments that no route covers."""
    cost: str
    """Cost function that chose the plan."""
    value: float
    seconds: float
    """Duration of the search."""
    finish_s: float
    """Time at which the last vehicle has landed."""


class JobPart(Answer):
    """A search for plans."""

    id: str
    kind: Literal["plan", "front", "day", "left"]
    state: Literal["running", "done", "cancelled", "failed"]
    elapsed_s: float
    limit_s: float
    value: float | None
    """Cost of the best plan so far; null until there is one."""
    uncovered: int | None
    """Segments that the best plan leaves out."""
    better_pct: float | None
    """Improvement over the first plan that left as few segments out."""
    since_s: float | None
    """Time at which that first plan was found."""
    improved_s: float | None
    """Time of the last improvement."""
    error: str | None
    plans: list[str]
    """Ids of the plans that the job made."""


class WorkspaceAnswer(Answer):
    """Workspace of the page."""

    revision: int
    """Grows with every change of the site."""
    checked: int
    """Last revision whose network and ground were read. Until it equals `revision`, `problems` covers the keys
    alone."""
    folder: str
    """Folder of the page; only files below it can be opened."""
    site: SitePart | None
    values: dict[str, Any]
    """Values in the site file, without defaults."""
    problems: list[ProblemPart]
    undo: str | None
    """Name of the edit that undo would revert."""
    redo: str | None
    network: NetworkPart | None
    plans: list[PlanSummary]
    """Newest first."""
    chosen: str | None
    job: JobPart | None
    """Search in progress, or the last one."""
    warm: bool
    """Whether the planner is loaded; it is compiled once, which takes a while."""
    saved: bool
    """Whether this state is saved in the site file."""
    save_error: str | None
    tabs: int
    """Number of browsers that follow the event stream."""
    uploaded: str | None = None
    """Name under which an upload was saved."""


class StaleAnswer(ErrorAnswer):
    """Response to a request for a site that has changed meanwhile."""

    workspace: WorkspaceAnswer | None = None


class FramePart(Answer):
    """Origin of local metres: the depot."""

    lat_deg: float
    lon_deg: float
    alt_m: float


class SegmentPart(Answer):
    """A span."""

    id: int
    name: str
    a: Place
    b: Place
    line: str
    length_m: float
    left_out: bool
    """Whether the site leaves the segment out."""
    unreachable: str | None
    """Reason why no flight can inspect the segment."""


class PylonPart(Answer):
    """A pylon."""

    name: str
    place: Place
    height_m: float | None
    elevation_m: float | None


class NetworkAnswer(Answer):
    """Network as read."""

    digest: str
    source: str
    format: str
    crs: str
    has_depot: bool
    frame: FramePart
    segments: list[SegmentPart]
    pylons: list[PylonPart]
    remarks: list[str]
    """Repairs and findings."""


class VehiclePadPart(Answer):
    """Pad of a vehicle."""

    vehicle: str
    place: Place


class BasePart(Answer):
    """A base of a day."""

    name: str
    place: Place
    vehicles: list[str]


class PlacePart(Answer):
    """A place of the site file."""

    name: str
    kind: Literal["pad", "alternate"]
    place: Place


class AreaPart(Answer):
    """No-fly area, or area with a height limit."""

    index: int
    """Index of its table in the site file."""
    name: str | None
    kind: Literal["no-fly", "corridor", "height-limit"]
    rings: list[list[Place]]
    margin_m: float | None
    from_file: bool


class FootprintPart(Answer):
    """Footprint of one picture in the middle of a span."""

    segment: int
    camera: str
    every_m: float
    ring: list[Place]


class GroundAnswer(Answer):
    """Surroundings of the network."""

    depot: Place | None
    pads: list[VehiclePadPart]
    bases: list[BasePart]
    places: list[PlacePart]
    alternates: list[PlacePart]
    areas: list[AreaPart]
    footprints: list[FootprintPart]


class VisitPart(Answer):
    """A span of a route."""

    segment: int
    reversed: bool
    """Whether it is flown from end b to end a."""
    from_s: float
    to_s: float


class RoutePart(Answer):
    """A sortie."""

    sortie: int
    day: int
    start_s: float
    duration_s: float
    energy_pct: float
    visits: list[VisitPart]
    track: list[tuple[float, float, float, float, float]]
    """Corners of the route: seconds (for days, from the first midnight), latitude, longitude, metres above the depot,
    battery percent."""


class VehiclePart(Answer):
    """A vehicle of a plan."""

    name: str
    budget_pct: float
    routes: list[RoutePart]
    profile: list[tuple[float, float, float | None]]
    """Height profile of the first sortie: metres flown, metres above the depot, and the ground's where a raster has
    it."""


class LeftPart(Answer):
    """Span that no vehicle flies."""

    segment: int
    name: str
    why: str


class PlanPart(Answer):
    """A plan in full."""

    summary: PlanSummary
    vehicles: list[VehiclePart]
    uncovered: list[LeftPart]
    windows: list[LossWindow]
    lines: list[str]
    """Lines that `faultline plan` prints."""


class LossAnswer(Answer):
    """Routes of the survivors after a loss."""

    routes: list[VehiclePart]
    """Routes of all survivors: flown until the loss, and new."""
    uncovered: list[LeftPart]
    recovered: int
    """Spans that the survivors take over."""
    complete: bool
    """Whether the re-plan covers every segment."""
    seconds: float
    """Duration of the re-plan."""


class ChangeAnswer(Answer):
    """Plan that was changed by hand."""

    plan: PlanPart
    violations: list[str]
    """Reasons why the changed plan cannot be flown."""
    window_was: float | None
    window_is: float


class JobAnswer(Answer):
    """Job that was started."""

    job: JobPart


class TryAnswer(Answer):
    """Result of listening for a vehicle."""

    answers: bool
    words: str


class FlightAnswer(Answer):
    """Flight that was started, or with `dry` the checklist."""

    model_config = ConfigDict(extra="allow")

    url: str | None = None
    """Address of the flight's page; it asks before take-off."""
    run: str | None = None
    """Run directory."""
    ready: bool | None = None
    checks: list[dict[str, Any]] | None = None


class FlightReportPart(Answer):
    """Result of a flight."""

    finished: bool
    inspected: int
    total: int
    uncovered: list[str]
    duration_s: float
    lost: list[str]


class FlightPart(Answer):
    """A flight of this folder."""

    run: str
    running: bool
    has_report: bool
    report: FlightReportPart | None


class FlightsAnswer(Answer):
    """The flights of this folder."""

    flights: list[FlightPart]
    """Newest first."""


class FilePart(Answer):
    """File that can be opened."""

    path: str
    kind: Literal["site", "network", "plan"]


class FilesAnswer(Answer):
    """The files that can be opened."""

    files: list[FilePart]

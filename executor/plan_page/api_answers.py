"""What the plan page's server answers, as its documentation has it; tests hold every answer against it."""

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
    """Why something was not done."""

    error: str
    """One line."""
    path: list[str | int] | None
    """The key of the site file that it is about, where there is one."""


class ProblemPart(Answer):
    """What is wrong with the site."""

    path: list[str | int] | None
    """The key that it is about, where that is known."""
    message: str
    """As the command line says it."""


class SitePart(Answer):
    """The site file."""

    path: str
    name: str
    text: str


class NetworkPart(Answer):
    """The network of the site."""

    digest: str
    """Another one where `GET /api/network` answers with something else."""
    segments: int


class PlanSummary(Answer):
    """A plan in a list."""

    id: str
    file: str | None
    """The file that is flown, of the chosen plan."""
    stale: bool
    """Whether the site says something else now than when it was made."""
    kind: Literal["flight", "day"]
    longest_s: float
    energy_pct: dict[str, float]
    """Of each vehicle; of days all its sorties together."""
    window_pct: float | None
    window_from_s: float | None
    breaking: BreakingLoss | None
    """The loss just before the window that has no re-plan."""
    uncovered: int
    """Segments that nobody flies."""
    cost: str
    """What it was chosen by."""
    value: float
    seconds: float
    """That the search took."""
    finish_s: float
    """When the last vehicle is home."""


class JobPart(Answer):
    """A search for plans."""

    id: str
    kind: Literal["plan", "front", "day", "left"]
    state: Literal["running", "done", "cancelled", "failed"]
    elapsed_s: float
    limit_s: float
    value: float | None
    """Of the best plan so far; null until there is one."""
    uncovered: int | None
    """Segments that it leaves out."""
    better_pct: float | None
    """By how much it is better than the first plan that left as few out."""
    since_s: float | None
    """When that one was found."""
    improved_s: float | None
    """When something better was found last."""
    error: str | None
    plans: list[str]
    """The ids of those that it made."""


class WorkspaceAnswer(Answer):
    """All that the page works on."""

    revision: int
    """Grows with every change of the site."""
    checked: int
    """The revision of which problems, network and ground are known; before that the problems are those of its keys."""
    folder: str
    """Where the page was started: files may be opened below it."""
    site: SitePart | None
    values: dict[str, Any]
    """What the site file says, without defaults."""
    problems: list[ProblemPart]
    undo: str | None
    """What would be undone."""
    redo: str | None
    network: NetworkPart | None
    plans: list[PlanSummary]
    """The newest first."""
    chosen: str | None
    job: JobPart | None
    """The search under way, or the last one."""
    warm: bool
    """Whether the planner is loaded: compiling it takes a while, once."""
    saved: bool
    """Whether the site file says the same."""
    save_error: str | None
    tabs: int
    """Browsers that follow the stream."""
    uploaded: str | None = None
    """After an upload: the name that the file was kept under."""


class StaleAnswer(ErrorAnswer):
    """The site is another one by now."""

    workspace: WorkspaceAnswer | None = None


class FramePart(Answer):
    """Where local metres begin: the depot."""

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
    """By the site."""
    unreachable: str | None
    """Why no flight can inspect it."""


class PylonPart(Answer):
    """A pylon."""

    name: str
    place: Place
    height_m: float | None
    elevation_m: float | None


class NetworkAnswer(Answer):
    """The network as it was understood."""

    digest: str
    source: str
    format: str
    crs: str
    has_depot: bool
    frame: FramePart
    segments: list[SegmentPart]
    pylons: list[PylonPart]
    remarks: list[str]
    """What was mended or found."""


class VehiclePadPart(Answer):
    """Where a vehicle stands."""

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
    """An area that flights keep out of, or low in."""

    index: int
    """Of its table in the site file."""
    name: str | None
    kind: Literal["no-fly", "corridor", "height-limit"]
    rings: list[list[Place]]
    margin_m: float | None
    from_file: bool


class FootprintPart(Answer):
    """What one picture in the middle of a span shows."""

    segment: int
    camera: str
    every_m: float
    ring: list[Place]


class GroundAnswer(Answer):
    """What lies around the network."""

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
    """From its b to its a."""
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
    """Corners of the way, straight between: seconds, latitude, longitude, metres up from the depot, battery in percent.
    Of days seconds from the first midnight."""


class VehiclePart(Answer):
    """A vehicle of a plan."""

    name: str
    budget_pct: float
    routes: list[RoutePart]
    profile: list[tuple[float, float, float | None]]
    """Of its first sortie: metres flown, metres up from the depot, and the ground's, where a raster knows it."""


class LeftPart(Answer):
    """A span that nobody flies."""

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
    """What `faultline plan` prints of it."""


class LossAnswer(Answer):
    """What the others would fly."""

    routes: list[VehiclePart]
    """Of everybody: what was flown by then and what is new; nothing of the lost one."""
    uncovered: list[LeftPart]
    recovered: int
    """Spans of the lost vehicle that others take."""
    complete: bool
    """Whether everything is inspected."""
    seconds: float
    """That the answer took."""


class ChangeAnswer(Answer):
    """A plan that was changed by hand."""

    plan: PlanPart
    violations: list[str]
    """Why it cannot be flown."""
    window_was: float | None
    window_is: float


class JobAnswer(Answer):
    """What was begun."""

    job: JobPart


class TryAnswer(Answer):
    """Whether a vehicle was heard."""

    answers: bool
    words: str


class FlightAnswer(Answer):
    """A flight that was started, or with `dry` the checklist."""

    model_config = ConfigDict(extra="allow")

    url: str | None = None
    """Of its page, which asks before anything takes off."""
    run: str | None = None
    """Its run directory."""
    ready: bool | None = None
    checks: list[dict[str, Any]] | None = None


class FlightReportPart(Answer):
    """What a flight came to."""

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
    """The newest first."""


class FilePart(Answer):
    """A file that can be opened."""

    path: str
    kind: Literal["site", "network", "plan"]


class FilesAnswer(Answer):
    """The files that can be opened."""

    files: list[FilePart]

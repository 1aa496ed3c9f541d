"""The index as rows: every picture that is known, and what every asset asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

from executor.core.context import Context
from executor.core.imaging.asset_status import describe_unseen_parts
from executor.core.payload.camera_state import Picture
from executor.core.state.fleet_state import FleetState
from missions.cameras import CameraTasks, Trigger


@dataclass(frozen=True, slots=True)
class ImageRow:
    """One picture."""

    asset: str
    """The span that it shows, by its name; empty where it shows none that asks for it."""
    segment: int | None
    viewpoint: str
    """Where along the span it was taken, from its first pylon; at a pylon of which of its viewpoints it is."""
    vehicle: str
    camera: str
    sequence: int
    unix_s: float
    """When, by the ground station's clock; in a simulation that runs faster, by the flight's own seconds."""
    camera_unix_s: float | None
    """When, by the camera's own clock, where it said that."""
    lat_deg: float
    lon_deg: float
    alt_msl_m: float
    alt_rel_m: float
    pitch_deg: float | None
    yaw_deg: float | None
    speed_m_s: float
    proof: str
    """Which message says that it was taken."""
    file: str
    """How the camera calls it, where it said that."""
    flaw: str
    """Why it does not count; empty if it does."""

    @property
    def time_iso(self) -> str:
        """Return when it was taken, as ISO 8601 in UTC."""
        return datetime.fromtimestamp(self.unix_s, UTC).isoformat(timespec="milliseconds")


@dataclass(frozen=True, slots=True)
class AssetRow:
    """What one span asked of one camera, and what became of it."""

    asset: str
    segment: int
    camera: str
    take: str
    """pictures, video, or how many viewpoints."""
    every_m: float
    state: str
    """seen, not seen or not flown."""
    vehicle: str
    """Who has seen it; empty if nobody has."""
    pictures: int
    """How many count; at a pylon, how many viewpoints have one."""
    missing: str
    """What no picture shows, in words."""
    line: tuple[tuple[float, float], tuple[float, float]]
    """Latitude and longitude of both pylons."""


def build_image_rows(context: Context, state: FleetState, began_unix_s: float) -> list[ImageRow]:
    """Return all pictures of a flight, in the order of time.

    Args:
        context: Of the flight.
        state: At its end, or before.
        began_unix_s: Seconds since 1970 at which its log's time is 0.
    """
    rows = [
        _build_image_row(context, name, picture, began_unix_s)
        for name, vehicle in state.vehicles.items()
        for picture in vehicle.payload.pictures
    ]
    return sorted(rows, key=lambda row: (row.unix_s, row.vehicle, row.sequence))


def _build_image_row(context: Context, vehicle: str, picture: Picture, began_unix_s: float) -> ImageRow:
    return ImageRow(
        asset="" if picture.segment is None else context.segment_name(picture.segment),
        segment=picture.segment,
        viewpoint=_describe_viewpoint(picture),
        vehicle=vehicle,
        camera=picture.camera,
        sequence=picture.sequence,
        unix_s=began_unix_s + picture.at_s,
        camera_unix_s=picture.unix_s,
        lat_deg=picture.lat_deg,
        lon_deg=picture.lon_deg,
        alt_msl_m=picture.alt_msl_m,
        alt_rel_m=picture.alt_rel_m,
        pitch_deg=picture.pitch_deg,
        yaw_deg=picture.yaw_deg,
        speed_m_s=picture.speed_m_s,
        proof=picture.source.value,
        file=picture.file,
        flaw=picture.flaw,
    )


def _describe_viewpoint(picture: Picture) -> str:
    if picture.points:
        return f"viewpoint {', '.join(str(number + 1) for number in picture.points)}"
    return "" if picture.along_m is None else f"{picture.along_m:.1f} m"


def build_asset_rows(context: Context, state: FleetState) -> list[AssetRow]:
    """Return what every span of this flight asked for, and what became of it."""
    return list(_generate_asset_rows(context, state, context.setup.looks))


def _generate_asset_rows(context: Context, state: FleetState, looks: CameraTasks) -> Iterator[AssetRow]:
    network, past = context.setup.network, {one.segment for one in state.coverage.not_seen}
    for segment in sorted(context.wanted & {*looks.spans, *looks.pylons}):
        by = state.coverage.inspected.get(segment, "")
        lacks = describe_unseen_parts(context, state, segment)
        caught = state.coverage.caught.get(segment, ())
        ends = [network.pylons[end] for end in (network.segments[segment].a, network.segments[segment].b)]
        first, last = ((pylon.lat_deg, pylon.lon_deg) for pylon in ends)
        pylon = looks.pylons.get(segment)
        asked = [] if pylon is None else [(pylon.camera, f"{len(pylon.points)} viewpoints", 0.0)]
        asked += [
            (look.camera, "video" if look.trigger is Trigger.VIDEO else "pictures", look.every_m)
            for look in looks.spans.get(segment, ())
        ]
        for camera, take, every_m in asked:
            yield AssetRow(
                asset=context.segment_name(segment),
                segment=segment,
                camera=camera,
                take=take,
                every_m=every_m,
                state="seen" if by else "not seen" if caught or segment in past else "not flown",
                vehicle=by,
                pictures=sum(one == camera for one, _ in (caught if pylon is None else set(caught))),
                missing="; ".join(words for words in lacks if words.startswith(f"{camera} ")),
                line=(first, last),
            )

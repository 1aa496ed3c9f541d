"""Moments of a flight as the page shows them, made up so that each can be looked at: no vehicle flies.

`python -m tests.e2e.gallery DIR [SCENE...]` writes a picture of each at the widths of a desk and of a phone; scenes
of the plan page, `plan-...`, stand in `plan_scenes.py`.
"""

from __future__ import annotations

import asyncio
import math
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Self

from playwright.async_api import Page

from executor.adapters.web.page_server import WebSettings
from executor.adapters.web.server import WebServer
from executor.core.context import Context
from executor.core.fleet_view import (
    FleetView,
    LossView,
    OfferView,
    PlaceView,
    RadioView,
    TakenView,
    VehicleView,
    build_fleet_view,
)
from executor.core.interface.codes import ChannelCode, Check, CheckCode, Severity
from executor.core.interface.commands import Level
from executor.core.interface.intents import Action, Intent, IntentRecord, Outcome
from executor.core.interface.messages import Gps, Wind
from executor.core.interface.ports import LinkView
from executor.core.payload.camera_state import AwaitedPictures
from executor.core.state.fleet_state import Briefing, FleetState, OperatorLine, Question
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_state import Stage, VehicleState, build_onboard_mission
from executor.site import site_model
from executor.site.ground_view import GroundView, encode_ground
from missions import Segment, Window, build_flight_path
from tests.e2e.browser import DESK, browsing
from tests.executor.builders import ground_for, site_of, with_facts
from tests.fakes.flight import Story
from tests.missions.builders import network_of

PLACES_M = [(90.0, -20.0), (190.0, 10.0), (290.0, 70.0), (395.0, 90.0), (500.0, 85.0), (600.0, 120.0), (300.0, 175.0)]
PAIRS = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (2, 6)]
ROUTES: Mapping[str, tuple[int, ...]] = {"uav1": (0, 2), "uav2": (4, 6), "uav3": (8, 10)}
LAYOUTS = {"desk": DESK, "phone": (390, 844)}
SECOND = "uav2 is with its pilot, who would lose it to a landing where it is. Land it all the same?"

CHECKS = (
    Check(Severity.OK, "heights", "over the ground of the network file", CheckCode.HEIGHTS),
    Check(Severity.OK, "disk", "41.2 GB free, the record of a flight like this takes about 6 MB", CheckCode.DISK),
    Check(Severity.OK, "separation", "any two vehicles stay at least 5 m apart", CheckCode.SEPARATION),
    Check(Severity.OK, "uav1", "quadrotor, ArduPilot 4.6.1", CheckCode.FIRMWARE),
    Check(Severity.OK, "uav1", "battery 98 %, flight 4.2 min and 21 %, lands with 77 %", CheckCode.ENERGY),
    Check(
        Severity.WARNING,
        "uav2",
        "no battery failsafe (BATT_FS_LOW_ACT=0): on an empty battery it keeps flying until it falls",
        CheckCode.BATTERY_FAILSAFE,
    ),
    Check(Severity.OK, "uav2", "battery 97 %, flight 5.0 min and 25 %, lands with 72 %", CheckCode.ENERGY),
    Check(Severity.OK, "uav3", "battery 95 %, flight 5.9 min and 29 %, lands with 66 %", CheckCode.ENERGY),
)
STOPPED = Check(
    Severity.STOP,
    "uav3",
    "its geofence ends 30 m high (FENCE_ALT_MAX), but its flight goes 41 m high",
    CheckCode.GEOFENCE,
)


@dataclass(frozen=True, slots=True)
class Fleet:
    """A fleet over a line whose spans have names."""

    context: Context
    boards: dict[str, OnboardMission | None]


def fleet(
    places_m: Sequence[tuple[float, float]] = PLACES_M, pairs: Sequence[tuple[int, int]] = PAIRS, **tables: Any
) -> Fleet:
    """Return three vehicles over six spans, P41-P42 and so on; with what else the site file has."""
    plain = network_of(list(places_m), list(pairs))
    segments = tuple(Segment(one.id, one.a, one.b, f"P{41 + one.a}-P{41 + one.b}") for one in plain.segments)
    ground = ground_for(site_of(tuple(ROUTES), **tables), replace(plain, segments=segments, source="gallery"))
    setup, task = ground.setup, site_model.build_first_task(ground)
    context = site_model.build_context(ground, setup, task)
    boards: dict[str, OnboardMission | None] = {
        name: build_onboard_mission(context, name, 0, build_flight_path(setup, name, visits), visits)
        for name, visits in ROUTES.items()
    }
    return Fleet(context, boards)


Touch = Callable[[VehicleView], VehicleView]


@dataclass(frozen=True, slots=True)
class Scene:
    """One moment, and the words that must be read in it."""

    context: Context
    state: FleetState
    now_s: float
    words: Mapping[str, str]
    """What a place of the page, by its selector, must say."""
    touch: Mapping[str, Touch] = field(default_factory=dict)
    offer: OfferView | None = None
    radios: tuple[RadioView, ...] = ()

    def view(self, state: FleetState, now_s: float) -> FleetView:
        """Describe it: all but the clock stands still."""
        still = build_fleet_view(self.context, state, self.now_s)
        flight_s = None if still.flight_s is None else round(still.flight_s + now_s - self.now_s, 2)
        vehicles = tuple(self.touch.get(one.name, _same)(one) for one in still.vehicles)
        return replace(
            still, now_s=round(now_s, 2), flight_s=flight_s, vehicles=vehicles, offer=self.offer, radios=self.radios
        )


def _same(vehicle: VehicleView) -> VehicleView:
    return vehicle


def fitted(state: FleetState) -> FleetState:
    """Return the state with what vehicles say of their GPS, their voltage and the wind."""
    for number, vehicle in enumerate(state.vehicles.values()):
        volts = replace(vehicle.power.volts, voltage_v=16.2 - 0.2 * number)
        known = replace(vehicle.sensors.positioning, fixed=vehicle.motion.fix, accuracy_m=1.2)
        facts = {"gps": Gps(3, 14 + number), "wind": Wind(4.2 + number, 240.0), "volts": volts, "positioning": known}
        state = state.put(with_facts(vehicle, **facts))
    return state


def _eta(seconds: float) -> Touch:
    return lambda vehicle: replace(vehicle, lands_in_s=seconds, loss=LossView(True, (), 4.0))


def before(ready: Fleet, *, asked: str = "take-off", stop: bool = False) -> Scene:
    """Before the take-off: the checklist and a question, or what stops the flight."""
    story = Story(ready.context, dict(ready.boards))
    for name in story.crafts:
        story.crafts[name].battery_pct = {"uav1": 98.0, "uav2": 97.0, "uav3": 95.0}[name]
    story.pass_s(1.2)
    questions = {
        "prepare": Question(
            "prepare", "Change 3 parameters and put 3 missions on board?",
            ("uav1: RTL_ALT 15 m to 45 m: its own return keeps clear of the others",
             "uav2: RTL_ALT 15 m to 50 m, the same", "uav3: RTL_ALT 82 m to 55 m, the same"),
        ),
        "take-off": Question(
            "take-off", "All missions are on board, verified by read-back. Take off?",
            ("uav1, uav2 and uav3 take off from their pads", "back in 5.9 min, 66 % left at the least"),
        ),
    }  # fmt: skip
    checks = (*CHECKS, STOPPED) if stop else CHECKS
    briefing = Briefing(checks, None if stop else questions[asked])
    lines = (
        OperatorLine(1.0, Level.INFO, "waiting for 3 vehicles"),
        OperatorLine(6.0, Level.INFO, "uav1: ready, quadrotor, ArduPilot 4.6.1, battery 98 %"),
        OperatorLine(8.0, Level.WARNING, "uav2: no battery failsafe"),
    )
    state = with_facts(fitted(story.state), briefing=briefing, said=lines)
    words = {
        "#clock": "before take-off",
        "#asked": "No question: a check stops the flight" if stop else questions[asked].text,
        "#checks": "1 check stops the flight" if stop else "1 warning",
        ".strip:nth-child(1) .figures": "98 %",
        ".strip:nth-child(1) .gps": "GPS 3D, 14 sat",
    }
    return Scene(ready.context, state, story.now_s, words)


def flown(ready: Fleet) -> Story:
    """Return a flight under way."""
    story = Story(ready.context, dict(ready.boards))
    story.launch()
    story.run(lambda: story.inspecting("uav2", 2))
    return story


ETAS: Mapping[str, Touch] = {"uav1": _eta(96.0), "uav2": _eta(187.0), "uav3": _eta(252.0)}


def flying(ready: Fleet) -> Scene:
    """Everybody flies."""
    story = flown(ready)
    words = {
        "#clock": "T+",
        ".strip:nth-child(2) .eta": "lands in 3:07",
        ".strip:nth-child(2) .route": "inspects P43-P44",
        ".strip:nth-child(2) .wind": "5.2 m/s from WSW",
        ".strip:nth-child(2) .volts": "16.0 V",
        ".strip:nth-child(3) .place": "49.60",
        "#lines": "T+0:",
    }
    return Scene(ready.context, fitted(story.state), story.now_s, words, ETAS)


def with_span_left_out() -> Fleet:
    """Return the same with a seventh span, which the site leaves out."""
    return fleet([*PLACES_M, (690.0, 40.0)], [*PAIRS, (5, 7)], network={"file": "line", "leave_out": ["P46-P48"]})


def left_out(ready: Fleet) -> Scene:
    """Everybody flies, and a span is none of this flight."""
    story = flown(ready)
    words = {"#legend-out": "left out", "#count": "of 6"}
    return Scene(ready.context, fitted(story.state), story.now_s, words, ETAS)


def congested(ready: Fleet) -> Scene:
    """All fly behind one radio that carries no more, and one has LTE as well."""
    story = flown(ready)
    links = (
        LinkView("serial:///dev/ttyUSB0:57600", 4.2, 0.31, used=False),
        LinkView("udpin://0.0.0.0:14550", 0.2, 0.0, used=True),
    )
    radio = RadioView(
        tuple(ROUTES), "congested", ChannelCode.BUFFER_FULL, "1.4 of 1.5 kB/s, round trip 2.4 s, 6 % lost", 1400.0,
        1500.0, 2.4, 0.06, 1.0,
    )  # fmt: skip
    words = {
        "#radios": "radio of uav1, uav2, uav3: congested, 1.4 of 1.5 kB/s",
        ".strip:nth-child(2) .links": "udpin://0.0.0.0:14550",
    }
    return Scene(
        ready.context, fitted(story.state), story.now_s, words,
        {**ETAS, "uav2": lambda vehicle: replace(ETAS["uav2"](vehicle), links=links)}, radios=(radio,),
    )  # fmt: skip


def reckoned(ready: Fleet) -> Scene:
    """One flies on without GPS: where it was with a fix comes first, the rest is long."""
    story = flown(ready)

    def touch(vehicle: VehicleView) -> VehicleView:
        now = vehicle.position
        assert now is not None
        last = PlaceView(now.lat_deg, now.lon_deg, now.relative_alt_m, 12.0, 104.0, 2.5)
        return replace(vehicle, gps_fix=0, position=replace(now, known="reckoned", accuracy_m=1250.0, last_fix=last))

    words = {
        ".strip:nth-child(2) .when": "Last GPS fix",
        ".strip:nth-child(2) .since": "1:44 ago, at 12 m/s; now about 49.60",
        ".strip:nth-child(2) .gps": "no GPS",
    }
    return Scene(ready.context, fitted(story.state), story.now_s, words, {**ETAS, "uav2": touch})


def taken(ready: Fleet, *, returned: bool = False) -> Scene:
    """A pilot has taken one, and has maybe put it back on its mission."""
    story = flown(ready)
    since_s = story.now_s - 6.0
    hands = TakenView(since_s, 0.0 if returned else 24.0, returned)

    def touch(vehicle: VehicleView) -> VehicleView:
        mode = "AUTO" if returned else "LOITER"
        return replace(vehicle, state="pilot", mode=mode, taken=hands, loss=None, lands_in_s=None)

    line = OperatorLine(
        since_s, Level.WARNING, "uav2: its pilot took it (LOITER); nothing is commanded; its segments are kept for 30 s"
    )
    state = with_facts(fitted(story.state), said=(*story.state.crew.said, line))
    words = {
        ".strip:nth-child(2) .state": "with its pilot",
        ".strip:nth-child(2) .hands": "include it to continue" if returned else "Its segments are kept for it for 0:24",
        ".strip:nth-child(2) .place": "49.60",
        "#lines": "its pilot took it",
    }
    return Scene(ready.context, state, story.now_s, words, {**ETAS, "uav2": touch})


def offered(ready: Fleet) -> Scene:
    """One is lost, and one that has landed could take over."""
    story = flown(ready)
    story.crafts["uav3"].mute = True
    story.run(lambda: story.vehicle("uav3").fault is not None)
    story.pass_s(4.0)

    def landed(vehicle: VehicleView) -> VehicleView:
        return replace(vehicle, offered=True, progress=replace(vehicle.progress, done=3, total=3))

    offer = OfferView(("uav1",), (4, 5), "uav1 can take over 2 spans (P45-P46, P43-P47). Is its pad clear of people?")
    line = OperatorLine(story.now_s, Level.WARNING, offer.text)
    home = story.vehicle("uav1")
    assert home.motion.fix is not None
    assert home.telemetry.heartbeat is not None
    fix = replace(
        home.motion.fix, place_m=ready.context.vehicles["uav1"].pad_m, alt_rel_m=0.0, velocity_m_s=(0.0, 0.0, 0.0)
    )
    home = with_facts(home, stage=Stage.LANDED, fix=fix, heartbeat=replace(home.telemetry.heartbeat, armed=False))
    state = with_facts(fitted(story.state.put(home)), said=(*story.state.crew.said, line))
    words = {
        "#offered": "uav1 can take over 2 spans",
        "#takers": "uav1: pad is clear",
        ".strip:nth-child(1) .offered": "can take off",
        ".strip:nth-child(3) .state": "lost",
        ".strip:nth-child(3) .place": "49.60",
    }
    return Scene(ready.context, state, story.now_s, words, {**ETAS, "uav1": landed, "uav3": _eta_none}, offer)


def _eta_none(vehicle: VehicleView) -> VehicleView:
    return replace(vehicle, lands_in_s=None)


def down(ready: Fleet) -> Scene:
    """One lies on the ground, armed, off its pad."""
    story = flown(ready)
    state = fitted(story.state)
    vehicle: VehicleState = state.vehicles["uav2"]
    assert vehicle.motion.fix is not None
    place = replace(vehicle.motion.fix, alt_rel_m=0.4, velocity_m_s=(0.0, 0.0, 0.0))
    lat_deg, lon_deg = ready.context.frame.to_wgs84_deg(*place.place_m)
    reason = f"down at {lat_deg:.6f}, {lon_deg:.6f}, armed: keep away"
    line = OperatorLine(story.now_s, Level.FAULT, f"uav2: {reason}")
    state = with_facts(state.put(with_facts(vehicle, fix=place)), said=(*state.crew.said, line))

    def fell(vehicle: VehicleView) -> VehicleView:
        progress = replace(vehicle.progress, phase=None, segment=None, segment_name=None, segment_share=None)
        battery = replace(vehicle.battery, landing_pct=None, landing_band_pct=None)
        return replace(
            vehicle,
            state="down",
            fault=reason,
            fault_kind="down",
            loss=None,
            lands_in_s=None,
            progress=progress,
            battery=battery,
        )

    words = {
        ".strip:nth-child(2) .state": "down: keep away",
        ".strip:nth-child(2) .where": "ARMED",
        ".strip:nth-child(2) .place": f"{lat_deg:.5f}, {lon_deg:.5f}",
        ".strip:nth-child(2) .actions": "Disarm",
    }
    return Scene(ready.context, state, story.now_s, words, {**ETAS, "uav2": fell})


CAMERA: Mapping[str, object] = {"name": "rgb", "id": 100, "gimbal": True}
SPANS: Mapping[str, object] = {"camera": "rgb", "every_m": 10}
AROUND: Mapping[str, object] = {
    "camera": "rgb", "of": "pylons", "pylons": ["p1", "p3"], "bearings_deg": [60, 120], "both_sides": True,
}  # fmt: skip


def sighted() -> Fleet:
    """Return the same with a camera: eight assets, two of them pylons with four viewpoints each."""
    return fleet(camera=[CAMERA], look=[SPANS, AROUND])


def pictures(ready: Fleet) -> Scene:
    """Some assets are seen, some were flown and are not."""
    story = flown(fleet())  # it has no camera that could fail
    now_s = story.now_s
    facts = {
        "inspected": {0: "uav1", 6: "uav1"},
        "inferred": frozenset({6}),
        "caught": {
            0: tuple(("rgb", 10.0 * number) for number in range(11)),
            1: (("rgb", 5.0), ("rgb", 15.0), ("rgb", 60.0)),
            2: (("rgb", 5.0), ("rgb", 15.0)),
            6: tuple(("rgb", float(number)) for number in range(4)),
            7: (("rgb", 0.0), ("rgb", 3.0)),
        },
        "unseen": {1: AwaitedPictures("uav1", now_s - 2.0)},
        "not_seen": {7: "uav3", 5: "uav2"},
        "given_up": frozenset({5}),
    }
    text = "uav3: pylon p3 flown, but pictures are missing: rgb has no picture from viewpoint 2, 3"
    line = OperatorLine(now_s, Level.WARNING, text)
    state = with_facts(fitted(story.state), **facts, said=(*story.state.crew.said, line))
    words = {
        "#assets-what": "Assets",
        "#tally": "2 of 8 seen",
        "#tally-missed": "3 missed",
        "#legend-missed": "missed",
        "#lines": "pylon p3 flown, but pictures are missing",
    }
    return Scene(ready.context, state, now_s, words, ETAS)


def many_assets(ready: Fleet) -> Scene:
    """A line of a thousand spans, of which some are missed."""
    story = flown(long_line())
    missed = dict.fromkeys(range(100, 1000, 97), "uav1")
    seen = dict.fromkeys(range(6, 95), "uav2")
    state = with_facts(fitted(story.state), inspected=seen, not_seen=missed)
    words = {"#tally": f"{len(seen)} of 1000 seen", "#tally-missed": f"{len(missed)} missed"}
    return Scene(ready.context, state, story.now_s, words, ETAS)


def long_line(**tables: Any) -> Fleet:
    """Return the same vehicles over a thousand spans."""
    places = [(90.0 + 35.0 * index, 60.0 * math.sin(index / 9)) for index in range(1001)]
    return fleet(places, [(index, index + 1) for index in range(1000)], **tables)


SCENES: Mapping[str, Callable[[Fleet], Scene]] = {
    "before-prepare": partial(before, asked="prepare"),
    "before-take-off": before,
    "before-stop": partial(before, stop=True),
    "flying": flying,
    "left-out": left_out,
    "one-radio": congested,
    "gps-lost": reckoned,
    "takeover": taken,
    "takeover-returned": partial(taken, returned=True),
    "offer": offered,
    "down": down,
    "pictures": pictures,
    "pictures-many": many_assets,
}
FLEETS: Mapping[str, Callable[[], Fleet]] = {
    "left-out": with_span_left_out,
    "pictures": sighted,
    "pictures-many": partial(long_line, camera=[CAMERA], look=[SPANS]),
}
"""Of scenes that are not of the line without cameras."""


@cache
def scene_of(name: str) -> Scene:
    """Return one moment."""
    return SCENES[name](FLEETS.get(name, fleet)())


class Shown:
    """A server that shows one scene, on a clock that runs, and keeps what it was asked."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.asked: list[Intent] = []
        self.began_s = time.monotonic()

    def now(self) -> tuple[FleetState, float]:
        now_s = self.scene.now_s + time.monotonic() - self.began_s
        return with_facts(self.scene.state, tick_s=now_s), now_s

    def submit(self, intent: Intent) -> Future[IntentRecord]:
        """Take every intent; a landing asks a second time."""
        self.asked.append(intent)
        answer: Future[IntentRecord] = Future()
        twice = intent.action in {Action.LAND, Action.DISARM} and not intent.confirmed
        outcome = Outcome.REFUSED if twice else Outcome.ACCEPTED
        question = SECOND if twice else ""
        answer.set_result(IntentRecord(intent, outcome, question or "asked for", self.now()[1], question=question))
        return answer

    def describe(self, context: Context, state: FleetState, now_s: float) -> FleetView:
        assert context is self.scene.context
        return self.scene.view(state, now_s)

    @contextmanager
    def serving(self, ground: GroundView | None = None, window: Window | None = None) -> Iterator[str]:
        """Serve it, over a ground if one is given; yields the address."""
        files = {} if ground is None else encode_ground(ground, self.scene.context.frame)
        settings = WebSettings("127.0.0.1", 0, None, ground=files, window=window)
        server = WebServer(settings, self.scene.context, self.now, self.submit, self.describe)
        with server:
            yield server.address


class Line:
    """A connection between a browser and the server that can be held up, as far as states go, or cut."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._ends: list[asyncio.StreamWriter] = []
        self.address = ""
        self.free = asyncio.Event()
        """Cleared while no state comes through; everything else does."""
        self.free.set()
        self._cut = False

    @classmethod
    @asynccontextmanager
    async def to(cls, address: str) -> AsyncIterator[Self]:
        """Pass on whatever comes for a server."""
        line = cls(int(address.rstrip("/").rpartition(":")[2]))
        server = await asyncio.start_server(line._pass, "127.0.0.1", 0)
        line.address = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}/"
        try:
            yield line
        finally:
            line.cut()
            server.close()

    def cut(self) -> None:
        """Let nothing through any more."""
        self._cut = True
        self.free.set()
        for end in self._ends:
            end.close()

    async def _pass(self, browser: asyncio.StreamReader, to_browser: asyncio.StreamWriter) -> None:
        if self._cut:
            to_browser.close()
            return
        server, to_server = await asyncio.open_connection("127.0.0.1", self._port)
        self._ends += [to_browser, to_server]
        asked = bytearray()

        async def there() -> None:
            while block := await browser.read(65536):
                asked.extend(block)
                to_server.write(block)
            to_server.close()

        async def back() -> None:
            while block := await server.read(65536):
                if b"GET /events" in asked:
                    await self.free.wait()
                to_browser.write(block)
            to_browser.close()

        await asyncio.gather(there(), back(), return_exceptions=True)


async def _open_list(page: Page) -> None:
    """Show the list of assets with one chosen, where there are pictures to look after."""
    if await page.locator("#tally-missed").inner_text():
        if not await page.locator("#assets").evaluate("one => one.open"):
            await page.locator("#assets summary").click()
        await page.locator(".asset .pick").first.click()
        await page.wait_for_timeout(900.0)


async def _draw(folder: Path, wanted: Sequence[str] = ()) -> None:
    from tests.e2e.plan_scenes import PLAN_SCENES, draw_plan_scene

    for name in wanted or (*SCENES, *PLAN_SCENES):
        if name in PLAN_SCENES:
            await draw_plan_scene(folder, name)
            continue
        with Shown(scene_of(name)).serving() as address:
            for layout, size in LAYOUTS.items():
                async with browsing(address, size) as page:
                    await page.locator(".strip").nth(2).wait_for()
                    await page.wait_for_timeout(700.0)
                    await _open_list(page)
                    await page.screenshot(path=str(folder / f"{name}-{layout}.png"), full_page=layout == "phone")
    for name, held in () if wanted else (("behind", True), ("dead", False)):
        await _draw_stale(folder, name, held=held)


async def _draw_stale(folder: Path, name: str, *, held: bool) -> None:
    for layout, size in LAYOUTS.items():
        with Shown(scene_of("flying")).serving() as address:
            async with Line.to(address) as line, browsing(line.address, size) as page:
                await page.locator(".strip").nth(2).wait_for()
                await page.wait_for_timeout(2500.0)
                if held:
                    line.free.clear()
                else:
                    line.cut()
                await page.wait_for_timeout(9000.0)
                await page.screenshot(path=str(folder / f"{name}-{layout}.png"))


if __name__ == "__main__":
    asyncio.run(_draw(Path(sys.argv[1]), sys.argv[2:]))

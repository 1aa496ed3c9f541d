"""What really happened in a story: the yardstick, with who had whom, and who could be heard."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace

from executor.core.interface.events import IntentReceived
from executor.core.interface.intents import Action, Outcome
from simulator.autopilot import LAST_WORDS_S
from simulator.fault_kinds import InjectionKind, parse_fault
from simulator.truth import Truth
from tests.stories.story import MISSION
from tests.stories.world import Flown

OURS = 255
KNOWS_S = 1.5
"""Until a change on board is known on the ground, and what was on its way has arrived."""
ON_PAD_M = 6.0
FALLS_FROM_M = 2.0
"""Who stops lower than this stands where it was."""
HARMLESS = frozenset({"401", "410", "510", "511", "512", "520", "42428"})
"""Commands that ask for messages and reasons, and move nothing."""
EARTH_M_DEG = 111_195.0


@dataclass(frozen=True, slots=True)
class Span:
    """A time in which a vehicle was in a state of its own."""

    from_s: float
    to_s: float
    what: str


def distance_m(one: tuple[float, float], two: tuple[float, float]) -> float:
    """Return how far two places on the globe are apart; near enough over a few kilometres."""
    north = (one[0] - two[0]) * EARTH_M_DEG
    east = (one[1] - two[1]) * EARTH_M_DEG * math.cos(math.radians(one[0]))
    return math.hypot(north, east)


def place(truth: Truth) -> tuple[float, float]:
    """Return where the vehicle was."""
    assert truth.lat_deg is not None
    assert truth.lon_deg is not None
    return truth.lat_deg, truth.lon_deg


class Record:
    """One story's flight, as it really was."""

    on_pad_m = ON_PAD_M

    def __init__(self, flown: Flown) -> None:
        self.flown = flown
        self.end_s = flown.given_up_s
        self.names = tuple(flown.sysids)
        self._of = {
            name: tuple(sorted((one for one in flown.truths if one.vehicle == name), key=lambda one: one.t_s))
            for name in self.names
        }
        self._events = {name: tuple(one for one in of if one.what != "at") for name, of in self._of.items()}
        self._times = {name: [one.t_s for one in of] for name, of in self._of.items()}
        self._found: dict[tuple[str, ...], list[Truth]] = {}
        self._asked = tuple((at_s, event.intent) for at_s, event in flown.log if isinstance(event, IntentReceived))
        self._refused = {record.intent.id for record in flown.intents if record.outcome is Outcome.REFUSED}

    def happened(self, name: str, *prefixes: str) -> list[Truth]:
        """Return a vehicle's truths that begin so."""
        key = (name, *prefixes)
        if key not in self._found:
            self._found[key] = [one for one in self._events[name] if one.what.startswith(prefixes)]
        return self._found[key]

    def orders(self, name: str) -> list[Truth]:
        """Return what this ground station commanded after the launch."""
        return [
            one
            for one in self.happened(name, "order ")
            if one.sender == OURS
            and one.t_s >= self.flown.began_s
            and not (one.what.startswith("order command ") and one.what.split()[2] in HARMLESS)
        ]

    def hands(self, name: str) -> list[Span]:
        """Return when somebody else had it: from the takeover until it was returned and the crew took it back."""
        mission, auto = MISSION[self.flown.autopilot]["mission"], self._returned_suffices()
        happened = [(one.t_s, one.what) for one in self._by_others(name)]
        happened += [(at_s, "included") for at_s in (*self._included(name), *self._taken_back(name))]
        spans: list[Span] = []
        taken: tuple[float, str] | None = None
        for at_s, what in sorted(happened):
            back = what.endswith(f" {mission}")
            if taken is None and not back and what != "included":
                taken = (at_s, what)
            elif taken is not None and (what == "included" or (back and auto)):
                spans.append(Span(taken[0], at_s, taken[1]))
                taken = None
        return [*spans, Span(taken[0], self.end_s, taken[1])] if taken is not None else spans

    def _by_others(self, name: str) -> list[Truth]:
        """Return what others did to it; who chooses the mode that is flown already does nothing that is to be seen."""
        modes = [one.t_s for one in self.happened(name, "mode ")]
        return [
            one
            for one in self.happened(name, "pilot ", "station ", "kill")
            if one.what == "kill" or any(0 <= at_s - one.t_s < 0.1 for at_s in modes)
        ]

    def _taken_back(self, name: str) -> list[float]:
        """Return when the crew took it out of its pilot's hands, asked twice."""
        commands = {Action.HOLD, Action.RESUME, Action.RETURN, Action.LAND}
        return [
            at_s
            for at_s, intent in self._asked
            if intent.action in commands
            and intent.vehicle == name
            and intent.confirmed
            and intent.id not in self._refused
        ]

    def _returned_suffices(self) -> bool:
        return self.flown.story.tables.get("flight", {}).get("pilot_return") == "auto"

    def _included(self, name: str) -> list[float]:
        """Return when the crew took a vehicle back into the plan."""
        return [
            at_s
            for at_s, intent in self._asked
            if intent.action is Action.INCLUDE and intent.vehicle == name and intent.id not in self._refused
        ]

    def silences(self, name: str) -> list[Span]:
        """Return when nothing came from it."""
        spans: list[Span] = []
        for one in self.happened(name, "fault "):
            fault = parse_fault(one.what.removeprefix("fault "))
            if fault.kind is InjectionKind.SILENT:
                # A later one takes the place of one that goes on.
                spans = [replace(span, to_s=min(span.to_s, one.t_s)) for span in spans]
                spans.append(Span(one.t_s, one.t_s + (fault.value or math.inf), "silent"))
            if fault.kind is InjectionKind.REBOOT:
                spans.append(Span(one.t_s, one.t_s + 12.0, "reboot"))
        put = [one.t_s for one in self.happened(name, "on_pad")]
        spans += [
            Span(one.t_s, min((at_s for at_s in put if at_s > one.t_s), default=math.inf), "crash")
            for one in self.happened(name, "crash")
        ]
        return spans

    def _silent(self, name: str, at_s: float, slack_s: float = 2.0) -> bool:
        return any(span.from_s - slack_s <= at_s <= span.to_s + slack_s for span in self.silences(name))

    def _known_s(self, name: str, at_s: float) -> float:
        """Return when the ground can know what happened: not before a silence is over."""
        for span in self.silences(name):
            if span.from_s <= at_s <= span.to_s:
                at_s = span.to_s + 1.0
        return at_s

    def at(self, name: str, at_s: float) -> Truth:
        """Return the last truth of a vehicle by then: where it was, and what its battery held."""
        behind = bisect_right(self._times[name], at_s + 0.05)
        return self._of[name][max(0, behind - 1)]

    def armed(self, name: str, at_s: float) -> bool:
        """Return whether its motors were on."""
        changes = [one for one in self.happened(name, "armed", "disarmed") if one.t_s <= at_s + 0.05]
        return bool(changes) and changes[-1].what == "armed"

    def from_pad_m(self, name: str, at_s: float) -> float:
        """Return how far from its pad it was."""
        return distance_m(place(self.at(name, at_s)), self.flown.pads[name])

    def _came_down(self, name: str, at_s: float) -> list[str]:
        """Return how it came down; a motor that stops where it stands after its landing is no fall."""
        ends: list[str] = []
        falls, stopped = True, False
        first_s = min((one.t_s for one in self.happened(name, "took_off")), default=math.inf)
        for one in self.happened(name, "kill", "crash", f"fault {name}:crash", "on_pad", "landed", "fell"):
            if one.what == "fell" and one.t_s < first_s:
                falls = False  # its motors stopped as they began to lift it
            if one.what not in {"on_pad", "landed", "fell"}:
                falls, stopped = one.up_m is None or one.up_m > FALLS_FROM_M, True
            elif one.what == "fell" and not stopped and (self.at(name, one.t_s - 1.0).up_m or 0.0) <= FALLS_FROM_M:
                falls = False  # its battery was empty where it hovered over its pad
            if one.what == "on_pad" and not self.armed(name, one.t_s - 0.1):
                continue  # it stood there
            if one.what.startswith("fault "):
                continue  # its thrust goes there; how it comes down follows
            if one.t_s > at_s:
                continue
            if falls or one.what in {"on_pad", "landed"}:
                ends.append(one.what)
            elif one.what == "fell":
                ends.append("landed")  # by less than a hand's breadth
        return ends


def last_words_s(span: Span) -> float:
    """Return how long into a silence it may still be said to be heard."""
    return LAST_WORDS_S + KNOWS_S if span.what == "crash" else 0.0

"""Holds what was commanded, said and shown in a story against what really happened.

The yardstick is the truth, and the log of what a crew asked for; nothing here asks the flight's own decisions.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from executor.core.interface.commands import Level, Say
from executor.core.interface.events import IntentReceived, LaunchOrdered
from executor.core.interface.intents import Action
from simulator.autopilot import STEP_S
from simulator.fault_kinds import InjectionKind, parse_fault
from simulator.truth import Truth
from tests.stories.record import KNOWS_S, Record, Span, distance_m, last_words_s, place
from tests.stories.world import Flown

BEGUN_AGAIN_S = 13.0
"""A broken-off upload is begun again within this: ArduPilot frees the transfer after 8 s."""
ON_ITS_WAY_S = 0.3
"""A command that was sent before it happened arrives within this."""
LANDING_KNOWN_S = 3.0
"""A landing begins without a word: the landed state comes once a second."""
OBEYS_S = 60.0
"""An order that a person asked for is given within this, tries included."""
LAUNCH_S = 75.0
"""The launch is the crew's word for a take-off this soon after it; whoever starts later needs another."""
PLACE_M = 12.0
"""What is said of a place is true within this."""
SHOWN_S = 4.0
"""The page shows a takeover, or a wreck, within this."""
STOPPED_S = 1.0
"""So long who is stopped a hand's breadth over the ground may be said to have landed before it lies there."""
ANNOUNCED_S = 30.0
AWAKE_S = 2.0
"""A ground station that stood still, or was not there, says within this what it finds."""
GIVEN_S = 240.0
"""Segments that are given to others go on board of somebody within this."""
MOVES = ("order command 400 1", "order command 300", "order command 22")
COORDINATES = re.compile(r"-?\d{1,3}\.\d{4,}")


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that must not be."""

    rule: str
    at_s: float
    text: str

    def __str__(self) -> str:
        return f"[{self.rule}] {self.at_s:.1f} s: {self.text}"


class Judge(Record):
    """One story's flight, looked at afterwards."""

    def findings(self) -> list[Finding]:
        """Return everything that must not be, in the order of its time."""
        rules = (
            *self._own_rules(), self._ended, self._hands_off, self._own_emergencies, self._arming, self._parameters,
            self._lines, self._words, self._pages, self._elsewhere, self._inspections,
        )  # fmt: skip
        return sorted((one for rule in rules for one in rule()), key=lambda one: one.at_s)

    def _own_rules(self) -> Sequence[Callable[[], Iterator[Finding]]]:
        """Return what else is held against the truth."""
        return ()

    # Who commanded what.

    def _ended(self) -> Iterator[Finding]:
        if self.flown.ended_s is None and not self._stays_open():
            lie = [name for name in self.names if self.armed(name, self.end_s)]
            what = f"; armed: {', '.join(lie)}" if lie else ""
            yield Finding("ends", self.end_s, f"the flight did not end within {self.flown.story.limit_s:g} s{what}")

    def _stays_open(self) -> bool:
        """Return whether nobody is heard, and the flight says so: it ends by an operator, or by empty batteries."""
        open_s = max((at_s for at_s, line in self.flown.said if "The flight stays open" in line.text), default=None)
        again_s = max((at_s for at_s, line in self.flown.said if line.text == "links regained"), default=0.0)
        unheard = open_s is not None and all(self._silent(name, open_s, SHOWN_S) for name in self.names)
        return unheard and open_s is not None and open_s > again_s

    def _wished(self, name: str, at_s: float) -> bool:
        """Return whether a person asked for this: an order follows a wish that was not refused."""
        return any(
            intent.id not in self._refused and -STEP_S <= at_s - asked_s <= OBEYS_S and intent.vehicle == name
            for asked_s, intent in self._asked
        )

    def _aborted(self, at_s: float) -> bool:
        """Return whether everybody was told to come home in that very moment: whose return it is nobody can tell."""
        return any(intent.action is Action.ABORT and abs(at_s - asked_s) <= 1.0 for asked_s, intent in self._asked)

    def _hands_off(self) -> Iterator[Finding]:
        for name in self.names:
            for span in self.hands(name):
                from_s = self._known_s(name, span.from_s)
                for order in self.orders(name):
                    # An upload may be on its way; nobody orders a mode within the same moment by chance.
                    known_s = from_s + (ON_ITS_WAY_S if order.what.startswith("order command") else KNOWS_S)
                    allowed = self._wished(name, order.t_s) or self._made_whole(name, order, known_s)
                    if known_s <= order.t_s < span.to_s and not allowed:
                        yield Finding("hands", order.t_s, f"{name}: {order.what!r} though it was taken ({span.what})")

    def _made_whole(self, name: str, order: Truth, taken_s: float) -> bool:
        """Return whether an upload goes on that broke off half: a mixture of two missions would be on board."""
        if self.flown.autopilot != "ardupilot" or not order.what.startswith("order mission"):
            return False
        begun_s = order.t_s
        for one in reversed(self.orders(name)):
            if one.what == order.what and 0.0 <= begun_s - one.t_s <= BEGUN_AGAIN_S:
                begun_s = one.t_s
        return begun_s < taken_s

    def _own_emergencies(self) -> Iterator[Finding]:
        for name in self.names:
            for span in self._acting(name):
                late_s = LANDING_KNOWN_S if span.what == "descends" else KNOWS_S
                from_s = self._known_s(name, span.from_s) + late_s
                for order in self.orders(name):
                    if from_s <= order.t_s < span.to_s and not self._wished(name, order.t_s):
                        what = "its landing" if span.what == "descends" else f"its own {span.what}"
                        yield Finding("emergency", order.t_s, f"{name}: {order.what!r} in {what}")

    def _acting(self, name: str) -> Iterator[Span]:
        """Yield when a failsafe acted or a landing was under way."""
        over = self.happened(name, "disarmed", "crash", "landed")
        for one in self.happened(name, "failsafe ", "descends"):
            ends = [later.t_s for later in over if later.t_s > one.t_s]
            ends += [order.t_s for order in self.orders(name) if order.t_s > one.t_s and self._wished(name, order.t_s)]
            if one.what == "descends":
                # A new mission may have come in time: then it flies away again.
                ends += self._leaves(name, one)
                ends += [later.t_s for later in self.happened(name, "mode ", "wreck") if later.t_s > one.t_s]
            yield Span(one.t_s, min(ends, default=self.end_s), one.what)

    def _leaves(self, name: str, start: Truth) -> list[float]:
        """Return when it is first in the air and elsewhere than above where its landing began."""
        later = [one for one in self._of[name] if one.what == "at" and one.t_s > start.t_s and (one.up_m or 0.0) > 1.0]
        return [one.t_s for one in later if distance_m(place(one), place(start)) > self.on_pad_m][:1]

    def _arming(self) -> Iterator[Finding]:
        if self.flown.story.tables.get("flight", {}).get("fly_again") == "auto":
            return
        [launched_s] = [at_s for at_s, event in self.flown.log if isinstance(event, LaunchOrdered)]
        for name in self.names:
            downs = [one.t_s for one in self.happened(name, "disarmed")]
            for order in self.orders(name):
                if not order.what.startswith(MOVES) or self.armed(name, order.t_s - 0.1):
                    continue
                last_s = max((at_s for at_s in downs if at_s <= order.t_s), default=None)
                # It may have disarmed again while the order of its start was on its way.
                crossed = last_s is not None and order.t_s - last_s <= KNOWS_S and not self.happened(name, "took_off")
                if (last_s is None or crossed) and order.t_s - launched_s <= LAUNCH_S:
                    continue
                if not any((last_s or 0.0) < at_s <= order.t_s for at_s in self._included(name)):
                    yield Finding("arming", order.t_s, f"{name}: {order.what!r} that nobody confirmed")

    def _parameters(self) -> Iterator[Finding]:
        for name in self.names:
            for order in self.happened(name, "order parameter"):
                if self.armed(name, order.t_s):
                    yield Finding("parameters", order.t_s, f"{name}: {order.what!r} in flight")

    # What was said.

    def _lines(self) -> Iterator[Finding]:
        for at_s, line in self.flown.said:
            for pattern, check in self._claims():
                found = pattern.search(line.text)
                why = check(found, at_s, line) if found is not None else ""
                if why:
                    yield Finding("line", at_s, f"{line.text!r}: {why}")

    def _claims(self) -> Sequence[tuple[re.Pattern[str], Callable[[re.Match[str], float, Say], str]]]:
        name = rf"^(?P<name>{'|'.join(self.names)}): "
        return [
            (
                re.compile(name + r"(?!.*(says|not landed|has not|taken to have|reported landed but)).*\blanded\b"),
                self._landed,
            ),
            (re.compile(name + r".*down at (?P<lat>-?\d+\.\d+)\D+?(?P<lon>-?\d+\.\d+)"), self._down),
            (re.compile(name + r".*with its pilot"), self._with_pilot),
            (re.compile(name + r".*segments? to be reassigned"), self._given),
            (re.compile(name + r".*(link lost|no message) for "), self._is_silent),
            (re.compile(name + r"link regained"), self._is_heard),
            (re.compile(name + r".*(?P<what>by itself)"), self._by_itself),
            (re.compile(r"^all links lost"), self._all_silent),
            (re.compile(name + r".*(below|under) (its|the) reserve"), self._below_reserve),
            (re.compile(name + r".*"), self._a_fault),
        ]

    def _landed(self, found: re.Match[str], at_s: float, line: Say) -> str:
        name = found["name"]
        if self.armed(name, at_s):
            return "its motors are on"
        ended = self._came_down(name, at_s) or self._came_down(name, at_s + STOPPED_S)
        if not ended or ended[-1] != "landed":
            return f"it did not land, it was: {ended[-1] if ended else 'never in the air'}"
        away_m = self.from_pad_m(name, at_s)
        if away_m > self.on_pad_m and not COORDINATES.search(line.text) and "off its pad" not in line.text:
            return f"{away_m:.0f} m from its pad, which is not said"
        told = re.search(r"with (\d+) %", line.text)
        # A battery may be emptied on the ground, by a fault, before the line is said.
        landed = [one.charge_pct or 0.0 for one in self.happened(name, "landed") if one.t_s <= at_s]
        charge_pct = self.at(name, at_s).charge_pct or 0.0
        if told is not None and min(abs(int(told[1]) - one) for one in (charge_pct, *landed[-1:])) > 4.0:
            return f"its battery holds {charge_pct:.0f} %"
        return ""

    def _down(self, found: re.Match[str], at_s: float, line: Say) -> str:
        name, told = found["name"], (float(found["lat"]), float(found["lon"]))
        truth = self.at(name, at_s)
        away_m = distance_m(place(truth), told)
        if away_m > PLACE_M:
            return f"it is {away_m:.0f} m from there"
        if (truth.up_m or 0.0) > 1.0:
            return f"it is {truth.up_m:.0f} m up"
        ended = [one.what for one in self.happened(name, "landed", "wreck", "fell", "crash") if one.t_s <= at_s]
        if ended and ended[-1] == "landed" and self.from_pad_m(name, at_s) <= self.on_pad_m:
            return "it has landed on its pad"
        armed = re.search(r"\barmed\b", line.text) is not None and "disarmed" not in line.text
        # That its motors have stopped comes with its next HEARTBEAT.
        runs = self.armed(name, at_s) or self.armed(name, at_s - KNOWS_S)
        return "it is disarmed" if armed and not runs else ""

    def _with_pilot(self, found: re.Match[str], at_s: float, line: Say) -> str:
        spans = self.hands(found["name"])
        return "" if any(span.from_s <= at_s for span in spans) else "nobody has taken it"

    def _given(self, found: re.Match[str], at_s: float, line: Say) -> str:
        others = [name for name in self.names if name != found["name"]]
        told = [one for name in others for one in self.happened(name, "order mission")]
        return "" if any(at_s <= one.t_s <= at_s + GIVEN_S for one in told) else "nobody was given anything"

    def _is_silent(self, found: re.Match[str], at_s: float, line: Say) -> str:
        return "" if self._silent(found["name"], at_s, 8.0) else "it spoke"

    def _is_heard(self, found: re.Match[str], at_s: float, line: Say) -> str:
        # How long a restart takes is the simulator's: at most as long as the span says.
        spans = [
            span
            for span in self.silences(found["name"])
            if span.from_s + last_words_s(span) < at_s < span.to_s - STEP_S
        ]
        return "it cannot be heard" if any(span.what != "reboot" for span in spans) else ""

    def _by_itself(self, found: re.Match[str], at_s: float, line: Say) -> str:
        name = found["name"]
        causes = [
            one
            for one in self.happened(name, "pilot ", "station ", "kill", "failsafe ")
            if one.t_s <= at_s and not self._has_it_already(name, one)
        ]
        if not causes:
            return ""
        cause = causes[-1]
        if not cause.what.startswith("failsafe"):
            return f"somebody did it: {cause.what}"
        if cause.what == "failsafe fence" and at_s - cause.t_s < 30 and "fence" not in line.text.lower():
            return "it was its fence"
        return ""

    def _has_it_already(self, name: str, cause: Truth) -> bool:
        """Return whether a pilot asks for the mode that it is in: who put it there stays who did it."""
        modes = [one.what.removeprefix("mode ") for one in self.happened(name, "mode ") if one.t_s < cause.t_s]
        return bool(modes) and cause.what == f"pilot {modes[-1]}"

    def _all_silent(self, found: re.Match[str], at_s: float, line: Say) -> str:
        speak = [name for name in self.names if not self._silent(name, at_s, 0.5) and self.armed(name, at_s)]
        return f"{', '.join(speak)} can be heard" if speak else ""

    def _below_reserve(self, found: re.Match[str], at_s: float, line: Say) -> str:
        name = found["name"]
        faults = [parse_fault(one.what.removeprefix("fault ")).kind for one in self.happened(name, "fault ")]
        if {InjectionKind.BATTERY_STEP, InjectionKind.DRAIN, InjectionKind.EMERGENCY} & set(faults):
            return ""
        least = min((one.charge_pct for one in self._of[name] if one.charge_pct is not None), default=100.0)
        return f"it never had less than {least:.0f} %" if least >= self.flown.reserve_pct else ""

    def _a_fault(self, found: re.Match[str], at_s: float, line: Say) -> str:
        name = found["name"]
        if line.level is not Level.FAULT or "operator" in line.text:
            return ""
        if any(one.t_s <= at_s for one in self.happened(name, "fault ", "failsafe ", "crash", "wreck")):
            return ""
        return "nothing had happened to it"

    def _words(self) -> Iterator[Finding]:
        """Hold the lines against what the story itself expects."""
        lines = [line.text for _, line in self.flown.said]
        for pattern in self.flown.story.says:
            if not any(re.search(pattern, text) for text in lines):
                yield Finding("says", self.end_s, f"no line has {pattern!r}")
        for pattern in self.flown.story.never_says:
            for at_s, line in self.flown.said:
                if re.search(pattern, line.text):
                    yield Finding("says", at_s, f"{line.text!r}: must not be said")
        for at_s, line in self.flown.said:
            if line.text.startswith("internal error"):
                yield Finding("mistake", at_s, line.text)

    # What was shown.

    def _pages(self) -> Iterator[Finding]:
        seen: set[tuple[str, str]] = set()
        for one in self.flown.shown:
            why = self._untrue(one.vehicle, one.state, one.at_s)
            if why and (one.vehicle, why) not in seen:
                seen.add((one.vehicle, why))
                yield Finding("page", one.at_s, f"{one.vehicle} is shown as {one.state!r}: {why}")

    def _untrue(self, name: str, state: str, at_s: float) -> str:
        if self._silent(name, at_s, SHOWN_S):
            return ""
        held = any(
            self._known_s(name, span.from_s) + SHOWN_S <= at_s < span.to_s
            and not self._wished(name, at_s)
            and not self._aborted(span.from_s)
            and self.armed(name, at_s)
            and not self._overruled(name, at_s)
            for span in self.hands(name)
        )
        # Who is knocked over with its motors off stays what it was.
        wrecks = [one.t_s for one in self.happened(name, "wreck") if one.t_s <= at_s and self.armed(name, one.t_s)]
        if wrecks:
            return "" if state == "down" or at_s - wrecks[0] < ANNOUNCED_S else "it lies on its back"
        if held:
            return "" if state == "pilot" else "somebody else has it"
        stopped = any(at_s - SHOWN_S <= one.t_s <= at_s for one in self.happened(name, "disarmed"))
        if state == "landed" and self.armed(name, at_s) and self.armed(name, at_s - SHOWN_S) and not stopped:
            return "its motors are on"
        if state == "landed":
            return self._landed_untrue(name, at_s)
        flies = state in {"flying", "returning", "landing", "holding"}
        lately = any(at_s - SHOWN_S <= one.t_s <= at_s for one in self.happened(name, "armed"))
        if flies and not self.armed(name, at_s) and not self.armed(name, at_s - SHOWN_S) and not lately:
            return "its motors are off"
        return ""

    def _overruled(self, name: str, at_s: float) -> bool:
        """Return whether a failsafe acts although somebody has it, as it does when the link is lost."""
        causes = [*self._by_others(name), *self.happened(name, "failsafe ")]
        before = [one for one in causes if one.t_s <= at_s]
        return bool(before) and max(before, key=lambda one: one.t_s).what.startswith("failsafe")

    def _landed_untrue(self, name: str, at_s: float) -> str:
        ended = [what for what in self._came_down(name, at_s) if what != "on_pad"]
        return f"it did not land, it was: {ended[-1]}" if ended and ended[-1] != "landed" else ""

    # What was kept from the crew.

    def _elsewhere(self) -> Iterator[Finding]:
        """Who comes down somewhere else is announced, with where; and so is a wreck, in time."""
        for name in self.names:
            for one in self.happened(name, "disarmed", "wreck"):
                if one.t_s < self.flown.began_s or distance_m(place(one), self.flown.pads[name]) <= self.on_pad_m:
                    continue
                if any(wreck.t_s < one.t_s for wreck in self.happened(name, "wreck")):
                    continue  # its motors are off now; where it lies was told
                if one.what == "wreck" and not self.armed(name, one.t_s):
                    continue  # knocked over where it stands; where that is was told when it disarmed
                known_s = self._known_s(name, one.t_s)
                by_s = self._known_s(name, known_s + ANNOUNCED_S) + AWAKE_S
                if by_s > self.end_s or self._silent(name, known_s + 2.0, 0.0):
                    continue
                told = [
                    line.text
                    for at_s, line in self.flown.said
                    if one.t_s - 5.0 <= at_s <= by_s
                    and line.level is not Level.INFO
                    and name in line.text
                    and COORDINATES.search(line.text)
                ]
                if not told:
                    away_m = distance_m(place(one), self.flown.pads[name])
                    yield Finding(
                        "elsewhere", one.t_s, f"{name}: {one.what} {away_m:.0f} m from its pad, not announced"
                    )

    def _inspections(self) -> Iterator[Finding]:
        """What counts was flown; and in a story that can end well, everything counts."""
        flown = self.flown
        for segment, name in flown.inspected.items():
            ways = [place(one) for one in self._of.get(name, ()) if one.what == "at"]
            for end in flown.segments[segment]:
                nearest_m = min((distance_m(way, end) for way in ways), default=math.inf)
                if nearest_m > PLACE_M:
                    text = f"segment {segment} counts for {name}, which came no nearer than {nearest_m:.0f} m"
                    yield Finding("inspected", self.end_s, text)
        missing = flown.wanted - set(flown.inspected)
        if flown.story.completes and missing:
            yield Finding("completes", self.end_s, f"segments {sorted(missing)} are not inspected")


def told_in(flown: Flown) -> str:
    """Return a story as one reads it: what happened, what was commanded, what was said."""
    rows = [
        (one.t_s, f"  {one.vehicle} {one.what}" + (f" by {one.sender}" if one.sender else ""))
        for one in flown.truths
        if one.what != "at" and one.t_s >= flown.began_s
    ]
    rows += [(at_s, f"{line.level.value}: {line.text}") for at_s, line in flown.said]
    rows += [
        (at_s, f"asked: {event.intent.action.value} {event.intent.vehicle or ''}")
        for at_s, event in flown.log
        if isinstance(event, IntentReceived)
    ]
    ordered = sorted(rows, key=lambda row: row[0])
    return "\n".join(f"{at_s:7.1f} {text}" for at_s, text in itertools.chain(ordered))

"""Holds a flight through a storm against what really happened, with the rules of the stories and more."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from executor.core.interface.commands import Say
from executor.core.interface.events import Heard
from executor.core.interface.intents import Action
from executor.core.interface.messages import Heartbeat
from simulator.autopilot import STEP_S
from simulator.truth import Truth
from tests.stories.judge import SHOWN_S, Finding, Judge
from tests.stories.record import FALLS_FROM_M, KNOWS_S, Span, distance_m, last_words_s, place
from tests.stories.story import MISSION
from tests.storm.plot import BEARS_S, Happening
from tests.storm.sky import Stormed

CUTS_OFF = frozenset({"downlink lost", "frozen", "held up", "no heartbeat", "ground sleeps", "ground killed"})
"""Nothing of a vehicle, or nothing that counts, comes while these last."""
MUDDLES = frozenset({"bursts", "bad link", "no position", "gps jump", "garbage", "uplink lost"})
"""What the ground knows is late, or wrong, while these last."""
FORGERIES = frozenset({"forged disarmed", "forged position", "forged text", "gps jump", "foreign mission"})
"""Nobody on the ground can tell all of these from the truth."""
AFTER_S = 6.0
"""How long what is muddled takes to clear."""
BESIDE_M = 16.0
"""A vehicle that inspects is not further from the line than this: the standoff, the corridor, and the rounding."""
END_M = 14.0
"""At a second's look a vehicle was seen this near to each end of what it flew, and as near to everything between."""
UP_M = 2.5
NEARER_M = 1.5
"""Two vehicles may be seen nearer than the layers' spacing by this."""
BELOW_PCT = 2.0
ASKS_S = 12.0
"""A ground station that runs again asks everybody first."""
BEAT_S = 1.0
"""A silence is over for the ground with the next HEARTBEAT."""
ON_ITS_WAY_S = 2.5
"""What was true so long ago may still be said."""
CROSSES_S = 0.5
"""What happens so shortly before a line is said crosses it on its way."""
SEVERAL_S = 5.0
"""Failsafes that act within this are one to who hears of them."""
EDGE_M = 0.5
"""Of what is on its pad: how far from it a place was said to be, and was, differ by less."""
AIRBORNE_M = 1.0
OVER = frozenset({"landed", "down", "lost", "ground", "pilot"})
"""States in which the end of a vehicle is known, or openly unknown."""
UNEXPLAINED_S = 60.0
"""So long a takeover that was none is spoken of: until its segments are released to the others."""
EXPLAINS_S = 20.0
"""So long a text of a failsafe explains a return, whoever said it."""
DRAINS = frozenset({"battery step", "drain", "emergency", "gps jump", "no battery", "solver"})
BATTERY_S = 240.0


class StormJudge(Judge):
    """One flight through a storm, looked at afterwards."""

    on_pad_m = 15.0 + EDGE_M

    def __init__(self, stormed: Stormed) -> None:
        super().__init__(stormed.flown)
        self.stormed = stormed
        self._taken: dict[str, list[Truth]] = {}

    def _own_rules(self) -> Sequence[Callable[[], Iterator[Finding]]]:
        return (self._mistakes, self._apart, self._reserve, self._ends)

    # What happened.

    def _began(self, name: str, kinds: frozenset[str]) -> Iterator[tuple[float, Happening]]:
        return ((at_s, one) for at_s, one in self.stormed.began if one.kind in kinds and one.befalls(name))

    def silences(self, name: str) -> list[Span]:
        spans = [
            replace(one, to_s=one.to_s + (BEARS_S if one.what == "reboot" else BEAT_S))
            for one in super().silences(name)
        ]
        # Who was frozen lives in its own time from then on: its silences end later by as much.
        lags = self._lags(name)
        spans = [replace(one, to_s=one.to_s + sum(lag for at_s, lag in lags if at_s < one.to_s)) for one in spans]
        # Who crashes in that time says its last words after it.
        spans = [
            replace(one, from_s=max(one.from_s, *(at_s + lag for at_s, lag in lags if at_s < one.from_s), 0.0))
            if one.what == "crash"
            else one
            for one in spans
        ]
        spans += [
            Span(at_s, at_s + one.for_s + (ASKS_S if one.kind == "ground killed" else 2.0), one.kind)
            for at_s, one in self._began(name, CUTS_OFF)
        ]
        return spans

    def _stays_open(self) -> bool:
        """Return whether nobody is heard: who takes a flight up then is told so each time, and may try again."""
        died = any(one.kind == "ground killed" for _, one in self.stormed.began)
        return super()._stays_open() or (died and all(self._silent(name, self.end_s, 0.0) for name in self.names))

    def _lags(self, name: str) -> list[tuple[float, float]]:
        """Return when it was frozen, and for how long."""
        return [(at_s, one.for_s) for at_s, one in self._began(name, frozenset({"frozen"}))]

    def _unseen_or_late(self, name: str, at_s: float) -> bool:
        """Return whether nothing came from it, or all of it late."""
        bursts = self._began(name, frozenset({"bursts"}))
        late = any(began_s <= at_s <= began_s + one.for_s + AFTER_S for began_s, one in bursts)
        return late or super()._silent(name, at_s)

    def _muddles(self, name: str) -> list[Span]:
        return [Span(at_s, at_s + one.for_s + AFTER_S, one.kind) for at_s, one in self._began(name, MUDDLES)]

    def _silent(self, name: str, at_s: float, slack_s: float = 2.0) -> bool:
        muddled = any(span.from_s - slack_s <= at_s <= span.to_s + slack_s for span in self._muddles(name))
        return muddled or super()._silent(name, at_s, slack_s)

    def _known_s(self, name: str, at_s: float) -> float:
        spans = sorted([*self.silences(name), *self._muddles(name)], key=lambda span: span.from_s)
        for span in spans:
            if span.from_s - 1.0 <= at_s <= span.to_s:
                at_s = span.to_s + 1.0
        return at_s

    def _acting(self, name: str) -> Iterator[Span]:
        """Yield when a failsafe acts.

        One on the ground with the motors off moves nothing, and whoever puts it back on its mission ends it.
        """
        mission = MISSION[self.flown.autopilot]["mission"]
        for span in super()._acting(name):
            # A start that was on its way may end it in the same moment: the record has them in their order.
            began = next(
                at for at, one in enumerate(self._events[name]) if (one.t_s, one.what) == (span.from_s, span.what)
            )
            back = [one.t_s for one in self._events[name][began:] if one.what == f"mode {mission}"]
            if self.armed(name, span.from_s):
                yield replace(span, to_s=min([span.to_s, *back]))

    def _by_others(self, name: str) -> list[Truth]:
        """Return what others did to it; a switch that is moved while the motors are off takes nothing."""
        if name not in self._taken:  # asked at every look: a tenth of a story's time
            self._taken[name] = [
                one
                for one in super()._by_others(name)
                if not self._nobody_saw(name, one)
                and (one.what == "kill" or (self.armed(name, one.t_s) and not self._lands_anyway(name, one)))
            ]
        return self._taken[name]

    def _nobody_saw(self, name: str, one: Truth) -> bool:
        """Return whether nobody on the ground can ever know of it.

        A takeover is over, and the vehicle in a mode that others or itself chose, before it is heard; or a kill switch
        was pressed on a vehicle that stood, which is said once; or somebody chose what a failsafe that acts leads to.
        """
        if one.what == "kill":
            return not self.armed(name, one.t_s - 0.1) and self._silent(name, one.t_s, 0.5)
        if self._crossed(name, one) or self._as_without_us(name, one) or self._between_beats(name, one):
            return True
        if one.what.endswith((" RTL", " LAND")) and any(
            span.from_s < one.t_s < span.to_s for span in self._acting(name)
        ):
            return True  # nothing may be ordered then either
        low = self.happened(name, "low battery")
        if one.what.endswith((" RTL", " LAND")) and any(0.0 <= one.t_s - at.t_s <= EXPLAINS_S for at in low):
            return True  # its own failsafe has just said that it acts
        heard_s = max(self._unheard_until_s(name, one.t_s), one.t_s + BEAT_S + 0.1)
        mission = MISSION[self.flown.autopilot]["mission"]
        modes = [mode for mode in self.happened(name, "mode ") if one.t_s <= mode.t_s <= heard_s]
        return len(modes) > 1 and not one.what.endswith(f" {mission}")

    def _between_beats(self, name: str, one: Truth) -> bool:
        """Return whether it was taken and put back between two HEARTBEATs that arrived, both in the same mode."""
        back_s = min((mode.t_s for mode in self.happened(name, "mode ") if mode.t_s > one.t_s + 0.1), default=math.inf)
        beats = [
            (at_s, event.message.custom_mode)
            for at_s, event in self.flown.log
            if isinstance(event, Heard) and event.vehicle == name and isinstance(event.message, Heartbeat)
        ]
        before = [mode for at_s, mode in beats if at_s < one.t_s][-1:]
        since = {mode for at_s, mode in beats if one.t_s <= at_s <= back_s + ON_ITS_WAY_S}
        return math.isfinite(back_s) and bool(before) and since <= set(before)

    def _crossed(self, name: str, one: Truth) -> bool:
        """Return whether an order that was on its way put it on its mission in the same moment, by our word."""
        if self._is_back(one):
            return False
        ordered = [order.t_s for order in self.orders(name) if one.t_s <= order.t_s]
        flies = self.happened(name, f"mode {MISSION[self.flown.autopilot]['mission']}")
        return any(
            order_s - one.t_s < KNOWS_S and 0 <= mode.t_s - order_s < 0.1 for order_s in ordered for mode in flies
        )

    def _as_without_us(self, name: str, one: Truth) -> bool:
        """Return whether somebody chose what its GCS failsafe leads to while nobody was heard, or in that moment."""
        if any(-2.5 <= one.t_s - span.to_s <= BEAT_S for span in self.silences(name)):
            return one.what.endswith((" RTL", " HOLD"))
        unheard = [*self._began(name, frozenset({"bursts", "frozen", "downlink lost", "held up"}))]
        home = one.what.endswith((" RTL", " LAND") if self.flown.autopilot == "px4" else " RTL")
        return home and any(at_s <= one.t_s <= at_s + of.for_s for at_s, of in unheard)

    def _unheard_until_s(self, name: str, at_s: float) -> float:
        """Return when a vehicle is heard that is silent now, or before its next HEARTBEAT; else the time itself."""
        for span in sorted(self.silences(name), key=lambda span: span.from_s):
            if span.from_s - BEAT_S <= at_s < span.to_s:
                at_s = span.to_s
        return at_s

    def _lands_anyway(self, name: str, one: Truth) -> bool:
        """Return whether a landing was chosen for one that lands at home.

        PX4 leaves its mission for these modes by itself, and of a return nobody knows how it ends.
        """
        modes = [mode.what for mode in self.happened(name, "mode ") if mode.t_s < one.t_s]
        leads_there = self.flown.autopilot == "px4" or modes[-1:] == ["mode RTL"]
        if not leads_there or not one.what.endswith((" LAND", " RTL")):
            return False
        was_away = any(self.from_pad_m(name, at.t_s) > self.on_pad_m for at in self._of[name] if at.t_s < one.t_s)
        return was_away and self.from_pad_m(name, one.t_s) < self.on_pad_m

    def _forged(self, name: str, at_s: float) -> bool:
        """Return whether somebody lied about it before."""
        return any(began_s <= at_s for began_s, _ in self._began(name, FORGERIES))

    # What is said: a lie that was believed makes lines that are not true, and nobody can help it.

    def _landed(self, found: re.Match[str], at_s: float, line: Say) -> str:
        if "landed or" in line.text or self._lied(found["name"], at_s, "forged disarmed"):
            return ""
        if self._fell_unseen(found["name"], at_s):
            return ""  # it stands where it would have landed, and nobody saw how that came
        ended = [one.what for one in self.happened(found["name"], "on_pad", "took_off", "landed") if one.t_s <= at_s]
        if ended[-1:] == ["on_pad"] and self._put_unseen(found["name"], at_s):
            return ""  # it stands where it would have landed
        why = super()._landed(found, at_s, line)
        downs = [one.t_s for one in self.happened(found["name"], "disarmed") if one.t_s <= at_s]
        if why.endswith("never in the air") and downs and super()._silent(found["name"], downs[-1], 0.0):
            return ""  # it stopped on its pad within its first seconds, and nobody saw whether it flew
        unsaid = self._began(found["name"], frozenset({"no battery"}))
        if why.startswith("its battery holds") and any(
            0 <= at_s - began_s <= one.for_s + AFTER_S for began_s, one in unsaid
        ):
            return ""  # its last report was that
        emptied = any(one.t_s <= at_s for one in self.happened(found["name"], f"fault {found['name']}:battery-step"))
        return "" if why.startswith("its battery holds") and emptied and not self.armed(found["name"], at_s) else why

    def _fell_unseen(self, name: str, at_s: float) -> bool:
        """Return whether its motors were stopped over its pad, low or so that it came down whole, and nobody saw it."""
        stops = [one for one in self.happened(name, "kill") if one.t_s <= at_s]
        whole = self._came_down(name, at_s)[-1:] == ["fell"]  # from no height that breaks it
        low = bool(stops) and (whole or (stops[-1].up_m or 0.0) <= FALLS_FROM_M)
        return low and self._unseen_or_late(name, stops[-1].t_s)

    def _landed_untrue(self, name: str, at_s: float) -> str:
        return "" if self._fell_unseen(name, at_s) else super()._landed_untrue(name, at_s)

    def _put_unseen(self, name: str, at_s: float) -> bool:
        """Return whether it was put on its pad while it fell or nobody saw it: no story of this world."""
        put_s = max(one.t_s for one in self.happened(name, "on_pad") if one.t_s <= at_s)
        fell = any(one.t_s <= put_s for one in self.happened(name, f"fault {name}:crash", "kill"))
        return fell or super()._silent(name, put_s + 1.0, 0.0)

    def _down(self, found: re.Match[str], at_s: float, line: Say) -> str:
        name = found["name"]
        if self._forged(name, at_s) or self._silent(name, at_s, 30.0):
            return ""
        why = super()._down(found, at_s, line)
        edge = self.from_pad_m(name, at_s) > self.on_pad_m - 2.0 * EDGE_M
        if why == "it has landed on its pad" and (edge or self._killed_as_it_landed(name)):
            return ""  # it is down by either
        return "" if why == "it is disarmed" and self.armed(name, at_s - ON_ITS_WAY_S) else why

    def _killed_as_it_landed(self, name: str) -> bool:
        landed = [one.t_s for one in self.happened(name, "landed")]
        return any(abs(one.t_s - at_s) <= BEAT_S for one in self.happened(name, "kill") for at_s in landed)

    def _has_it_already(self, name: str, cause: Truth) -> bool:
        return super()._has_it_already(name, cause) or self._lands_anyway(name, cause)

    def _claims(self) -> Sequence[tuple[re.Pattern[str], Callable[[re.Match[str], float, Say], str]]]:
        name = rf"^(?P<name>{'|'.join(self.names)}): "
        return [
            *super()._claims(),
            (re.compile(name + r"radio signal"), self._has_radio),
            (re.compile(name + r".*while other messages come"), self._others_come),
        ]

    def _has_radio(self, found: re.Match[str], at_s: float, line: Say) -> str:
        # Who spoke as the vehicle before is at an address of its own from then on.
        return "" if self._lied(found["name"], at_s, "forged disarmed") else "there is no such radio on its link"

    def _others_come(self, found: re.Match[str], at_s: float, line: Say) -> str:
        forged = self._began(found["name"], FORGERIES)
        if any(0.0 <= at_s - began_s <= BEAT_S for began_s, _ in forged):
            return ""  # that came
        cut = frozenset({"downlink lost", "frozen"})
        spans = [span for span in super().silences(found["name"]) if span.what == "silent"]
        spans += [Span(at, at + one.for_s, one.kind) for at, one in self._began(found["name"], cut)]
        return "nothing comes" if any(span.from_s + 1.0 < at_s < span.to_s for span in spans) else ""

    def _lied(self, name: str, at_s: float, kind: str) -> bool:
        return any(at <= at_s and one.word != "190" for at, one in self._began(name, frozenset({kind})))

    def _is_heard(self, found: re.Match[str], at_s: float, line: Say) -> str:
        name = found["name"]
        spans = [
            span
            for span in super().silences(name)
            if _quiet_s(span, self._lags(name)) + max(1.0, last_words_s(span)) < at_s < span.to_s - STEP_S
        ]
        # A ground station that slept reads then what came in that time.
        late = [began_s + one.for_s for began_s, one in self._began(name, frozenset({"held up", "ground sleeps"}))]
        if any(-STEP_S < at_s - came_s < 2.0 for came_s in late):
            return ""  # it is heard with what was said before
        bursts = any(began_s <= at_s for began_s, _ in self._began(name, frozenset({"bursts", "bad link"})))
        spans = [span for span in spans if not (bursts and at_s - span.from_s < AFTER_S)]  # nor is it there at once
        return (
            "it cannot be heard"
            if any(span.what != "reboot" for span in spans) and not self._forged(name, at_s)
            else ""
        )

    def _with_pilot(self, found: re.Match[str], at_s: float, line: Say) -> str:
        name = found["name"]
        unknown = any(
            began_s <= at_s
            for began_s, _ in self._began(
                name, FORGERIES | {"ground killed", "kill", "disarm", "reboot", "half-upload"}
            )
        )
        # What need not be noticed may be noticed all the same.
        did = any(one.t_s <= at_s and not self._is_back(one) for one in Judge._by_others(self, name))
        excused = unknown or did or self._sent_on(name, at_s) or self._unexplained(name, at_s)
        return "" if excused else super()._with_pilot(found, at_s, line)

    def _is_back(self, one: Truth) -> bool:
        """Return whether somebody put it on its mission."""
        return one.what.endswith(f" {MISSION[self.flown.autopilot]['mission']}")

    def _sent_on(self, name: str, at_s: float) -> bool:
        """Return whether somebody sent it on its mission again that was told to come home: that takes it too."""
        mission = MISSION[self.flown.autopilot]["mission"]
        modes = [one.t_s for one in self.happened(name, f"mode {mission}") if one.t_s <= at_s]
        words = self.happened(name, f"pilot {mission}", f"station {mission}")
        return any(0 <= changed_s - one.t_s < 0.1 for changed_s in modes for one in words)

    def _unexplained(self, name: str, at_s: float) -> bool:
        """Return whether its failsafe acted last, and the text that says so got lost: in doubt it is a person's."""
        acted = [one for one in self.happened(name, "failsafe ") if at_s - UNEXPLAINED_S <= one.t_s <= at_s]
        return any(span.from_s <= one.t_s <= span.to_s for one in acted for span in self._muddles(name))

    def _by_itself(self, found: re.Match[str], at_s: float, line: Say) -> str:
        name = found["name"]
        lies = self._began(name, frozenset({"forged text"}))
        explained = any(0 <= at_s - began_s <= EXPLAINS_S for began_s, _ in lies)
        if explained or self._silent(name, at_s, 30.0) or self._as_its_failsafe(name, at_s):
            return ""
        why = super()._by_itself(found, at_s, line)
        acted = [one for one in self.happened(name, "failsafe ") if at_s - SEVERAL_S <= one.t_s <= at_s]
        wrecked = [one for one in self.happened(name, f"fault {name}:wreck") if at_s - SEVERAL_S <= one.t_s <= at_s]
        if why == "it was its fence" and (len(acted) + len(wrecked) > 1 or ": operator, " in line.text):
            return ""  # it was that, too
        known = [one for one in self.happened(name, "pilot ", "station ") if one.t_s <= at_s - CROSSES_S]
        return "" if why.startswith("somebody did it") and not known else why

    def _as_its_failsafe(self, name: str, at_s: float) -> bool:
        """Return whether somebody chose a way home while its failsafe had begun another: nobody tells them apart."""
        last = [one for one in self.happened(name, "pilot ", "station ") if one.t_s <= at_s][-1:]
        home = bool(last) and last[0].what.endswith((" RTL", " LAND"))
        return home and any(span.from_s < last[0].t_s < span.to_s for span in self._acting(name))

    def _given(self, found: re.Match[str], at_s: float, line: Say) -> str:
        """Segments may be given to nobody: who could take them may be cut off, or the day over."""
        told = any(
            at_s <= said_s and re.search(r"no vehicle|can take over|left over|without a vehicle", said.text)
            for said_s, said in self.flown.said
        )
        return "" if told or len(self.stormed.plot.happenings) > 1 else super()._given(found, at_s, line)

    def _below_reserve(self, found: re.Match[str], at_s: float, line: Say) -> str:
        drained = any(began_s <= at_s for began_s, _ in self._began(found["name"], DRAINS))
        return "" if drained else super()._below_reserve(found, at_s, line)

    def _a_fault(self, found: re.Match[str], at_s: float, line: Say) -> str:
        name = found["name"]
        if any(began_s <= at_s and one.befalls(name) for began_s, one in self.stormed.began):
            return ""
        return super()._a_fault(found, at_s, line)

    def _untrue(self, name: str, state: str, at_s: float) -> str:
        never_armed = not any(one.t_s <= at_s for one in self.happened(name, "armed"))
        if never_armed or self._forged(name, at_s) or (state in {"returning", "landing"} and self._sent(name, at_s)):
            return ""
        return super()._untrue(name, state, at_s)

    def _overruled(self, name: str, at_s: float) -> bool:
        """Return whether a failsafe acts, or acted until just now, although somebody has it."""
        acted = [one.t_s for one in self.happened(name, "failsafe ") if at_s - SHOWN_S <= one.t_s <= at_s]
        return any(super(StormJudge, self)._overruled(name, looked_s) for looked_s in (at_s, at_s - SHOWN_S, *acted))

    def _sent(self, name: str, at_s: float) -> bool:
        """Return whether somebody sent it home while nothing came from it: its failsafe might have done the same."""
        known = (one for one in self._by_others(name) if one.t_s <= at_s - SHOWN_S)
        last = max(known, key=lambda one: one.t_s, default=None)
        return last is not None and last.what.split()[-1] in {"RTL", "LAND"} and self._silent(name, last.t_s, 0.0)

    # What must not be, whatever happens.

    def _mistakes(self) -> Iterator[Finding]:
        for text in self.stormed.mistakes:
            yield Finding("traceback", self.end_s, text)

    def _inspections(self) -> Iterator[Finding]:
        """What counts was flown end to end by who is named for it."""
        for segment, name in self.flown.inspected.items():
            gap = self._unflown(segment, name)
            if gap:
                yield Finding("inspected", self.end_s, f"segment {segment} counts for {name}: {gap}")

    def _unflown(self, segment: int, name: str) -> str:
        """Return what of a segment nobody flew; empty if it was flown end to end."""
        one, two = self.flown.segments[segment]
        length_m = distance_m(one, two)
        along = sorted(
            at_m
            for truth in self._of.get(name, ())
            if truth.what == "at" and (truth.up_m or 0.0) > UP_M
            for at_m, beside_m in [_against(place(truth), one, two)]
            if beside_m <= BESIDE_M
        )
        bounds = [0.0, *(at_m for at_m in along if 0.0 <= at_m <= length_m), length_m]
        widest_m = max(after - before for before, after in itertools.pairwise(bounds))
        return f"{widest_m:.0f} m of {length_m:.0f} m were not flown" if widest_m > END_M else ""

    def _apart(self) -> Iterator[Finding]:
        """Who flies its mission, and does what it is told, keeps apart from the others that do."""
        looks: dict[float, list[Truth]] = {}
        for name in self.names:
            for truth in self._of[name]:
                if truth.what == "at" and (truth.up_m or 0.0) > UP_M and self._obeys(name, truth.t_s):
                    looks.setdefault(round(truth.t_s), []).append(truth)
        for at_s, truths in looks.items():
            for one, two in itertools.combinations(truths, 2):
                if one.vehicle == two.vehicle or abs(one.t_s - two.t_s) > 0.25:
                    continue
                apart_m = math.hypot(distance_m(place(one), place(two)), (one.up_m or 0.0) - (two.up_m or 0.0))
                if apart_m < self.stormed.spacing_m - NEARER_M:
                    yield Finding("apart", at_s, f"{one.vehicle} and {two.vehicle} are {apart_m:.1f} m apart")
                    return

    def _obeys(self, name: str, at_s: float) -> bool:
        """Return whether it flies a mission of ours, and nothing was done to it."""
        modes = [one.what for one in self.happened(name, "mode ") if one.t_s <= at_s]
        empty = any(one.t_s <= at_s and one.charge_pct is not None and one.charge_pct <= 0.0 for one in self._of[name])
        # From then on it falls: motors stop where a flight controller restarts.
        falls = (f"fault {name}:crash", f"fault {name}:wreck", f"fault {name}:reboot")
        done = self.happened(name, "pilot ", "station ", "kill", "failsafe ", "crash", "wreck", "storm ", *falls)
        mission = MISSION[self.flown.autopilot]["mission"]
        over = empty or any(one.t_s <= at_s for one in done)
        return bool(modes) and modes[-1] == f"mode {mission}" and not over

    def _reserve(self) -> Iterator[Finding]:
        """Nobody comes home with less than its reserve by a decision from here."""
        for name in self.names:
            others = self.happened(name, "pilot ", "station ", "failsafe ", "fault ", "storm ")
            if others or self._holds(name) or self.stormed.plot.charge_pct <= self.flown.reserve_pct + 10.0:
                continue
            for one in self.happened(name, "landed"):
                if one.t_s < self.flown.began_s:
                    continue
                left_pct = one.charge_pct or 0.0
                if left_pct < self.flown.reserve_pct - BELOW_PCT:
                    yield Finding("reserve", one.t_s, f"{name} landed with {left_pct:.0f} %")

    def _holds(self, name: str) -> bool:
        return any(intent.action is Action.HOLD and intent.vehicle == name for _, intent in self._asked)

    def _ends(self) -> Iterator[Finding]:
        """The flight ends when everybody's end is known, or openly unknown."""
        if self.flown.ended_s is None or self.stormed.left:
            return
        for name in self.names:
            last = self._of[name][-1]
            flies = self.armed(name, self.end_s) and (last.up_m or 0.0) > AIRBORNE_M
            lies = any(one.t_s <= self.end_s for one in self.happened(name, "crash", "wreck"))
            state = self.stormed.shown.get(name, "")
            if flies and not lies and not self._silent(name, self.end_s, 5.0) and not self._forged(name, self.end_s):
                yield Finding("left", self.end_s, f"{name} is in the air, shown as {state}")
            elif state not in OVER:
                yield Finding("unknown", self.end_s, f"{name} is shown as {state} at the end")


def _against(at: tuple[float, float], one: tuple[float, float], two: tuple[float, float]) -> tuple[float, float]:
    """Return how far along a segment a place is, and how far beside it."""
    length_m = distance_m(one, two)
    to_one, to_two = distance_m(at, one), distance_m(at, two)
    along_m = (to_one**2 - to_two**2 + length_m**2) / (2 * length_m)
    return along_m, math.sqrt(max(0.0, to_one**2 - along_m**2))


def _quiet_s(silence: Span, lags: Sequence[tuple[float, float]]) -> float:
    """Return from when it is silent: who is frozen when it breaks says its last words in its own time."""
    speaks_s = silence.from_s + last_words_s(silence)
    return silence.from_s + sum(lag for at_s, lag in lags if silence.what == "crash" and at_s < speaks_s)


def findings(stormed: Stormed) -> list[Finding]:
    """Return everything that must not be."""
    return StormJudge(stormed).findings()

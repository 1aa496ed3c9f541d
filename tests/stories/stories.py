"""The stories: people, failsafes and bad luck, and their pairs."""

from __future__ import annotations

from executor.core.interface.intents import Action
from tests.stories.story import (
    LONG,
    Answers,
    Moment,
    Story,
    after,
    at,
    first,
    high,
    low,
    on_segment,
    share,
    solving,
    told,
    uploading,
    wants,
)

PILOT = r"uav2: .*with its pilot"
DOWN = r"uav2: .*down at -?\d+\.\d+"
TAKEN = told(on_segment("uav2"), "uav2:pilot={hold}")
RETURNED_LATE = told(after("uav2", "pilot ", 60), "uav2:pilot={mission}")
PILOT_LANDS = told(after("uav2", "pilot ", 60), "uav2:pilot=RTL")
"""A pilot does not stay in the air for ever."""


def crashed(vehicle: str, when: float = 70.0) -> Moment:
    """Return the loss that makes a re-plan necessary."""
    return told(at(when), f"{vehicle}:crash")


TAKEOVERS = (
    Story(
        "taken in transit, flown home by the pilot",
        (told(share("uav2", 0.15), "uav2:pilot={hold}"), PILOT_LANDS),
        says=(PILOT,), never_says=("by itself",),
    ),
    Story(
        "taken on a segment, flown home by the pilot",
        (TAKEN, PILOT_LANDS),
        says=(PILOT,), never_says=("by itself",),
    ),
    Story(
        "taken during a re-plan",
        (crashed("uav3"), told(solving, "uav2:pilot={hold}"), PILOT_LANDS),
        says=(PILOT,), solve_s=4.0,
    ),
    Story(
        "taken during an upload",
        (crashed("uav3"), told(uploading("uav2"), "uav2:pilot={hold}"), PILOT_LANDS),
        says=(PILOT,),
    ),
    Story(
        "taken during the take-off",
        (told(high("uav2", 5.0), "uav2:pilot={hold}"), told(after("uav2", "pilot ", 20), "uav2:pilot=LAND")),
        says=(PILOT,),
    ),
    Story("taken on its way home", (told(share("uav2", 0.9), "uav2:pilot={hold}"), PILOT_LANDS), says=(PILOT,)),
    Story(
        "taken, then silent for 30 s",
        (TAKEN, told(after("uav2", "pilot ", 5), "uav2:silent=30s"),
         told(after("uav2", "pilot ", 90), "uav2:pilot=RTL")),
        says=(PILOT,),
    ),
    Story(
        "taken, then silent for good",
        (TAKEN, told(after("uav2", "pilot ", 5), "uav2:silent"), PILOT_LANDS),
        says=(PILOT,),
    ),
    Story("taken while it is silent", (told(on_segment("uav2"), "uav2:silent=25s"),
        told(after("uav2", "fault ", 2), "uav2:pilot={hold}"), PILOT_LANDS)),
    Story(
        "taken and landed where it is",
        (TAKEN, told(after("uav2", "pilot ", 20), "uav2:pilot=LAND")),
        says=(PILOT,),
    ),
    Story(
        "returned within the grace time, and included",
        (TAKEN, told(after("uav2", "pilot ", 10), "uav2:pilot={mission}"),
         wants(after("uav2", "pilot ", 14), Action.INCLUDE, "uav2")),
        says=(PILOT,),
    ),
    Story(
        "returned long after its segments were given away, and included",
        (TAKEN, RETURNED_LATE, wants(after("uav2", "pilot ", 65), Action.INCLUDE, "uav2")),
        says=(PILOT,),
    ),
    Story("returned and never included", (TAKEN, RETURNED_LATE), says=(PILOT,)),
    Story(
        "returned where a setting includes it",
        (TAKEN, told(after("uav2", "pilot ", 10), "uav2:pilot={mission}")),
        says=(PILOT,), tables={"flight": {"pilot_return": "auto"}},
    ),
    Story("sent home by its pilot", (told(on_segment("uav2"), "uav2:pilot=RTL"),), says=(PILOT,)),
    Story(
        "two taken at once",
        (TAKEN, told(after("uav2", "pilot "), "uav3:pilot={hold}"), PILOT_LANDS,
         told(after("uav2", "pilot ", 70), "uav3:pilot=RTL")),
        says=(PILOT, r"uav3: .*with its pilot"),
    ),
    Story(
        "everybody taken at once",
        (told(on_segment("uav2"), "all:pilot={hold}"), told(after("uav2", "pilot ", 40), "all:pilot=RTL")),
        says=(PILOT, r"uav1: .*with its pilot", r"uav3: .*with its pilot"), completes=False,
    ),
    Story(
        "switched to and fro, eight times in forty seconds",
        (TAKEN, *(
            told(after("uav2", "pilot ", 5.0 * number), "uav2:pilot={mission}" if number % 2 else "uav2:pilot={hold}")
            for number in range(1, 9)
        ), told(after("uav2", "pilot ", 60), "uav2:pilot=RTL")),
        says=(PILOT,),
    ),
    Story("taken in a mode that drifts", (told(on_segment("uav2"), "uav2:pilot={soft}"), PILOT_LANDS), says=(PILOT,)),
    Story("a stick is moved", (told(on_segment("uav2"), "uav2:sticks"),
        told(first(after("uav2", "pilot ", 20)), "uav2:pilot={mission}"),
        wants(after("uav2", "pilot ", 25), Action.INCLUDE, "uav2"))),
    Story("another station sends it home", (told(on_segment("uav2"), "uav2:station=RTL"),)),
    Story(
        "another station stops it, and sends it on",
        (told(on_segment("uav2"), "uav2:station={pause}"),
         told(after("uav2", "station ", 45), "uav2:station={mission}"),
         wants(after("uav2", "station ", 50), Action.INCLUDE, "uav2")),
    ),
    Story(
        "taken, and the crew wants it home after all",
        (TAKEN, wants(after("uav2", "pilot ", 15), Action.RETURN, "uav2")),
        says=(PILOT,),
    ),
    Story(
        "taken, and the crew thinks twice",
        (TAKEN, wants(after("uav2", "pilot ", 15), Action.RETURN, "uav2", sure=False), PILOT_LANDS),
        says=(PILOT,),
    ),
    Story(
        "taken, and everybody is sent home",
        (TAKEN, wants(after("uav2", "pilot ", 15), Action.ABORT), PILOT_LANDS),
        says=(PILOT,), completes=False,
    ),
    Story(
        "taken while it holds",
        (wants(on_segment("uav2"), Action.HOLD, "uav2"), told(on_segment("uav3"), "uav2:pilot={hold}"),
         told(after("uav2", "pilot ", 40), "uav2:pilot=RTL")),
        says=(PILOT,),
    ),
)  # fmt: skip

EMERGENCIES = (
    Story("an empty battery lands it on its way", (told(on_segment("uav2"), "uav2:emergency"),), says=(DOWN,)),
    Story("an empty battery brings it home", (told(on_segment("uav2"), "uav2:emergency=RTL"),)),
    Story(
        "held by its pilot while an empty battery is about to land it",
        (told(on_segment("uav2"), "uav2:emergency"), told(after("uav2", "failsafe ", 2), "uav2:pilot={pause}"),
         told(after("uav2", "failsafe ", 40), "uav2:pilot=LAND")),
        says=(r"uav2: .*not commanded from here",),
    ),
    Story(
        "held by the crew while an empty battery is about to land it",
        (wants(on_segment("uav2"), Action.HOLD, "uav2"), told(on_segment("uav3"), "uav2:emergency")),
        says=(DOWN,),
    ),
    Story("an empty battery over its own pad", (told(low("uav1", 18.0), "uav1:emergency"),)),
    Story("silent for 18 s in its landing", (told(low("uav1", 19.0), "uav1:silent=18s"),)),
    Story(
        "an empty battery during a re-plan",
        (crashed("uav3"), told(solving, "uav2:emergency")),
        says=(DOWN,), solve_s=4.0,
    ),
    Story("outside its fence", (told(on_segment("uav2"), "uav2:fence"),), says=(r"uav2: .*[Ff]ence",)),
    Story(
        "it loses its GPS",
        (told(on_segment("uav2"), "uav2:gps"),),
        says=(r"uav2: GPS lost", r"uav2: .*down: last GPS fix"), never_says=(r"uav2: .*down at",),
    ),
    Story("it does not know where it is", (told(on_segment("uav2"), "uav2:ekf"),), says=(DOWN,)),
    Story("silent until its failsafe brings it home", (told(on_segment("uav2"), "uav2:silent=40s"),)),
    Story(
        "held, and home by its own failsafe",
        (wants(on_segment("uav2"), Action.HOLD, "uav2"), told(on_segment("uav3"), "uav2:silent=40s")),
    ),
    Story(
        "everybody silent, one is heard before the others",
        (told(on_segment("uav2"), "uav1:silent=15s"), told(on_segment("uav2"), "uav2:silent=50s"),
         told(on_segment("uav2"), "uav3:silent=50s")),
        completes=False,
    ),
    Story(
        "everybody home by its own failsafe, and nobody is asked to fly again",
        (told(on_segment("uav2"), "all:silent=40s"),),
        completes=False,
    ),
    Story(
        "everybody home by its own failsafe, and the crew sends them again",
        (told(on_segment("uav2"), "all:silent=40s"),),
        offers=Answers.YES,
    ),
)  # fmt: skip

GROUND = (
    Story("a kill switch in the take-off", (told(high("uav2", 2.5), "uav2:kill"),), never_says=("uav2: landed",)),
    Story("a kill switch in flight", (told(on_segment("uav2"), "uav2:kill"),), never_says=("uav2: landed",)),
    Story("a kill switch in the landing", (told(low("uav1", 2.5), "uav1:kill"),)),
    Story("killed and started anew on its pad", (told(on_segment("uav2"), "uav2:reboot=pad"),),
        never_says=("uav2: landed",)),
    Story("started anew after its landing", (told(after("uav1", "landed", 5), "uav1:reboot"),), fleet=LONG),
    Story(
        "a loss with somebody home early, and nobody answers",
        (told(after("uav1", "disarmed", 5), "uav2:crash"),),
        fleet=LONG, completes=False,
    ),
    Story(
        "a loss with somebody home early, who is sent again",
        (told(after("uav1", "disarmed", 5), "uav2:crash"),),
        fleet=LONG, offers=Answers.YES,
    ),
    Story("late to start", (told(at(0.0), "uav3:reboot"),), offers=Answers.YES),
    Story(
        "two losses at once",
        (told(at(70.0), "uav2:crash"), told(at(70.0), "uav3:silent")),
        says=(r"(?s)re-plan .*uav2.*uav3|re-plan .*uav3.*uav2",),
    ),
)  # fmt: skip

WRECKS = (
    Story("it lies on its back, armed", (told(on_segment("uav2"), "uav2:wreck"),), says=(DOWN,)),
    Story(
        "it lies on its back, and the crew disarms it",
        (told(on_segment("uav2"), "uav2:wreck"), wants(after("uav2", "wreck", 40), Action.DISARM, "uav2")),
        says=(DOWN,),
    ),
    Story(
        "it falls on its way home",
        (wants(on_segment("uav2"), Action.RETURN, "uav2"), told(after("uav2", "mode R", 12), "uav2:wreck")),
        says=(DOWN,),
    ),
    Story(
        "it loses thrust, and sinks to the ground in its mission",
        (told(on_segment("uav2"), "uav2:weak=0.7"),),
        says=(r"uav2: interruption, sinks at .* below its mission; cannot hold height", DOWN),
        never_says=("RTL commanded", "uav2: landed"),
    ),
    Story(
        "it loses thrust, and its pilot lands it",
        (told(on_segment("uav2"), "uav2:weak=0.6"), told(after("uav2", "fault ", 9), "uav2:pilot=LAND")),
        says=(r"uav2: interruption, sinks at", PILOT),
    ),
    Story("it falls in its pilot's hands", (TAKEN, told(after("uav2", "pilot ", 15), "uav2:wreck")), says=(DOWN,)),
    Story(
        "told to return with a weak battery, down on its way",
        (told(on_segment("uav2"), "uav2:battery-step=60"), told(after("uav2", "fault ", 25), "uav2:emergency")),
        says=(DOWN,),
    ),
    Story(
        "it falls while another one is taken",
        (TAKEN, told(after("uav2", "pilot ", 10), "uav3:wreck"), PILOT_LANDS),
        says=(PILOT, r"uav3: .*down at"),
    ),
)  # fmt: skip

STORIES = (*TAKEOVERS, *EMERGENCIES, *GROUND, *WRECKS)

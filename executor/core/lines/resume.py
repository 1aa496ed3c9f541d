"""Lines about resuming after a silence of a vehicle, or an absence of the ground station."""

from executor.core.interface.commands import CrewLine, Level

INFO, WARNING, _ = Level

RUNS_AGAIN = CrewLine(WARNING, "the ground station runs again, after {away_s:.0f} s")
NOTE = CrewLine(WARNING, "{note}")
SILENT = CrewLine(WARNING, "{vehicle}: does not answer yet")
NO_ANSWER = "it does not answer"
OTHER_MISSION = "mission on board differs from the uploaded one from item {item} on"
PAST_NEW_PART = "its mission on board is a mix of two, and it is past the new part"
UPLOADED_AGAIN = CrewLine(
    WARNING, "{vehicle}: the new mission of re-plan {revision} is incomplete on board; uploading it again"
)
AT_END = "{vehicle}: reached the end of its partly uploaded mission"
BROUGHT_HOME = CrewLine(WARNING, "{trigger}; it is brought home")
FLOWN_BY_OTHERS = "others have flown {segments} of its new mission by now"
WAS_ARMED = "was armed and had not taken off when the ground station went offline"
TRIED_AGAIN = CrewLine(INFO, "{vehicle}: had not started yet; trying again")
STAYS = CrewLine(WARNING, "{vehicle}: had not started yet; it stays on the ground")
HAS_FLOWN = CrewLine(
    INFO, "{vehicle}: its battery has lost {lost_pct:.0f} % since then: assumed to have flown and landed"
)
LANDED_BEFORE = "landed when its new mission came"
UNSTARTED_BEFORE = "had not started when its new mission came"

# Segments flown without contact.
INFERRED = CrewLine(INFO, "{vehicle}: flew {segments} during the outage, inferred from its clock and position")
NOT_COUNTED = CrewLine(WARNING, "{vehicle}: flight during the outage is not counted: {why}")
ASKS_FOR_PROOF = "the site requires proof by positions"
CLOCK_RESET = "its clock was reset"
DEAD_RECKONED = "its GPS was lost: its position is dead-reckoned"
TOOK = "it took {elapsed_s:.0f} s, expected {expected_s:.0f} s"
NOT_ON_MISSION = "it is no longer on its mission"
WENT_BACK = "its mission went back"
MODE_CHANGED = "its mode changed in the meantime"
OFF_TRACK = "it is {away_m:.0f} m off its track"
IN_OTHER_HANDS = "it is under other control"
FOREIGN_MISSION = "it may carry another mission"
JUMPED = "its position jumped"
TOO_SHORT = "{elapsed_s:.0f} s is too short for its leg of {expected_s:.0f} s"
USE_UNKNOWN = "its consumption is not known"
USED = "it used {used_pct:.0f} %, expected {expected_pct:.0f} %"
OFF_PAD = "it is not on its pad"
CAME_HOME = "it returned without a command"
PILOT_LANDED = "its pilot may have landed it"
FAILSAFE_LANDED = "its own failsafe may have returned it"

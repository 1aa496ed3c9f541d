"""Lines about re-plans: trigger, gain, changed missions, segments left over."""

from executor.core.interface.commands import CrewLine, Level

INFO, WARNING, FAULT = Level

# Triggers, named in the re-plan's first line.
NOT_PROVEN = "inspection not proven: {segments}"
WITHOUT_VEHICLE = "assigned to no vehicle: {segments}"
ANSWERS = "{vehicle}: answers again"
NOT_GIVEN = "{vehicle}: {reason}"

BEGINS = CrewLine(INFO, "re-plan {revision}: {segments} ({trigger}); planning for {vehicles}")
PROOF_LEFT = CrewLine(WARNING, "inspection of some segments not proven; left for later")
NOBODY_ALOFT = CrewLine(WARNING, "no vehicle in the air can take over {segments}")
NOBODY_LEFT = CrewLine(WARNING, "no vehicle is left to inspect {segments}")

# The gain.
FAILED = CrewLine(WARNING, "re-plan {revision} failed: {reason}; trying again")
TOO_LATE = CrewLine(INFO, "re-plan {revision} came too late for {vehicles}; planning again")
FOUND = CrewLine(INFO, "re-plan {revision} found in {solve_s:.2f} s{gained}; new missions for {vehicles}")
NO_VEHICLE = "no vehicle"
NO_GAIN = "no improvement over the missions on board"
LONGEST = "longest route now {longest_s:.0f} s"
RECOVERED = "{segments} recovered"
LENGTH_RECOVERED = "{length_m:.0f} m of the line recovered"
TAKEN_OVER = "{segments} taken over from the next flight"
MOVED_BACK = "{segments} moved back to the next flight"
LIMITED = "limited by remaining battery; {longest}"
SHORTER = "{longest} instead of {carried_s:.0f} s"
NO_DUPLICATES = "duplicate segments removed; {longest}"
BUDGET_SHORT = CrewLine(WARNING, "{vehicles}: not enough battery for its whole mission")
BUDGETS_SHORT = CrewLine(WARNING, "{vehicles}: not enough battery for their whole missions")
NOT_COVERED = CrewLine(WARNING, "remaining battery does not cover {segments}")

# Uploads of its missions.
LATE = CrewLine(INFO, "{vehicle}: {why}; re-plan {revision} is planned again for it")
FLEW_ON = "moved on before its new mission arrived"
LEFT_MISSION = "left its mission before the new one arrived"
CONFLICTS = "its path conflicts with others' parts of the line ({near})"
ON_BOARD = CrewLine(INFO, "{vehicle}: new mission on board, {to_go}{fence}")
TO_GO = "{segments} to go"
NOTHING_TO_GO = "no segment left, returning"
FENCE_WIDENED = "; fence widened first"
UPLOAD_FAILED = CrewLine(
    WARNING, "{vehicle}: upload of its new mission failed ({reason}); re-planning without it{how_long}"
)
UNTIL_ANSWER = " until it answers again"
REST_OF_FLIGHT = " for the rest of the flight"
ANSWERS_AGAIN = CrewLine(INFO, "{trigger}; re-planning with it")
STAYS_UNCLEARED = CrewLine(WARNING, "{vehicle}: stays on the ground: take-off clearance expired")
MIXED = "its mission on board is a mix of two"
MAY_BE_MIXED = "its mission on board may be a mix of two"
SORTIE_PLAN = "{trigger}, plan {revision},"
REPLAN = "re-plan {revision:d}"
ENDED = CrewLine(INFO, "{plan} is on board")
ENDED_AFTER = CrewLine(INFO, "{plan} is on board after {since_s:.1f} s")
ENDED_WITHOUT = CrewLine(INFO, "{plan} ended; not uploaded to {vehicles}")
ENDED_SAME = CrewLine(INFO, "{plan} ended; no mission has changed")

# Lower missions, with nothing open.
LOWER = CrewLine(INFO, "{vehicle}: airspace at {segments} is free; new mission at inspection height")
AGAIN_ALOFT = CrewLine(INFO, "{vehicle}: re-inspects {segments} at inspection height; new mission before it returns")
AGAIN_FROM_PAD = CrewLine(INFO, "{vehicle}: re-inspects {segments} at inspection height; takes off after upload")

# Vehicles that leave the plan.
LEAVES = CrewLine(FAULT, "{parts}")
FAULT_TRIGGER = "{vehicle}: {kind}, {why}"
LINK_TRIGGER = "{vehicle}: {why}"
DISARM = "disarm commanded"
RTL = "RTL commanded"
RTL_WAITS = "no link; RTL will be commanded as soon as the link is back"
LANDS_ON_PAD = "over its pad, landing commanded"
TO_REASSIGN = "{segments} to be reassigned"
FOR_NOBODY = "{segments} assigned to no vehicle"

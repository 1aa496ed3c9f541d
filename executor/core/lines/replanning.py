"""Lines about re-plans: why one begins, what it gains, whose missions change, and what is left over."""

from executor.core.interface.commands import CrewLine, Level

# Why: named in the line of the re-plan that begins.
NOT_PROVEN = "inspection not proven: {segments}"
WITHOUT_VEHICLE = "assigned to no vehicle: {segments}"
LINK_REGAINED = "{vehicle}: link regained"
ANSWERS = "{vehicle}: answers again"
NOT_GIVEN = "{vehicle}: {reason}"

BEGINS = CrewLine(Level.INFO, "re-plan {revision}: {segments} ({trigger}); planning for {vehicles}")
PROOF_LEFT = CrewLine(Level.WARNING, "inspection of some segments not proven; left for later")
NOBODY_ALOFT = CrewLine(Level.WARNING, "no vehicle in the air can take over {segments}")
NOBODY_LEFT = CrewLine(Level.WARNING, "no vehicle is left to inspect {segments}")

# What it gains.
FAILED = CrewLine(Level.WARNING, "re-plan {revision} failed: {reason}; trying again")
TOO_LATE = CrewLine(Level.INFO, "re-plan {revision} came too late for {vehicles}; planning again")
FOUND = CrewLine(Level.INFO, "re-plan {revision} found in {solve_s:.2f} s{gained}; new missions for {vehicles}")
NO_VEHICLE = "no vehicle"
NO_GAIN = "no improvement over the missions on board"
LONGEST = "longest route now {longest_s:.0f} s"
RECOVERED = "{segments} recovered"
LENGTH_RECOVERED = "{length_m:.0f} m of the line recovered"
TAKEN_OVER = "{segments} taken over from the next sortie"
MOVED_BACK = "{segments} moved back to the next sortie"
LIMITED = "limited by remaining battery; {longest}"
SHORTER = "{longest} instead of {carried_s:.0f} s"
NO_DUPLICATES = "duplicate segments removed; {longest}"
BUDGET_SHORT = CrewLine(Level.WARNING, "{vehicles}: not enough battery for its whole mission")
BUDGETS_SHORT = CrewLine(Level.WARNING, "{vehicles}: not enough battery for their whole missions")
NOT_COVERED = CrewLine(Level.WARNING, "remaining battery does not cover {segments}")

# Its missions go on board.
LATE = CrewLine(Level.INFO, "{vehicle}: {why}; re-plan {revision} is planned again for it")
FLEW_ON = "moved on before its new mission arrived"
LEFT_MISSION = "left its mission before the new one arrived"
CONFLICTS = "its path conflicts with others' parts of the line ({near})"
ON_BOARD = CrewLine(Level.INFO, "{vehicle}: new mission on board, {to_go}{fence}")
TO_GO = "{segments} to go"
NOTHING_TO_GO = "no segment left, returning"
FENCE_WIDENED = "; fence widened first"
UPLOAD_FAILED = CrewLine(
    Level.WARNING, "{vehicle}: upload of its new mission failed ({reason}); re-planning without it{how_long}"
)
UNTIL_ANSWER = " until it answers again"
REST_OF_FLIGHT = " for the rest of the flight"
ANSWERS_AGAIN = CrewLine(Level.INFO, "{trigger}; re-planning with it")
STAYS_UNCLEARED = CrewLine(Level.WARNING, "{vehicle}: stays on the ground: take-off clearance expired")
MIXED = "its mission on board is a mix of two"
MAY_BE_MIXED = "its mission on board may be a mix of two"
SORTIE_PLAN = "{trigger}, plan {revision},"
REPLAN = "re-plan {revision}"
ENDED = CrewLine(Level.INFO, "{plan} is on board")
ENDED_AFTER = CrewLine(Level.INFO, "{plan} is on board after {since_s:.1f} s")
ENDED_WITHOUT = CrewLine(Level.INFO, "{plan} ended; not uploaded to {vehicles}")
ENDED_SAME = CrewLine(Level.INFO, "{plan} ended; no mission has changed")

# Nearer to the line, where nothing is open.
LOWER = CrewLine(Level.INFO, "{vehicle}: airspace at {segments} is free; new mission at inspection height")
AGAIN_ALOFT = CrewLine(
    Level.INFO, "{vehicle}: re-inspects {segments} at inspection height; new mission before it returns"
)
AGAIN_FROM_PAD = CrewLine(Level.INFO, "{vehicle}: re-inspects {segments} at inspection height; takes off after upload")

# A vehicle leaves the plan.
LEAVES = CrewLine(Level.FAULT, "{parts}")
FAULT = "{vehicle}: {kind}, {why}"
LINK_FAULT = "{vehicle}: {why}"
PILOT_HAS_IT = "with its pilot, not commanded"
DISARM = "disarm commanded"
RTL = "RTL commanded"
RTL_WAITS = "no link; RTL will be commanded as soon as the link is back"
LANDS_ON_PAD = "over its pad, landing commanded"
TO_REASSIGN = "{segments} to be reassigned"
FOR_NOBODY = "{segments} assigned to no vehicle"

"""Lines about sorties: take-off offers, turnarounds, packs, hours, bases and kill switches."""

from executor.core.interface.commands import CrewLine, Level
from executor.core.interface.intents import IntentReason
from executor.core.lines import takeoff

INFO, WARNING, FAULT = Level

# Offers to the crew.
OFFER = CrewLine(FAULT, "{offer} Use include for each that may take off")
OFFERED = "{vehicles} can {work} ({names}). {pads} clear of people?"
TAKE_OVER = "take over {segments}"
RE_INSPECT = "re-inspect {segments} at inspection height"
ONE_PAD = "Is its pad"
PADS = "Are their pads"
DISTANT = "{segments} {was} inspected above inspection height only"
EXPIRED = CrewLine(WARNING, "no vehicle was cleared for take-off within {offer_s:g} s; {left}")
LEFT_OVER = "{segments} {is_} left over"
BACK_IN_SERVICE = "{vehicle}: back in service with {left_pct:.0f} % in its battery"

# No take-off.
KILL_SWITCH = CrewLine(FAULT, "{vehicle}: its kill switch is on; no start until included")
KILL_SWITCH_TRIGGER = "{vehicle}: its kill switch is on"
CLOSED_IN_START = "its base was closed during its start"
BASE_IS_CLOSED = "base {base} is closed"

# Turnaround.
PARAMETERS_SET = CrewLine(INFO, "{vehicle}: parameters set again after reboot: {changes}")
PARAMETERS_MOVED = CrewLine(INFO, "{vehicle}: parameters set for its pad at another base: {changes}")
CHECKS_PASSED = CrewLine(INFO, "{vehicle}: its checks have passed: {pack}{more}")
BUDGET = "; its budget is {budget_pct:.0f} % instead of {planned_pct:g} %"
REPLANNING_WITH_IT = "; re-planning with it"
PASSED_REPLANNING = "its checks have passed; re-planning with it"
ON_BOARD = "its next sortie is on board; it starts"
NAMED_PACK = "pack {label}"
ITS_PACK = "its pack"
REPORTS = " reports {left_pct:.0f} %"
NOT_CLEARED = CrewLine(WARNING, "{vehicle}: not cleared for take-off: {why}; repeat `swap` when fixed")
NO_BATTERY_STATE = "no battery state"
PARAMETERS_DIFFER = "its parameters differ from those set for the flight: {change}"
FAILSAFE_DIFFERS = "its link failsafe is not the one before the flight: {failsafe}"
PACK_POOR = "{pack}: too close to its reserve of {reserve_pct:g} %"
NOT_IN_BUDGET = "no open segment is within its budget of {budget_pct:.0f} %"
NOT_IN_HOURS = "no open segment can be inspected in the {left} that are left of its hours"
NO_SEGMENT = "no segment is open for it"
TOO_LATE = "its mission was uploaded too late"
UPLOAD_FAILED = "its upload failed ({reason})"
BASE_CLOSED = IntentReason.BASE_CLOSED, "its base is closed"
ELSEWHERE = IntentReason.OVERTAKEN, "it is {stage} now"
AWAY_MEANWHILE = "its turnaround was under way when the ground station went offline"
REBOOTED = IntentReason.NOT_READY, takeoff.HAS_REBOOTED
CLOCK_FELL_BACK = IntentReason.NOT_READY, takeoff.CLOCK_FELL_BACK
PLACELESS = IntentReason.NOT_READY, "no position for {placeless_s:g} s: it may have rebooted since its checks"
UNFINISHED = IntentReason.UNANSWERED, "its checks did not finish"
EXPIRED_CLEARANCE = (
    IntentReason.OVERTAKEN, "it could not start within {cleared_s:g} s, and its pad may not be clear any more"
)  # fmt: skip

# Waiting for a sortie, and its start.
AWAITED = "waiting for pack confirmation: sortie {number}, {segments}"
AWAITED_OPEN = "waiting for pack confirmation: {segments} open"
WITH_PACKS = "{waits}; by the plan's count {packs}"
PACKS_LEFT = "{packs} left at base {base}"
NO_PACK_UNTIL = "no charged pack is left at base {base} until T+{until}"
NO_PACK_YET = "no charged pack is left at base {base} until one has landed and is charged"
NO_PACK_LEFT = "no charged pack is left at base {base} for the rest of the day"
SWAP_WITHOUT_PACK = CrewLine(WARNING, "{vehicle}: by the plan's count {packs}")
PACKS_GONE = CrewLine(WARNING, "by the plan's count {packs}; {segments} of its later sorties open for those of others")
NOT_IN_NEXT_HOURS = "its next sortie of {lasts} does not end within its hours; its next hours begin at T+{later}"
NO_HOURS = "its next sortie of {lasts} does not end within its hours; it has no hours after now"
OPENED = CrewLine(WARNING, "{vehicle}: {segments} of its later sorties open for the sorties of others")
TAKES_OVER = CrewLine(INFO, "{vehicle}: takes over the last sortie of {giver}, {segments}")
SORTIE = "{vehicle}: sortie {number}"
AS_PLANNED = CrewLine(INFO, "{trigger}: {segments}, as planned{to}")
TO_BASE = "; it lands at base {base}"
REPLANNED = CrewLine(INFO, "{trigger}: re-planned for its budget{to}")

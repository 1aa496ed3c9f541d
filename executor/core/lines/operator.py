"""Lines about an operator's intents: refusals, confirmations and outcomes."""

from executor.core.interface.commands import CrewLine, Level
from executor.core.interface.intents import IntentReason
from executor.core.lines import pilot, position, replanning

INFO, WARNING, _ = Level

# Refusals. Their codes also go to the page and over MQTT.
OVER = IntentReason.OVER, "the flight is over"
NOT_BEGUN = IntentReason.NOT_BEGUN, "the flight has not begun"
BEGUN = IntentReason.BEGUN, "the flight has begun"
NOT_ASKED = IntentReason.NOT_ASKED, "that question is not pending"
ABORTED = IntentReason.ABORTED, pilot.ABORTED
VEHICLE_MISSING = IntentReason.VEHICLE_MISSING, "{action} needs a vehicle: one of {vehicles}"
VEHICLE_UNKNOWN = IntentReason.VEHICLE_UNKNOWN, "there is no vehicle {vehicle!r}: expected one of {vehicles}"
FOR_FLEET = IntentReason.VEHICLE_UNEXPECTED, "{action} is for the whole fleet; expected no vehicle"
FOR_BASE = IntentReason.VEHICLE_UNEXPECTED, "{action} is for a base; expected no vehicle"
BASE_UNKNOWN = IntentReason.BASE_UNKNOWN, "there is no base {base!r}: expected one of {bases}"
NO_BASES = IntentReason.BASE_UNKNOWN, "there is no base {base!r}: this flight is not a day plan"
BASE_SHUT = IntentReason.BASE_CLOSED, "it is closed already"
BASE_OPEN = IntentReason.BASE_OPEN, "it is not closed"
PACKS_UNCOUNTED = IntentReason.PACKS_UNCOUNTED, "the plan does not count the packs of this base, or no number was given"
NEVER_HEARD = IntentReason.NEVER_HEARD, "no message was ever received from it"
LINK_STALE = IntentReason.LINK_STALE, "no message from it for {age_s:.0f} s"
LINK_LOST = IntentReason.LINK_LOST, replanning.RTL_WAITS
NOT_ON_MISSION = IntentReason.NOT_ON_MISSION, "it is not on its mission, it is {stage}"
ON_HOLD = IntentReason.ON_HOLD, "it holds already"
NOT_ON_HOLD = IntentReason.NOT_ON_HOLD, "it is not on hold, it is {stage}"
UPLOADING = IntentReason.UPLOADING, "mission upload in progress; try again in a moment"
CLIMBING = IntentReason.CLIMBING, "it is climbing from its pad; below its layer it could conflict with others"
IN_LANDING = IntentReason.LANDING, "it is landing"
LANDING = IntentReason.LANDING, "it is landing already"
RETURNING = IntentReason.RETURNING, "it is returning already"
ON_GROUND = IntentReason.ON_GROUND, "it is on the ground"
NOT_FLYING = IntentReason.NOT_FLYING, "it is not flying, it is {stage}"
POSITION_UNKNOWN = IntentReason.POSITION_UNKNOWN, position.UNKNOWN
NEAR_LINE = IntentReason.NEAR_LINE, "it is {line_m:.0f} m from the line, too near to land safely; use return"
OTHER_PAD = IntentReason.OTHER_PAD, "it would land on the pad of {other}"
PULLED_OUT = IntentReason.OUT_OF_PLAN, "it is out of the plan; return or land it"
OUT_OF_PLAN = IntentReason.OUT_OF_PLAN, "it is out of the plan already"
AT_FAULT = IntentReason.OUT_OF_PLAN, "it is out of the plan already: {fault}"
GIVEN_AWAY = IntentReason.OUT_OF_PLAN, "it is out of the plan: {fault}"
WITH_PILOT = IntentReason.WITH_PILOT, "it is with its pilot"
PILOT_RESUMES = IntentReason.WITH_PILOT, "it is with its pilot: the pilot must set mission mode; then include it"
PILOT_FLIES = IntentReason.WITH_PILOT, "it is with its pilot: the pilot must set mission mode first"
NOT_AT_REST = IntentReason.NOT_AT_REST, "it is not on the ground with its motors off, it is {stage}"
NOT_ON_BASE = IntentReason.NOT_AT_REST, "it is not on the ground at its base, it is {stage}"
TILTED = IntentReason.TILTED, "it is tilted, it may have tipped over"
BASE_CLOSED = IntentReason.BASE_CLOSED, "its base is closed; open it first"
CLEARED = IntentReason.CLEARED, "it is cleared for take-off already"
UNCLEARED = IntentReason.UNCONFIRMED, "it is not cleared for take-off"
DECLINED = IntentReason.NOT_READY, "it did not accept its last mission"
FLOWN_ALREADY = IntentReason.OVER, "it has landed, and no vehicle takes off twice in this flight"
IN_PLAN = IntentReason.IN_PLAN, "it is in the plan already, and no segment is left over"
OFF_PAD = IntentReason.OFF_PAD, "it is not on its pad, where its climb and landing are planned"
BATTERY_LOW = IntentReason.BATTERY_LOW, "its battery is {left}; expected more than its reserve of {reserve_pct:g} %"
SWAPPING = IntentReason.SWAPPING, "its turnaround is under way already"
NO_SORTIE = IntentReason.NOTHING_TO_PLAN, "no open segment for another sortie"
OUT_OF_HOURS = IntentReason.OUT_OF_HOURS, "{conflict}"
NOT_DOWN = IntentReason.NOT_DOWN, "it is not down, it is {stage}"
DISARMED = IntentReason.DISARMED, "its motors are off already"
REPLANNING = IntentReason.REPLANNING, "a re-plan is under way"
NO_SURVIVOR = IntentReason.NO_VEHICLE, "no vehicle can take a new route now"
NOTHING_TO_REPLAN = IntentReason.NOTHING_TO_PLAN, "nothing is left to re-plan"
ALL_PROVEN = IntentReason.NOTHING_TO_PLAN, "every counted segment is already proven by positions"
NOBODY_FLIES = IntentReason.NO_VEHICLE, "no vehicle is on a mission"
SEGMENT_UNKNOWN = IntentReason.ASSET_UNKNOWN, "there is no segment {asset}: expected 0 to {last}"
ASSET_UNKNOWN = (
    IntentReason.ASSET_UNKNOWN,
    "there is no asset {asset!r}: expected its name as the page and the plan have it, or its segment's number",
)
NEVER_FLOWN = IntentReason.ASSET_NEVER_FLOWN, "{asset} is never flown: it {why}"
NOT_ASKED_FOR = IntentReason.ASSET_NEVER_FLOWN, "{asset} is never flown: it is no part of this flight"
NO_CAMERA = IntentReason.ASSET_NEVER_FLOWN, "{asset} is never flown: no vehicle has a camera {cameras} that works"
ASSET_OPEN = IntentReason.ASSET_OPEN, "{asset} is open already"

# Confirmations.
UNCONFIRMED = "needs confirmation"
MAY_DISARM = "{vehicle} is down at {place}: force its motors off? If it is still flying, it will fall"
MAY_SWAP = "{vehicle} will take off once its checks pass. {installed}, and its pad clear of people?"
IS_PACK_INSTALLED = "Is pack {pack} installed"
IS_ANY_PACK_INSTALLED = "Is another pack installed, or its own charged"
MAY_INCLUDE = "{vehicle} may take off once its mission is uploaded. Is its pad clear of people?"
MAY_TAKE_CONTROL = "{vehicle} is with its pilot. Take control of it? Speak to the pilot first"

# Orders that follow.
REFUSED = CrewLine(WARNING, "{source} asks: {asked}; refused: {reason}")
ORDERED = CrewLine(INFO, "{source} asks: {asked}; {text}")
HOLD = "hold commanded"
RESUME = "resume commanded"
RETURN = "{begins}; it stays on the ground until included; its segments are to be reassigned"
RETURN_BEGINS = replanning.RTL
LANDING_BEGINS = "landing commanded"
RETURN_ORDERED = "return ordered"
RETURNS = "{vehicle}: returns by the operator's order"
LAND = "landing commanded where it is; its segments are to be reassigned"
LANDS = "{vehicle}: lands by the operator's order"
LANDS_WHERE_IT_WAS = "lands where it was, by the operator's order"
STAYS_ON_GROUND = "it stays on the ground"
EXCLUDED_ON_GROUND = "{vehicle}: excluded on the ground"
STAYS_WITH_PILOT = "it stays with its pilot; its segments are to be reassigned"
EXCLUDED_WITH_PILOT = "{vehicle}: excluded, with its pilot"
EXCLUDED = "excluded by the operator"
TAKEN_OUT = "taken out of the plan"
TAKEN_OUT_RETURNS = "taken out of the plan, RTL commanded"
NOBODY_IS_LEFT = "; no other vehicle is left to inspect {count} segments"
INCLUDED = "included"
INCLUDED_REPLANNING = "included; re-planning with it"
INCLUDED_AGAIN = "included; re-inspecting segments at inspection height"
INCLUDED_IDLE = "included. Nothing is unassigned; use re-plan to redistribute"
PACK_INSTALLED = "pack {pack} installed; running checks before the next sortie"
ANY_PACK_INSTALLED = "a pack without an id installed; running checks before the next sortie"
BASE_IS_CLOSED = "no take-off from it until it is opened"
STILL_TO_LAND = "; still to land there: {vehicles}"
PACKS_COUNTED = "{packs} at base {base}, by the crew's count"
BASE_IS_OPENED = "take-offs from it are allowed again; use `swap`"
DISARM = "forced disarm commanded"
YES = "yes"
REPLAN = "all open segments are re-planned"
REPLAN_REQUESTED = "requested by {source}"
PROVE = "re-flying {segments} for proof"
PROOF_REQUESTED = "proof requested by {source}"
REINSPECT = "{segments} reopened for re-inspection"
REINSPECTION_REQUESTED = "re-inspection of {segments} requested by {source}"
ABORT = "all vehicles ordered to return"
ABORT_UNHEARD = "no link to any vehicle; RTL will be commanded as soon as a link is back"
ABORT_IDLE = "no vehicle is on its mission; no further take-off"
RECALLED = CrewLine(WARNING, "flight aborted by the operator, all vehicles return")
PILOT_NOT_RECALLED = CrewLine(WARNING, "{vehicle}: is with its pilot; RTL not commanded")

# Outcomes.
NOT_FOLLOWED = CrewLine(WARNING, "{vehicle}: did not follow the order: {action} ({reason})")
FOLLOWED = CrewLine(INFO, "{vehicle}: {does}{note}")
COMES_HOME = CrewLine(INFO, "{vehicle}: returns")
RTL_REFUSED = CrewLine(WARNING, "{vehicle}: refused RTL ({reason})")
RTL_UNANSWERED = CrewLine(WARNING, "{vehicle}: did not acknowledge RTL ({reason})")
VEHICLE_LOST = IntentReason.LINK_LOST, "link to {vehicle} lost"
SUPERSEDED = IntentReason.OVERTAKEN, "superseded: {vehicle} is {stage}{why}"
UNANSWERED = IntentReason.UNANSWERED, "{vehicle} did not answer"
REPLAN_ON_BOARD = "re-plan {revision} is on board"
LEFT_OVER = ", {count} segments are left over"
NO_REPLAN = IntentReason.NOTHING_TO_PLAN, "nothing to plan, or no vehicle available"

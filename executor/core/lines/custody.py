"""Lines about which party controls a vehicle, why it is not commanded, and whose mission is on board."""

from executor.core.interface.commands import CrewLine, Level

WITH_PILOT = "with its pilot, not commanded"
KILL_SWITCH = "reports its kill switch on, not commanded"
COMING_HOME = "returning or landing by itself, not commanded"
CANNOT_CLIMB = "cannot hold height and RTL begins with a climb, not commanded: its pilot may land it"
LANDING_ON_PAD = "landing on its pad, not commanded"
LANDING = "landing, not commanded"
HOLDS_FIRST = "holding in its own failsafe; waiting for it to act"
OWN_FAILSAFE = "left to its own failsafe"
CROSSES_AREA = CrewLine(Level.WARNING, "{vehicle}: RTL will cross no-fly area {areas}")
DOES_NOT_FOLLOW = CrewLine(
    Level.WARNING, "{vehicle}: acknowledged the order but does not follow it; not commanded again"
)

MISSION_IS_OURS = CrewLine(Level.WARNING, "{vehicle}: reported a new mission; verified by read-back, it is ours")
MISSION_ON_BOARD = CrewLine(
    Level.INFO, "{vehicle}: its new mission of re-plan {revision} is on board after all, verified by read-back"
)
NO_MISSION = "none at all"
OTHER_TOTAL = "{items} items where ours has {ours}"
OTHER_ITEMS = "as many items as ours, but others"
UNREADABLE = "it reports a new one, which cannot be read"
READ_BACK_DIFFERS = "read-back differs from item {alike} on"

"""Lines about failsafes: the autopilot's own reports, and which party changed the mode."""

SAYS = "it says: {words}"
ALSO_SAYS = "; it says: {words}"
REPORTS = "reports {state}{says}"
STATES = {6: "an emergency", 8: "that its flight is terminated"}
"""MAV_STATE."""
MODE = "{mode} by its own failsafe{says}"
UNNAMED = "it does not say which"
MODE_OF_UNKNOWN = "{mode} by an unknown source"

ORDERED = "it was ordered"
ORDER_ACCEPTED = "an order to change its mode was accepted"
LAST_ITEM = "it was at its last item"
RECORDED = "its own record"
CRITICAL = "its HEARTBEAT is critical"
SWITCHED = "channel {channel} of its transmitter went from {was_us} to {now_us}"

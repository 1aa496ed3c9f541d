"""Lines about inspections and pictures that do not count."""

BESIDE_LINE = "{beside_m:.0f} m off the line"
NO_POSITION = "no position for {gap_s:.1f} s"
TURNED_BACK = "turned back"
FLOWN_AT = "flown at {speed_m_s:.1f} m/s"
TOO_FAST = "flown too fast"
WITHOUT_FIX = "flown without a GPS fix for more than {gap_s:g} s"

TAKEN_AGAIN = "taken again {later_s:.0f} s later"
TAKEN_WITHOUT_FIX = "taken without a GPS fix"
NOT_WANTED = "shows no span that needs it"
TAKEN_AT = "taken at {speed_m_s:.1f} m/s"
AIMED_BESIDE = "aimed {off_deg:.0f} degrees off target"

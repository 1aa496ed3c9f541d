"""Names of the parts on the command line."""

from enum import StrEnum


class PartName(StrEnum):
    """A part of the measurements."""

    CSUM = "csum"
    MTSP = "mtsp"
    EXACT = "exact"
    BOUNDS = "bounds"
    REPLAN = "replan"
    SCALE = "scale"
    START = "start"
    ONBOARD = "onboard"

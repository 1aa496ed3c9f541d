"""How the parts are called on the command line."""

from enum import StrEnum


class PartName(StrEnum):
    """What is measured."""

    CSUM = "csum"
    MTSP = "mtsp"
    EXACT = "exact"
    REPLAN = "replan"
    SCALE = "scale"
    START = "start"

"""Define the exceptions of the missions package.

MissionsError
├── NetworkError       a network file that cannot be used: names the file, the place in it and what was expected
├── AreaError          an area that cannot be used: names the file, the feature and what was expected
├── ElevationError     a raster of heights that cannot be used: names the file, the place in it and what was expected
├── BackgroundError    a picture of the ground that cannot be used
├── PlanFileError      a plan file that cannot be used
├── MissionFileError   a QGroundControl file that cannot be used
├── SafetyError        no heights or pads can keep this fleet apart over this network
└── EncodeError        a route that the autopilot's dialect cannot express
"""


class MissionsError(Exception):
    """Root of all exceptions that this package raises on purpose; the text is one line for the user."""


class NetworkError(MissionsError):
    """The network cannot be used."""


class AreaError(MissionsError):
    """The area cannot be used."""


class ElevationError(MissionsError):
    """The heights of the ground cannot be used."""


class BackgroundError(MissionsError):
    """The picture of the ground cannot be used."""


class PlanFileError(MissionsError):
    """The plan file cannot be used."""


class MissionFileError(MissionsError):
    """The QGroundControl file cannot be used."""


class SafetyError(MissionsError):
    """The fleet cannot be kept apart."""


class EncodeError(MissionsError):
    """The route cannot be encoded for the autopilot."""

"""The state of cameras: pictures, and the stretches of the line they show."""

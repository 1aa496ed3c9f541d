"""The state of the vehicles and of the flight."""

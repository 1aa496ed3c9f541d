"""What flights in virtual time are made of: vehicles and a ground station in one process, and a clock that jumps."""

"""Parts of flights in virtual time: vehicles and a ground station in one process, and a clock that jumps."""

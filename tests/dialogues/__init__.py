"""One scripted dialogue, held with every autopilot that there is: simulated here, real in tests/sitl."""

"""Read the logs that autopilots write on board."""

"""What is different between autopilots: their dialect of the mission protocol, modes and failsafes."""

"""Connect vehicles through MAVSDK, in this process."""

"""While vehicles fly: who controls them, faults, return home, climbs."""

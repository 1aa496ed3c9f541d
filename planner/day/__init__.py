"""Days of several trips: several depots, recharging between trips, vehicles lost one after another."""

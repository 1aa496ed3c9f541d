"""Who has a vehicle, and whose mission it carries: ours, its own failsafe's, a person's."""

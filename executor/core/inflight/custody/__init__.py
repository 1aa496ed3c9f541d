"""Which party controls a vehicle, and whose mission is on board: ours, its failsafe's, or a person's."""

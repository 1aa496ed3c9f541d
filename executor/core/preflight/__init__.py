"""What must be true before anything moves, and what is set on board for the flight."""

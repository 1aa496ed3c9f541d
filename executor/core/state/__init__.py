"""What is known of the vehicles and of the flight."""

"""What a flight was: its record read back, the report, the pictures."""

"""Re-plan after a loss: which survivors can take over which segments, and what the next loss would mean."""

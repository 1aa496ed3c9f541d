"""After a loss: who can take over what, and what the next loss would mean."""

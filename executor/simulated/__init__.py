"""A site's fleet as simulated vehicles, and what was done to them."""

"""A site's fleet as simulated vehicles, and the faults injected into it."""

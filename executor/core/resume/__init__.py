"""After a time in which nobody listened: what became of everything meanwhile."""

"""Index of a flight's pictures, and matching of memory cards' files to it."""

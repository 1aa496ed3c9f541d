"""Whether what was flown was seen, and what is wrong with cameras."""

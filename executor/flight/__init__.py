"""One flight, from the checklist to its report; what takes it up again, and what goes on beside it."""

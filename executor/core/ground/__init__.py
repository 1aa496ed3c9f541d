"""Who is in the plan: who leaves it, is taken out of it, or could join it."""

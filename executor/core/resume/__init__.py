"""Resume after a loss of contact: infer what happened meanwhile."""

"""A mutation run: small changes to the decisions, each of which some test should notice."""

"""Decide an operator's intents in flight: refused with a reason, or ordered and answered."""

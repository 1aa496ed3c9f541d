"""One outside thing each. Adapters know core, never one another."""

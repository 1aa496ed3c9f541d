"""Inputs and outputs of the core: messages, events, intents, commands, ports."""

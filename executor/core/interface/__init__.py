"""What comes in and goes out: messages, events, intents, commands, ports."""

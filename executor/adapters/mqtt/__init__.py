"""MQTT: what the flight looks like goes out, the operator's intents come in; nothing here delays a flight."""

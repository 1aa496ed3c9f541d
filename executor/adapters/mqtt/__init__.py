"""MQTT: publish the flight, take the operator's intents; nothing here delays a flight."""

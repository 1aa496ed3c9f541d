"""MQTT: publish the flight and accept the operator's intents; never delays a flight."""

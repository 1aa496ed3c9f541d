"""From the clearance by the crew until a vehicle flies its mission."""

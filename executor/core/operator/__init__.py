"""What the crew asks for in flight: refused with a reason, or ordered and answered."""

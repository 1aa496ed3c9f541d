"""What cameras are known to have seen: pictures, and which stretches of the line they show."""

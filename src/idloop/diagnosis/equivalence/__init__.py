"""Effects and models that no motion, or not this one, can separate."""

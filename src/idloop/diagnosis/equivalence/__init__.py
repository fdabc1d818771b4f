"""Effects that no motion, or not this one, tells apart."""

"""Search: one step of a diagnosis, its fits, pairs and non-local searches, and the ladder."""

"""Elements whose describing function is known in closed form, one per file."""

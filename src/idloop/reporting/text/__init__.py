"""Results in words and tables: the same for a terminal, a file and a notebook."""

"""Storage files: which belong to a bag, how they are packed, and what can be read of each."""

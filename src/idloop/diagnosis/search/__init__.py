"""The search for missing effects: one step, pairs, restarts far from the present model."""

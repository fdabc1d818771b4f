"""What the columns of a foreign log are: time, command, motion, units; each guess with its reason."""

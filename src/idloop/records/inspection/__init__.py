"""What is wrong with a recording, and what it can show, before anything is fitted."""

"""Behind the excitation node: the sequence that is sent, and experiments handed over."""

"""Which effects are worth a refit: candidates, score test, whether the motion follows the command."""

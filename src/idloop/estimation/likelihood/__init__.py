"""Maximum-likelihood fits to prediction errors, with a free disturbance and a noise model."""

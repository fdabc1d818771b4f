"""Evidence for an effect on unseen samples, by force balance and by prediction."""

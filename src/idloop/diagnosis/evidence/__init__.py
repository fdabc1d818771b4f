"""Evidence for an effect on samples that no fit has seen, by force balance and by prediction."""

"""The balance of forces along a measured motion, in weak form, and its maximum-likelihood fit."""

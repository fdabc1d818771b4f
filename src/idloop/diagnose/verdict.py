"""How a diagnosis may end: the words of its JSON."""

MISSING, ADEQUATE, UNKNOWN, NOT_EXCITED = "missing", "adequate", "unknown_structure", "not_excited"
# Verdicts after which the reader may take what is left for noise.
SAY_NOISE = (ADEQUATE, NOT_EXCITED)

"""How a diagnosis or a ladder ends, in the same words everywhere."""

from __future__ import annotations

# Of a ladder; a diagnosis that ends as missing has a best effect to name.
VERDICTS = {
    "adequate": "nothing significant is left",
    "unknown_structure": "what is left has a shape that no effect of the catalogue explains",
    "not_excited": "nothing significant is left, but this data cannot show everything",
    "missing": "stopped before the end",
}
MISSING = "an effect is missing"
# Verdicts after which the reader may take what is left for noise.
SAY_NOISE = ("adequate", "not_excited")

"""One node per file; each has a function ``make`` that builds it."""

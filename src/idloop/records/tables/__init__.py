"""CSV, MAT, NPZ and JSON files as records, by a mapping file."""

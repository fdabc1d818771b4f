"""A fleet of robots: joints identified bag by bag, kept in Parquet files, and compared with each other over time."""

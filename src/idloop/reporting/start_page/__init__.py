"""The page on which a log is dropped: what its columns are, and a first fit."""

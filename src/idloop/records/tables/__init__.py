"""Tables of any form as records, by a mapping file."""

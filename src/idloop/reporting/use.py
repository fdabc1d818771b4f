"""What data served for: fitted, or unseen by every fit; the two words that a reader meets."""

FITTED, UNSEEN = "fitted", "unseen"
# By the keys that the errors of a ladder's steps and the JSON documents have.
SAID = {"train": FITTED, "validation": UNSEEN}

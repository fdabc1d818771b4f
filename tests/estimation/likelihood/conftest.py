"""Models of the diagnosis."""

from tests.diagnosis.conftest import start

__all__ = ["start"]

"""The machines of the diagnosis."""

from tests.diagnose.conftest import start

__all__ = ["start"]

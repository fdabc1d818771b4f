"""`python -m idloop`: the command where its script is not on the path."""

from idloop.cli.main import main

main()

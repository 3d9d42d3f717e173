"""`python -m lagfmu` is the `lagfmu` command."""

from .cli.app import main

main()

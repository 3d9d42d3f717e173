"""`python -m lagfmu` is the `lagfmu` command."""

from .cli import main

main()

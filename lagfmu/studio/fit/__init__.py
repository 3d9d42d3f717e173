"""Which values of parameters explain what was measured."""

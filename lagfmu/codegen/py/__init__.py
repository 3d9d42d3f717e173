"""Python: the only place that prints Python."""

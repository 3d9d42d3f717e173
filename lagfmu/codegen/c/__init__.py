"""C99: the only place that prints C."""

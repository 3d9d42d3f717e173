"""Equations as mathematics, and the page inside an FMU."""

"""Equations as mathematics, and the page inside an FMU.

In: what was prepared.
Out: equations as mathematics, in HTML and in text.
Never knows: how an FMU runs.
"""

"""What the user writes: a mechanical system in SymPy, the scenes of its FMUs, its closed forms.

In: a system as its user writes it in SymPy, or a file of one.
Out: a checked `Model` and its scenes.
Never knows: how its equations are derived, solved or packaged.
"""

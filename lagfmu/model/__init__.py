"""What the user writes: a mechanical system in SymPy, the scenes of its FMUs, its closed forms."""

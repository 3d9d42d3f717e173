"""The options of each command, and the call.  What it needs is imported when it is called, so that
`lagfmu --help` does not wait for SymPy."""

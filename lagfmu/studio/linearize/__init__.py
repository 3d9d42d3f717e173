"""The linear system beside a state of an FMU, in coordinates that the constraints leave free."""

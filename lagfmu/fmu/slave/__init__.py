"""What travels in a python FMU, besides the engine: pythonfmu's slave, and the instance behind it."""

"""How an FMU stands the extremes: each probe is right, refused with a clear message, or wrong."""

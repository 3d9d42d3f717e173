"""What an FMU does, as one file to hand on."""

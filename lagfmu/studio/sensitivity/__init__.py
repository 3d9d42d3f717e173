"""What outputs at the end of a run depend on: by derivatives, and over ranges."""

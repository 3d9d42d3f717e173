"""The equations without multipliers, or in fewer coordinates."""

"""Speed against accuracy: measured through an FMU as an importer runs it, and chosen from."""

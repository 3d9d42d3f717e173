"""The live page: an FMU that runs in a browser, as one HTML file."""

"""A model in a scene, with all that is known about it before anything is packaged or simulated."""

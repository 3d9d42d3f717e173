"""A model in a scene, with all that is known about it before anything is packaged or simulated.

In: a `Model` and a scene.
Out: all that a build must know, and every refusal that can come before it.
Never knows: how an FMU is packaged or run.
"""

"""The FMU's variables and the menu of methods: what targets, closed forms, pages and studies share.

In: equations and a scene.
Out: the table of an FMU's variables.
Never knows: how they are computed, and the version of FMI.
"""

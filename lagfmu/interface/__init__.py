"""The FMU's variables and the menu of methods: what targets, closed forms, pages and studies share."""

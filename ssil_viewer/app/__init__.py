"""The window: one user of the pipeline. Nothing below this package knows of it."""

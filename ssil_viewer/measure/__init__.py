"""Measurements: times of the passes, their floors, how they scale, and the settings for a time budget."""

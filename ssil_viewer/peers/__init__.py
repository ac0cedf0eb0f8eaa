"""Simpler methods than ours on the same G-buffer, for `compare --all`; no frame of the viewer runs them."""

"""References for the renderer's light: sums over all pixels (R1), those that are seen (R2), and a path tracer (R3).

`compare` has what `ssil-viewer compare` does as one function; docs/compare.md explains what each difference shows.
"""

"""The talk's claims, measured: one small function for each, and a report that knows none of them by name."""

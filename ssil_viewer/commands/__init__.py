"""The commands of `ssil-viewer`, one file each: USAGE and EPILOG for its help, `add_flags`, and `run`."""

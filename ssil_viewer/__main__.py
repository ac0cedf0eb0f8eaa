"""`python -m ssil_viewer` is the same program as `ssil-viewer`."""

import sys

from ssil_viewer.cli import main

if __name__ == "__main__":
    sys.exit(main())

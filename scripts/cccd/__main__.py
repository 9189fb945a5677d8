"""``python -m cccd`` is the command ``cccd``."""

import sys

from cccd.cli import main

if __name__ == "__main__":
    sys.exit(main())

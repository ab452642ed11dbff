"""`python -m stickslip`."""

import sys

from stickslip.cli import main

if __name__ == "__main__":
    sys.exit(main())

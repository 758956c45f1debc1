"""`python -m mocca_robot.cli` is `mocca-robot`."""

import sys

from mocca_robot.cli.parser import main

if __name__ == "__main__":
    sys.exit(main())

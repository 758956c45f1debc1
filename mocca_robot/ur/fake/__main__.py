"""`python -m mocca_robot.ur.fake`: the fake controller without the rest of the command line."""

from __future__ import annotations

import argparse
import sys

from mocca_robot.errors import MoccaError
from mocca_robot.ur.fake.serve import add_fake_ur_options, run_fake_ur

parser = argparse.ArgumentParser(
    prog="python -m mocca_robot.ur.fake", description=sys.modules["mocca_robot.ur.fake"].__doc__
)
add_fake_ur_options(parser)
try:
    sys.exit(run_fake_ur(parser.parse_args()))
except MoccaError as error:
    sys.exit(f"error: {error}")

"""`python -m mocca_robot` is `mocca-robot`."""

import runpy

if __name__ == "__main__":
    runpy.run_module("mocca_robot.cli", run_name="__main__", alter_sys=True)

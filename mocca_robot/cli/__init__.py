"""The command line: `mocca-robot design`, `simulate`, `run`, `check`, … The only room that sees all others."""

from mocca_robot.cli.parser import main

__all__ = ["main"]

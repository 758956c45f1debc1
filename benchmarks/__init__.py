"""Measurements beside the alternatives: `python -m benchmarks NAME [--case C] [--json]`."""

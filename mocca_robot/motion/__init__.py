"""Contacts and joints → the ways in which parts can move: parts-graph, sweeps, ways out, insertion (Eq. 1, 11, 12)."""

"""Numbers only: solvers of Eq. 7 and 8 and their factors; nothing here knows what an assembly is."""

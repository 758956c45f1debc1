"""A Universal Robots arm that carries out a plan: driver, grippers, checks before it moves, URScript; a fake arm."""

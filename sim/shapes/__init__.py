"""What collides with what: convex pieces, contact points, inertia."""

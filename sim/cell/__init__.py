"""A robot cell in MuJoCo: the arm, the hand, the structure as it grows, and the rehearsal of a plan."""

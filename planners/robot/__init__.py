"""How an arm builds the structure: tray, grasps, insertions, transits, and a second look at the plan."""

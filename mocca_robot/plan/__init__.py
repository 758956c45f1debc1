"""What a robot plan is, and how any arm carries it out; one robot's way is in `ur`."""

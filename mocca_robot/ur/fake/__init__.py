"""A fake UR controller on loopback: RTDE, dashboard, script upload, gripper, simulated motion, injectable faults.

It speaks enough for the real ur-rtde client, from another process. For tests, for training, for rehearsing operators.
It is no model of an arm's dynamics: joints follow their commands to first order, forces come from a few planes.
"""

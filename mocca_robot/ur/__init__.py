"""Everything that consumes a plan: check it, rehearse it dry, execute it on a Universal Robots arm, record it.

`plan` reads, `checks` judges, `dry_run` tabulates, `executor` walks the steps on an `interface.Arm`, `driver` is the
arm behind ur-rtde, `journal` remembers, `urscript` writes a stand-alone program, `fake` is a controller on loopback.
"""

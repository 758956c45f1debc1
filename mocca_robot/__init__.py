"""Cone joints for structures that stand without glue, screws or friction.

In three lines: ``load`` a configuration, ``planners.design`` joints for it, ``sim.simulate`` the result. The stub
beside this file lists every public name. Each is imported when it is first used, so that importing the package costs
next to nothing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Cone joints for structures that stand without glue, screws or friction.

In three lines: ``load`` a configuration, ``planners.design`` joints for it, ``sim.simulate`` the result. The stub
beside this file lists every public name. Each is imported when it is first used, so that importing the package costs
next to nothing.
"""

from typing import Any

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def load_ipython_extension(ipython: Any) -> None:
    """Have notebooks show values as picture, verdict and table: `%load_ext mocca_robot`."""
    from mocca_robot.report.display import NOTEBOOK_TYPES, markup

    html = ipython.display_formatter.formatters["text/html"]
    for module, name in NOTEBOOK_TYPES:
        html.for_type_by_name(module, name, markup)

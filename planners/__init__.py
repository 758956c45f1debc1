"""What to decide: joints for an assembly (`design`); orders of assembly and robot plans are in `order` and `robot`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

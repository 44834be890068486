"""surehold: find, in few trials, the optimum that still holds when the input shakes.

The public names stand in `__init__.pyi` and are imported when they are first used: `import surehold` stays quick.
"""

import lazy_loader

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

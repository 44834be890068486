"""What is maximized: synthetic functions, grasping, a user's own function; and how an answer is scored when shaken."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

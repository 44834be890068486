"""The hand and what it grasps: objects, distance fields, closing, contacts, wrenches. Knows no optimizer."""

import logging

import lazy_loader

from surehold.extras import require

require("grasp", "surehold.grasping")
logging.getLogger("trimesh").addHandler(logging.NullHandler())  # it prints tracebacks of what we refuse in one line
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""One run that survives: storage, resume, workers, and trials made by a robot. Stands on Optuna."""

import lazy_loader

from surehold.extras import require

require("study", "surehold.studies")
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

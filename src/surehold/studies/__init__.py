"""One run that survives: storage, resume, workers, and trials made by a robot. Stands on Optuna."""

from importlib.util import find_spec

if find_spec("optuna") is None:
    raise ModuleNotFoundError("surehold.studies stands on Optuna; install it with: pip install 'surehold[study]'")

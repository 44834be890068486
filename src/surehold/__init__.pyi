"""Public names; `surehold/__init__.py` loads each when it is first used."""

from . import grasping as grasping
from . import problems as problems
from .errors import InputError as InputError
from .errors import SureholdError as SureholdError
from .optimization.acquisition.risk_measures import Risk as Risk
from .optimization.box import Box as Box
from .optimization.constraints.linear import Linear as Linear
from .optimization.maximization import Result as Result
from .optimization.maximization import Trial as Trial
from .optimization.maximization import maximize as maximize
from .optimization.maximization import minimize as minimize
from .optimization.noise.input_noise import InputNoise as InputNoise
from .optimization.noise.quadratures import sigma_points as sigma_points
from .optimization.optimizer import Optimizer as Optimizer
from .optimization.recommendation import Recommendation as Recommendation
from .optimization.surrogates.gaussian_process.model import GaussianProcess as GaussianProcess
from .optimization.surrogates.treed.model import TreedGaussianProcess as TreedGaussianProcess
from .optimization.trials import AskedTrial as AskedTrial
from .studies.sampler import Sampler as Sampler

__version__: str

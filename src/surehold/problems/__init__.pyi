"""Names of surehold.problems; `__init__.py` loads each when it is first used."""

from .function import Function as Function
from .function import load_function as load_function
from .function import parse_bounds as parse_bounds
from .grasp.held import HeldGrasp as HeldGrasp
from .grasp.problem import GraspProblem as GraspProblem
from .named import robust_problem as robust_problem
from .perturbation import RobustScore as RobustScore
from .perturbation import perturbed_points as perturbed_points
from .perturbation import robust_score as robust_score
from .problem import Optimum as Optimum
from .problem import Problem as Problem
from .robust import RobustProblem as RobustProblem
from .synthetic import GF as GF
from .synthetic import GM as GM
from .synthetic import RKHS as RKHS
from .synthetic import GaussianBumps as GaussianBumps
from .synthetic import robust_optimum as robust_optimum
from .synthetic import synthetic_function as synthetic_function

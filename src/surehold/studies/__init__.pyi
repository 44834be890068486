"""Names of surehold.studies; `__init__.py` loads each when it is first used."""

from .recommendation import StudyRecommendation as StudyRecommendation
from .recommendation import recommend as recommend
from .robot import Asked as Asked
from .robot import NothingToAsk as NothingToAsk
from .robot import RobotStudy as RobotStudy
from .sampler import Sampler as Sampler
from .search_space import SearchSpace as SearchSpace
from .settings import StudySettings as StudySettings
from .stop_rule import StopRule as StopRule

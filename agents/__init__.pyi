from .apg import torch_score as torch_score
from .designer.policy import Design as Design
from .designer.policy import design as design
from .evaluation import evaluate as evaluate
from .rollout import Rollout as Rollout
from .training import Run as Run
from .training import train as train
from .vec_env import DominoVecEnv as DominoVecEnv

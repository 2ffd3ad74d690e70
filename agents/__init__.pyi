from .base.building import Built as Built
from .conditioned.policy import Design as Design
from .conditioned.policy import design as design
from .evaluation.one_scene import evaluate as evaluate
from .sb3.vec_env import DominoVecEnv as DominoVecEnv
from .single.drawn import train_drawn as train_drawn
from .single.result import Run as Run
from .single.training import train as train

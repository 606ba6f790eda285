"""WHO moves: a body, its landmarks, its feature vector."""

from syda_gym.embodiments.embodiment import Embodiment, Feature, landmark_error
from syda_gym.embodiments.human import HumanSkeleton

__all__ = ["Embodiment", "Feature", "HumanSkeleton", "landmark_error"]

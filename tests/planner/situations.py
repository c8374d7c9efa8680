"""What a robot with a single ray knows in the small box, for tests of the planner by hand."""

import math

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.planner.model import Situation
from entropy_explore_env.planner.records import EXPERIENCE, KNOWLEDGE, MATE
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.settings.sensor import RangeSensor
from tests.belief.paths.graphs import belief_costs

SIZE, MOST = (7, 11, 5), 6
ACTION = {"kind": "candidates", "candidates": MOST}
ONE_RAY = with_settings(
    BOX, {"sensor": RangeSensor((0.0, 0.0), 0.1, max_range_m=9.0, voxels_behind=0), "action": ACTION}
)
BY_SEEN = with_settings(ONE_RAY, {"ending": {"seen_share": 1.0}, "track_truth": True})
ALONG_X = np.array([0.5, 5.5, 2.5, 0.0, 0.0])
BACK = np.array([6.5, 5.5, 2.5, math.pi, 0.0])
PRIOR = 1.0 / 900.0


def knowledge(target, came_bits, move_end=MoveEnd.ARRIVED, here=ALONG_X, uncertain=False, **others):
    """What a robot knows after a drive to a target; the rest is 0 unless given."""
    known = np.zeros(1, KNOWLEDGE)[0]
    known["target"], known["pose"], known["came_bits"] = target, here, came_bits
    known["move_end"], known["place_variance"] = move_end.code, 0.1 * uncertain
    for name, value in others.items():
        known[name] = value
    return known


def unknown_world():
    mean, precision = np.zeros(SIZE, np.float32), np.full(SIZE, PRIOR, np.float32)
    costs = belief_costs(mean, precision, PRIOR)
    experience = np.zeros(1, EXPERIENCE)[0]
    belief = Belief(mean.reshape(-1), precision.reshape(-1), SIZE)
    no_teammates = np.zeros(0, CONE), np.zeros(0, MATE)
    return precision, Situation(knowledge(ALONG_X, 0.0), belief, costs, *no_teammates, experience)

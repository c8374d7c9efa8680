"""MAPPO of BenchMARL on a team: actors see what their robot knows, the critic what all robots observe."""

# pyright: reportMissingImports=false
from benchmarl.algorithms import MappoConfig
from benchmarl.environments.pettingzoo.common import PettingZooClass
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from pettingzoo.utils import BaseParallelWrapper
from torchrl.envs import PettingZooWrapper

import entropy_explore_env as eee


class NumbersOnly(BaseParallelWrapper):
    """Infos cut down to the mask of actions."""

    def reset(self, seed=None, options=None):
        observations, infos = super().reset(seed, options)
        return observations, {a: {"action_mask": infos[a]["action_mask"]} for a in infos}

    def step(self, actions):
        *results, infos = super().step(actions)
        return *results, {a: {"action_mask": infos[a]["action_mask"]} for a in infos}


class Exploration(PettingZooClass):
    """A scenario as a task of BenchMARL: discrete actions, and a state for centralised critics."""

    def get_env_fun(self, num_envs, continuous_actions, seed, device):
        settings = {"observation": {"flat": True, "panorama_utility": "log2"}, **self.config}
        discrete = {"kind": "discrete", "moves": "axes"}

        def make():
            team = eee.parallel_env(self.name, action=discrete, reward={"kind": "team"}, **settings)
            return PettingZooWrapper(NumbersOnly(team), return_state=True, seed=seed, device=device)

        return make

    def supports_continuous_actions(self):
        return False

    def supports_discrete_actions(self):
        return True

    def has_state(self):
        return True

    @staticmethod
    def env_name():
        return "entropy_explore_env"


config = ExperimentConfig.get_from_yaml()
config.max_n_frames, config.on_policy_collected_frames_per_batch = 256, 128  # millions to learn something
config.on_policy_n_envs_per_worker, config.on_policy_n_minibatch_iters = 1, 1
config.on_policy_minibatch_size, config.evaluation = 64, False
config.loggers, config.create_json, config.render = [], False, False
task = Exploration("box-7x11x5", {"robots": 2, "max_cycles": 60})
experiment = Experiment(
    task=task,
    algorithm_config=MappoConfig.get_from_yaml(),
    model_config=MlpConfig.get_from_yaml(),
    critic_model_config=MlpConfig.get_from_yaml(),
    seed=0,
    config=config,
)
experiment.run()
critic = experiment.losses["robot"].critic_network
print(experiment.total_frames, "steps learned from; the critic reads", critic.in_keys)

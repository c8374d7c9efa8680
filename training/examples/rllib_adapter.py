"""RLlib's PPO on a team by the adapter: a step is a decision of some robot, one policy drives them all.

With the word `candidates` robots choose among viewpoints that a planner proposes; the number of one that
does not exist means the first, so that no mask is needed.
"""

# pyright: reportMissingImports=false
import sys

from ray.rllib.algorithms.ppo import PPOConfig

from entropy_explore_env.envs.rllib_env import EntropyExploreMultiAgentEnv

action = {"kind": "candidates" if "candidates" in sys.argv[1:] else "continuous"}
task = {"scenario": "box-7x11x5", "robots": 2, "seed": 0, "observation": {"flat": True}, "action": action}
config = (
    PPOConfig()
    .environment(EntropyExploreMultiAgentEnv, env_config=task)
    .env_runners(num_env_runners=0)  # in this process; more of them on many cores or machines
    .multi_agent(policies={"all"}, policy_mapping_fn=lambda agent, episode, **others: "all")
    .training(train_batch_size_per_learner=256, minibatch_size=128, num_epochs=1)
)
if __name__ == "__main__":
    algorithm = config.build_algo()
    result = algorithm.train()  # hundreds of times to learn something
    print(result["env_runners"]["num_env_steps_sampled"], "steps")
    algorithm.stop()

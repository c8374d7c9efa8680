"""What ends a mission before its time is up, compiled: maps that are good enough, or no robot left."""

from __future__ import annotations

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.faults import all_gone, gone
from entropy_explore_env.missions.scoring import holds_enough
from entropy_explore_env.missions.state import MissionEnd

_RUNNING, _MAPPED = MissionEnd.RUNNING.code, MissionEnd.MAPPED.code
_SEEN, _STOPPED = MissionEnd.SEEN.code, MissionEnd.STOPPED.code


@lean_kernel
def mission_end(mission):
    """Code of a MissionEnd after an event: what the mission asks for, or that nobody is left for it."""
    clock, team = mission.clock, mission.team
    if team.params[0].by_seen:
        end = _SEEN if seen_enough(mission) else _RUNNING
    else:
        end = _MAPPED if mapped_enough(team, clock) else _RUNNING
    return _STOPPED if end == _RUNNING and all_gone(team.faults) else end


@lean_kernel
def mapped_enough(team, clock):
    """Whether those maps that have to have passed the threshold of entropy (Rocha04, eq. 41)."""
    shared, passed, missing = team.params[0], 0, 0
    for index in range(len(team.robots)):
        if shared.shared_maps and gone(team.faults, index):
            continue
        if team.robots[index].entropy_bits <= clock.entropy_end_bits:
            passed += 1
        else:
            missing += 1
    return passed > 0 and (missing == 0 or not (shared.all_maps or shared.shared_maps))


@lean_kernel
def seen_enough(mission):
    """Whether the team has seen what ends the mission; where it has to be shared, whether all hold it."""
    clock, team, joint = mission.clock, mission.team, mission.joint
    if clock.explored_visible < clock.explored_end or clock.explored_free < clock.explored_free_end:
        return False
    if not team.params[0].shared_maps:
        return True
    working, precision, prior = 0, mission.maps.beliefs.precision, team.params[0].prior_precision
    for index in range(len(team.robots)):
        if not gone(team.faults, index):
            working += 1
            if not holds_enough(clock, joint.visible, mission.truth, precision[index], prior):
                return False
    return working > 0

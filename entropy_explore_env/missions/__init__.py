"""Robots in worlds, many missions at once.

Arguments of kernels that have these names mean the same in all modules of this room, unless a docstring says
otherwise. Docstrings describe the other arguments.

    first, last         range of missions of a call; the end is not included
    rules, state        Rules and MissionState of E missions
    work                Workspace of one thread; braking, crossing, recipients, scan, tree are parts of it
    clock               MISSION of a mission; time_s is its simulated time
    team, maps, …       parts of a Mission: objects of the class, or record of the type, with that name
    params              PARAMS of a robot, (A,) PARAMS of a team; shared: of any robot, where all are alike
    robot, robots       ROBOT, (A,) ROBOT
    index, mate, sender number of a robot in its team
    slot                number of a message in InFlight, or of a batch
    choice              CHOICE of a robot
    estimate            ESTIMATE of a robot; None, as localization, faults, summaries: the scenario has none
    sensor, scene, pose SensorModel, Scene and SensorPose of a scan
    row, begin          (F,) float32 observation, and where a part of it begins; None = it is left out
"""

"""What a robot does: it senses, moves and talks.

Arguments of kernels that have these names are the same in all modules of this room and of `belief`, unless a
docstring says otherwise.

    size, voxel_size_m      (X, Y, Z) voxels and the edge of one
    mean, precision         (V,) float32 expected coverage and 1/σ² > 0 of a map; what fuses changes them
    params, model           SENSOR_PARAMS or LOCALIZATION_PARAMS of a robot; SensorModel
    scan, scene, pose       Scan, Scene and SensorPose; index is a ray, n how many voxels it crosses
    start, finish, line     (x, y, z) in grid units, inside the workspace, and a Line between such points
    crossing, matrices      scratch space: a Crossing, (2, 4, 4) float64
    search, lattice, costs  Search, Lattice and Costs of paths: those of the search that was made, after it
    estimate, covariance    ESTIMATE, None = exact; (4, 4) float64 of x, y, z, yaw; both are changed in place
    rng                     (1,) uint64 random state
"""

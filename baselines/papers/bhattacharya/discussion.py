"""How the results of Bhattacharya 2010 are to be read: the report's text, part by part."""

COVERAGE_READING = """The paper proves the fall of the functional for Lloyd's algorithm, and conjectures
convergence of the projected centroid (Conjecture 1). On the grid the conjecture fails where a run ends in
a limit cycle: the centroid projected into a cell that is not convex need not lower the functional, and
where it rises robots can come back to where they were. Robots that move only if their own functional
falls (guarded) cannot, and gradient search with the robot's own cell among the candidates does the same."""

EXPLORATION_READING = """The paper gives neither sensor range nor confidence, τ, τ′ or η, nor more of the
plan than its size; ours: s_n = 0.99, s_f = 0.9, τ = 0.35 (above the entropy of the farthest reading,
0.33), τ′ = 0.33, η = 0.01. While exploring, targets are kept until they are reached, seen or blocked;
then robots cover, guarded. In unknown space the edge cost (e(s) + e(t))/2 + η‖s - t‖ hardly knows
lengths: a diagonal step costs what a straight one does, so that ways there are shortest by the number of
steps.

Plans come from one recipe, a building of rooms with obstacles. `wide` and `narrow` have the paper's size:
its cells are taken for 3⅓ cm, which makes about ten rooms, or for 10 cm, which makes over fifty. `small`
are the buildings of `wide` in cells of 10 cm: a ninth of the cells, so that there is time for the sensor
ranges and the variants. A range of 35 cells there is one of 100 in `wide`, and 917 iterations are 2750.

`paper` is as in the paper. The others change one thing: `length`, plain geodesic cells; `nearest`, the
uncertain cell that costs least to reach instead of the one nearest to the centroid; `nearest-length`,
both; `phases`, messages in phases of 10 iterations instead of perfect ones; `phases-loss`, half of them
lost."""

CHANGED_READING = """Every tessellation is made anew. From one to the next {:.1%} of the cells in reach
change their cost or owner (small plan, 200 iterations): robots step in every iteration, and costs are
counted from them. A search that went on from the last one would have next to nothing to keep, although the
map itself changes in a few cells only."""

SPLIT_READING = """The entropy-weighted metric splits the region evenly only if it separates the robots
and η is small: around a patch both walk at hardly any cost, so that each enters it from its own side all
around, and the one that is nearer to more of its rim gets more."""

FLYING_READING = """Four robots, cut off at 600 s; `explored` = of the voxels that can be seen, by the
robots' joint map."""

CHANNEL_READING = """Scenario `office`, three robots, `voronoi-nearest`, I_min = 0, the same seeds for all.
`utility` sends the most useful measurements of a scan at once (Rocha04); `phases` sends the same selection
when a phase of 10 s has ended, once, twice or four times (Bhattacharya). Settings with 64 send 64
measurements a scan in all, those with `all` each of the 180. Utility = bits taken from the hearers' maps a
bit sent."""

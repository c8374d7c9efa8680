"""Recorded bags of ROS: their maps and scans with the poses of robots, and the world at their end.

Bags of ROS 1 and 2 are read with rosbags, without ROS. Maps are OccupancyGrid or Octomap messages; where a
bag has none, PointCloud2 messages are scans. Poses come from tf, and from Odometry in the map's frame.
Maps and scans whose frame no transform brings into the map's frame are left out.
Messages are taken in the order in which they were recorded: stamps in their headers, which may run back, do
not matter.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.errors import RecordError, SettingError, WorldError, one_of
from entropy_explore_env.interop.bag_writer import typestore
from entropy_explore_env.interop.messages import (
    grid_of_message,
    lies_level,
    matrix_of,
    percent_of,
    pose_of_matrix,
    voxels_of_tree,
)
from entropy_explore_env.robots.rotations import gaze_of
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.validation import checked_path
from entropy_explore_env.worlds.world import World

_GRID, _TREE = "nav_msgs/msg/OccupancyGrid", "octomap_msgs/msg/Octomap"
_CLOUD, _ODOMETRY, _TF = "sensor_msgs/msg/PointCloud2", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
_BASES = ("base_footprint", "base_link")
"""Frames of a robot in bags without Odometry."""
_MAP = "/map"
"""Topic of a robot's map, beside which others are costmaps."""
_FLOATS = {7: "f4", 8: "f8"}
_MOST_LINKS = 100


class MapHeard(NamedTuple):
    """A map at a moment."""

    time_s: float
    percent: np.ndarray
    """(X, Y) or (X, Y, Z) int8; -1 = unknown."""
    origin: tuple[float, float, float]
    """Its corner: x, y, yaw."""
    bottom_m: float
    resolution_m: float
    poses: dict[int, np.ndarray]
    """Number of a robot → its pose (5,) in the map frame."""


class ScanHeard(NamedTuple):
    """A scan at a moment."""

    time_s: float
    robot: int
    pose: np.ndarray
    """(5,) of the sensor in the map frame."""
    points_m: np.ndarray
    """(N, 3) in the map frame."""
    poses: dict[int, np.ndarray]


@dataclass
class Frames:
    """Which frame lies where in which other one, as it was heard last."""

    links: dict[str, tuple[str, np.ndarray]] = field(default_factory=dict)
    """Frame → its parent, and the matrix (4, 4) from it to the parent."""

    def hear(self, parent: str, child: str, position: Any, orientation: Any) -> None:  # noqa: ANN401
        """Take a transform."""
        self.links[child.lstrip("/")] = parent.lstrip("/"), matrix_of(position, orientation)

    def to(self, above: str, frame: str) -> np.ndarray | None:
        """Return the matrix (4, 4) from a frame to one above it; None = no links lead there."""
        return next((matrix for name, matrix in self.chain(frame) if name == above), None)

    def chain(self, frame: str) -> Iterator[tuple[str, np.ndarray]]:
        """Yield a frame and those above it, each with the matrix (4, 4) from the frame to it."""
        matrix, at = np.eye(4), frame.lstrip("/")
        for _ in range(_MOST_LINKS):
            yield at, matrix
            if at not in self.links:
                return
            at, link = self.links[at]
            matrix = link @ matrix


def points_of_cloud(message: Any) -> np.ndarray:  # noqa: ANN401 - a PointCloud2
    """Return the finite points (N, 3) of a PointCloud2, in its frame.

    Raises:
        SettingError: It has no x, y and z as floats, or its data do not fit its size.
    """
    fields = {each.name: each for each in message.fields}
    if any(axis not in fields or fields[axis].datatype not in _FLOATS for axis in "xyz"):
        raise SettingError("PointCloud2.fields", sorted(fields), "x, y and z as floats")
    width, height, step = int(message.width), int(message.height), int(message.point_step)
    data, order = np.asarray(message.data, np.uint8), ">" if message.is_bigendian else "<"
    row = max(int(message.row_step), width * step) if height > 1 else width * step  # a row may end in padding
    if len(data) < height * row:
        raise SettingError("PointCloud2.data", len(data), f"{height} rows of {row} bytes")
    kinds = [order + _FLOATS[fields[axis].datatype] for axis in "xyz"]
    offsets = [int(fields[axis].offset) for axis in "xyz"]
    record = np.dtype({"names": list("xyz"), "formats": kinds, "offsets": offsets, "itemsize": step})
    packed = data[: height * row].reshape(height, row)[:, : width * step]
    rows = np.frombuffer(packed.tobytes(), record)
    points = np.column_stack([rows[axis].astype(np.float64) for axis in "xyz"])
    return points[np.isfinite(points).all(axis=1)]


class BagReader:
    """Iterates over the maps of a bag, or over its scans where it has no maps.

    Attributes:
        maps: Topics of its maps.
        scans: Topics of its scans.
        robots: Frames of its robots, by number.
    """

    def __init__(
        self,
        path: Path | str,
        topic: str | None = None,
        map_frame: str = "map",
        robots: Sequence[str] = (),
        posed: bool = True,
    ) -> None:
        """Look at what a bag holds.

        Args:
            path: Folder of a ROS 2 bag, an .mcap or .db3 in it, or a .bag of ROS 1.
            topic: Topic of the map or scans; None = `/map`, or all topics of maps, or those of scans where
                there are no maps.
            map_frame: The frame in which poses are wanted.
            robots: Their frames; None given = those of Odometry, or base_footprint or base_link.
            posed: Whether maps are wanted only with the pose of a robot.

        Raises:
            RecordError: There is no such bag, or it has neither maps nor scans with poses.
            SettingError: The topic is none of the bag, or has another type.
            MissingExtraError: rosbags is not installed.
        """
        self._store = typestore()
        self.path, self._map_frame = checked_path("bag", path), map_frame
        kinds = self._kinds()
        self.maps = [name for name, kind in kinds.items() if kind in (_GRID, _TREE)]
        self.scans = [name for name, kind in kinds.items() if kind == _CLOUD]
        if topic is not None:
            self._take_topic(topic, kinds)
        if not self.maps and not self.scans:
            allowed = f"a bag with an OccupancyGrid, an Octomap or PointCloud2; it has {sorted(kinds)}"
            raise RecordError("bag", str(self.path), allowed)
        if topic is None and _MAP in self.maps:
            self.maps = [_MAP]
        self._posed = posed or not self.maps
        self.robots = list(robots) or (self._found_robots() if self._posed else [])

    def _take_topic(self, topic: str, kinds: dict[str, str]) -> None:
        """Keep one topic alone."""
        if topic not in kinds:
            raise SettingError("topic", topic, one_of(topic, sorted(kinds)))
        if kinds[topic] not in (_GRID, _TREE, _CLOUD):
            allowed = f"a topic of {_GRID}, {_TREE} or {_CLOUD}; it is of {kinds[topic]}"
            raise SettingError("topic", topic, allowed)
        self.maps, self.scans = ([topic], []) if kinds[topic] != _CLOUD else ([], [topic])

    def _open(self) -> Any:  # noqa: ANN401 - an AnyReader
        from rosbags.highlevel import AnyReader

        folder = self.path.parent if self.path.suffix in (".mcap", ".db3") else self.path
        if not folder.exists():
            raise RecordError("bag", str(self.path), "the folder of a bag, or a .bag")
        return AnyReader([folder], default_typestore=self._store)

    def _kinds(self) -> dict[str, str]:
        """Return topic → type of its messages."""
        try:
            with self._open() as reader:
                return {each.topic: each.msgtype for each in reader.connections}
        except RecordError:
            raise
        except Exception as error:  # whatever rosbags makes of a file that is no bag
            raise RecordError("bag", str(self.path), f"a bag that can be read ({error})") from None

    def _found_robots(self) -> list[str]:
        """Return the frames of the robots."""
        found: dict[str, list[str]] = {_ODOMETRY: [], _TF: []}
        with self._open() as reader:
            wanted = [each for each in reader.connections if each.msgtype in found]
            for connection, _, raw in reader.messages(connections=wanted) if wanted else ():
                message = reader.deserialize(raw, connection.msgtype)
                placed = [message] if connection.msgtype == _ODOMETRY else message.transforms
                found[connection.msgtype] += [each.child_frame_id.lstrip("/") for each in placed]
        robots = _robots_of(found[_ODOMETRY]) or _bases_of(found[_TF])
        if not robots:
            raise RecordError("bag", str(self.path), "a bag with Odometry, or tf of a base_link: poses")
        return robots

    def __iter__(self) -> Iterator[MapHeard | ScanHeard]:
        """Yield maps, or scans where there are no maps, that were recorded when a robot's pose was known.

        Raises:
            SettingError: A message is broken.
        """
        frames, topics, waiting = Frames(), self.maps or self.scans, []
        with self._open() as reader:
            kinds = (_ODOMETRY, _TF)
            wanted = [each for each in reader.connections if each.msgtype in kinds or each.topic in topics]
            first = None
            for connection, stamp, raw in reader.messages(connections=wanted):
                first = stamp if first is None else first
                if waiting and waiting[0][1] < stamp:  # poses of the same moment may be stored behind a map
                    yield from self._heard_now(waiting, first, frames)
                    waiting = []
                message = reader.deserialize(raw, connection.msgtype)
                if connection.msgtype in kinds:
                    self._place(message, connection.msgtype, frames)
                else:
                    waiting.append((message, stamp, connection.msgtype))
            if first is not None:
                yield from self._heard_now(waiting, first, frames)

    def _heard_now(
        self, waiting: list[tuple[Any, int, str]], first: int, frames: Frames
    ) -> Iterator[MapHeard | ScanHeard]:
        """Yield what messages say; their stamps count from the first one, in nanoseconds."""
        for message, stamp, kind in waiting:
            heard = self._heard(message, kind, (stamp - first) * 1e-9, frames)
            if heard is not None:
                yield heard

    def _place(self, message: Any, kind: str, frames: Frames) -> None:  # noqa: ANN401
        """Hear where frames are."""
        if kind == _TF:
            for each in message.transforms:
                place, turn = each.transform.translation, each.transform.rotation
                frames.hear(each.header.frame_id, each.child_frame_id, place, turn)
        elif message.header.frame_id.lstrip("/") == self._map_frame:
            at = message.pose.pose
            frames.hear(self._map_frame, message.child_frame_id, at.position, at.orientation)

    def _carrier(self, frame: str, frames: Frames) -> int:
        """Return the robot that carries a frame: the first one above it, or one of its namespace; else 0."""
        for at, _ in frames.chain(frame):
            if at in self.robots:
                return self.robots.index(at)
        namespaces = [name.split("/")[0] for name in self.robots]
        namespace = frame.split("/")[0]
        return namespaces.index(namespace) if namespace in namespaces else 0

    def _heard(self, message: Any, kind: str, time_s: float, frames: Frames) -> MapHeard | ScanHeard | None:  # noqa: ANN401
        """Return what a map or scan says; None = its frame, or all robots, are not placed yet."""
        matrices = {number: frames.to(self._map_frame, name) for number, name in enumerate(self.robots)}
        poses = {number: pose_of_matrix(each) for number, each in matrices.items() if each is not None}
        if self._posed and not poses:
            return None
        frame = frames.to(self._map_frame, message.header.frame_id)
        if frame is None:
            return None
        if kind in (_GRID, _TREE):
            percent, corner, edge_m = _map_of(message, kind)
            origin, bottom_m = in_map_frame(corner, frame)
            return MapHeard(time_s, percent, origin, bottom_m, edge_m, poses)
        points = points_of_cloud(message) @ frame[:3, :3].T + frame[:3, 3]
        robot = self._carrier(message.header.frame_id.lstrip("/"), frames)
        return ScanHeard(time_s, robot, pose_of_matrix(frame), points, poses)


def _robots_of(frames: list[str]) -> list[str]:
    """Return the frames of Odometry but those of parts of a robot whose base has Odometry, too."""
    bases = _bases_of(frames)
    namespaces = {base.rpartition("/")[0] for base in bases}
    others = [frame for frame in frames if frame.rpartition("/")[0] not in namespaces]
    return bases + list(dict.fromkeys(others))


def _bases_of(frames: list[str]) -> list[str]:
    """Return the first frame of a robot's base in each namespace."""
    bases: dict[str, str] = {}
    for frame in frames:
        namespace, _, name = frame.rpartition("/")
        if name in _BASES:
            bases.setdefault(namespace, frame)
    return list(bases.values())


def _map_of(message: Any, kind: str) -> tuple[np.ndarray, np.ndarray, float]:  # noqa: ANN401
    """Return the percents of a map, the pose (5,) of its corner in its frame, and the edge of its voxels."""
    if kind == _GRID:
        grid = grid_of_message(message)
        x, y, yaw = grid.origin
        return grid.grid, np.array([x, y, grid.bottom_m, yaw, 0.0]), grid.resolution_m
    data = np.asarray(message.data).tobytes()
    labels, low = voxels_of_tree(data, bool(message.binary), str(message.id))
    edge_m = float(message.resolution)
    return percent_of(labels), np.array([*(low * edge_m), 0.0, 0.0]), edge_m


def in_map_frame(corner: np.ndarray, frame: np.ndarray) -> tuple[tuple[float, float, float], float]:
    """Return ((x, y, yaw), z) of a level grid's corner in the map frame.

    Args:
        corner: (5,) its pose in the frame of the grid.
        frame: (4, 4) from that frame to the map frame.

    Raises:
        SettingError: The frame of the grid is not level.
    """
    if not lies_level(frame[:3, :3]):
        raise SettingError("frame of the map", frame[:3, :3].tolist(), "one that lies level in the map frame")
    x, y, z = (float(v) for v in frame[:3, :3] @ corner[:3] + frame[:3, 3])
    return (x, y, float(corner[3]) + gaze_of(frame)[0]), z


def world_of_bag(path: Path | str, topic: str | None = None, map_frame: str = "map") -> World:
    """Return the world of the last map of a bag; unknown space is solid. Arguments are as for `BagReader`.

    Raises:
        RecordError, SettingError, MissingExtraError: As for `BagReader`; or there are several topics of maps.
        WorldError: It has no map, or one without free space.
    """
    reader, last = BagReader(path, topic, map_frame, posed=False), None
    if len(reader.maps) > 1:
        raise SettingError("topic", None, one_of("", reader.maps))
    for heard in reader:
        last = heard if isinstance(heard, MapHeard) else last
    if last is None:
        allowed = f"a bag with an OccupancyGrid or an Octomap whose place in the frame {map_frame!r} is known"
        raise WorldError("bag", str(path), allowed)
    percent = last.percent if last.percent.ndim == 3 else last.percent[:, :, None]
    x, y, yaw_rad = last.origin
    shape = (percent.shape[0], percent.shape[1], percent.shape[2])
    grid = Grid(shape, last.resolution_m, (x, y, last.bottom_m))
    unknown = percent < 0
    occupied = (percent >= 50) | unknown
    name = Path(path).stem
    return World(grid, occupied, name, yaw_rad=yaw_rad, unknown=unknown if unknown.any() else None)

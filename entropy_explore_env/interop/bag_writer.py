"""A mission as a ROS 2 bag (MCAP), written with rosbags: RViz and Foxglove play it without this library.

Topics: `/map` (OccupancyGrid) in plans or `/octomap` (Octomap) in 3-D, of what the team knows; `/tf`; and for
each robot `/robot_N/odom` (Odometry), `/robot_N/scan` (PointCloud2 of the hits, in the robot's frame),
`/robot_N/path` (Path of each drive) and `/robot_N/goal` (Marker, an arrow). OctoMap puts voxels at multiples
of their edge: `/octomap` is in the frame `octomap`, which lies at the corner of the grid.
"""

from __future__ import annotations

import dataclasses
import math
import shutil
from importlib.resources import files
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.errors import SettingError, imported
from entropy_explore_env.interop.map_files import octomap_of
from entropy_explore_env.interop.messages import ARROW_M, percent_of
from entropy_explore_env.interop.team_maps import joint_map
from entropy_explore_env.missions.poses import pose_at
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.colours import robot_colour
from entropy_explore_env.reports.recording import poses_now
from entropy_explore_env.robots.range_sensor import sensor_model
from entropy_explore_env.robots.rotations import gaze_matrix, quaternion_of, ray_directions

LAYOUT = "foxglove_layout.json"
"""The layout for Foxglove that lies beside each bag."""
OCTOMAP_TYPES = {
    "octomap_msgs/msg/Octomap": (
        "std_msgs/Header header\nbool binary\nstring id\nfloat64 resolution\nint8[] data\n"
    )
}
_POSES_PER_S, _MAP_EVERY_S = 5.0, 2.0
_MOST_SCANS = 1024
"""Most scans of a step that are written, the latest."""


def typestore() -> Any:  # noqa: ANN401 - a Typestore
    """Return the messages of ROS 2 Jazzy and OctoMap's.

    Raises:
        MissingExtraError: rosbags is not installed.
    """
    typesys = imported("rosbags.typesys", "rosbags", "ros")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for name, text in OCTOMAP_TYPES.items():
        store.register(typesys.get_types_from_msg(text, name))
    return store


class BagWriter:
    """Writes one mission, moment by moment; used as a context, so that nothing unfinished is left."""

    def __init__(self, missions: Missions, folder: Path) -> None:
        """Begin a bag; `note` follows the mission.

        Args:
            missions: A single one.
            folder: The bag, which must not exist.

        Raises:
            SettingError: It exists, or there are several missions.
            MissingExtraError: rosbags is not installed.
        """
        self._store = typestore()
        from rosbags.rosbag2 import StoragePlugin, Writer

        if folder.exists():
            raise SettingError("bag", str(folder), "a folder that does not exist yet")
        if missions.count > 1:
            raise SettingError("missions", missions.count, "a single mission in a bag")
        self.path, self._missions = folder, missions
        self._log = missions.log_scans(_MOST_SCANS)
        self._writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self._finished, self._topics = False, {}
        self._noted_s, self._map_due_s = -1.0, 0.0
        robots = missions.scenario.robots
        self._departed_s = np.full(robots, -1.0)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._finished:
            self._writer.close()
            shutil.rmtree(self.path, ignore_errors=True)

    def finish(self) -> None:
        """Write the map at the end, and the layout; the bag is complete when this returns."""
        self._write_map(self._noted_s)
        self._writer.close()
        layout = files("entropy_explore_env.interop").joinpath(LAYOUT).read_text("utf-8")
        (self.path / LAYOUT).write_text(layout, "utf-8")
        self._finished = True

    def note(self) -> None:
        """Write what happened since the last moment, after the reset or a step.

        In a step each robot has one drive, whose poses are known.
        """
        state, time_s = self._missions.state, float(self._missions.state.missions[0]["time_s"])
        robots = state.robots[0]
        for robot, own in enumerate(robots):
            if own["depart_s"] > self._departed_s[robot] and own["path_m"] > 0.0:
                self._departed_s[robot] = own["depart_s"]
                self._write_drive(robot, own)
        params = self._missions.rules.params
        first = math.floor(self._noted_s * _POSES_PER_S) + 1 if self._noted_s >= 0.0 else 0
        scans, log = min(int(self._log.count[0]), _MOST_SCANS), self._log
        ticks = np.arange(first, math.ceil(time_s * _POSES_PER_S)) / _POSES_PER_S
        moments = np.union1d(ticks, log.time_s[:scans])
        for at_s in moments[moments < time_s].tolist():
            poses = np.array([pose_at(params[n], own, at_s) for n, own in enumerate(robots)])
            self._write_moment(at_s, poses, np.flatnonzero(log.time_s[:scans] == at_s))
        if time_s > self._noted_s:
            last = np.flatnonzero(log.time_s[:scans] >= time_s)
            self._write_moment(time_s, poses_now(self._missions, 0), last)
        self._log.count[0], self._noted_s = 0, time_s
        if time_s >= self._map_due_s:
            self._write_map(time_s)
            self._map_due_s = time_s + _MAP_EVERY_S

    def _write_moment(self, time_s: float, poses: np.ndarray, scans: np.ndarray) -> None:
        """Write where all robots are, (A, 5), and scans with these numbers in the log."""
        poses[self._log.robot[scans]] = self._log.pose[scans]
        self._write_poses(time_s, poses)
        for number in scans.tolist():
            self._write_scan(number, time_s)

    def _write(self, topic: str, kind: str, time_s: float, **fields: Any) -> None:  # noqa: ANN401
        """Write a message of a type at a simulated time."""
        if topic not in self._topics:
            self._topics[topic] = self._writer.add_connection(topic, kind, typestore=self._store)
        data = self._store.serialize_cdr(self._make(kind, **fields), kind)
        self._writer.write(self._topics[topic], round(time_s * 1e9), data)

    def _make(self, kind: str, **fields: Any) -> Any:  # noqa: ANN401
        return self._store.types[kind](**fields)

    def _header(self, time_s: float, frame: str) -> Any:  # noqa: ANN401
        sec, nanosec = divmod(round(time_s * 1e9), 10**9)
        stamp = self._make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        return self._make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def _vector(self, x: float, y: float, z: float) -> Any:  # noqa: ANN401
        return self._make("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))

    def _pose(self, pose: np.ndarray) -> Any:  # noqa: ANN401
        """Return the geometry_msgs/Pose of a pose (5,)."""
        x, y, z, w = quaternion_of(float(pose[3]), float(pose[4]))
        turn = self._make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
        x, y, z = pose[:3].tolist()
        place = self._make("geometry_msgs/msg/Point", x=x, y=y, z=z)
        return self._make("geometry_msgs/msg/Pose", position=place, orientation=turn)

    def _write_poses(self, time_s: float, poses: np.ndarray) -> None:
        """Write where all robots are, tf and odometry, and where the octomap is."""
        header, transforms = self._header(time_s, "map"), []
        if not self._missions.grid.flat:
            corner = np.array([*self._missions.grid.origin_m, 0.0, 0.0])
            transforms.append(self._transform(header, "octomap", corner))
        for robot, pose in enumerate(poses):
            placed, frame = self._pose(pose), f"robot_{robot}"
            transforms.append(self._transform(header, frame, pose))
            still, nothing = self._vector(0.0, 0.0, 0.0), np.zeros(36)
            twist = self._make("geometry_msgs/msg/Twist", linear=still, angular=still)
            self._write(
                f"/{frame}/odom",
                "nav_msgs/msg/Odometry",
                time_s,
                header=header,
                child_frame_id=frame,
                pose=self._make("geometry_msgs/msg/PoseWithCovariance", pose=placed, covariance=nothing),
                twist=self._make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=nothing),
            )
        self._write("/tf", "tf2_msgs/msg/TFMessage", time_s, transforms=transforms)

    def _transform(self, header: Any, frame: str, pose: np.ndarray) -> Any:  # noqa: ANN401
        """Return the geometry_msgs/TransformStamped of a frame at a pose (5,)."""
        turn, place = self._pose(pose).orientation, self._vector(*pose[:3])
        transform = self._make("geometry_msgs/msg/Transform", translation=place, rotation=turn)
        kind = "geometry_msgs/msg/TransformStamped"
        return self._make(kind, header=header, child_frame_id=frame, transform=transform)

    def _write_drive(self, robot: int, own: np.void) -> None:
        """Write the path of a drive, and an arrow at the viewpoint to which it leads."""
        time_s, kind = float(own["depart_s"]), "geometry_msgs/msg/PoseStamped"
        header = self._header(time_s, "map")
        corners = [[*place, 0.0, 0.0] for place in own["path"][: own["corners"]]]
        poses = [self._pose(np.asarray(pose)) for pose in [own["origin"], *corners, own["goal"]]]
        stamped = [self._make(kind, header=header, pose=pose) for pose in poses]
        self._write(f"/robot_{robot}/path", "nav_msgs/msg/Path", time_s, header=header, poses=stamped)
        red, green, blue = (channel / 255.0 for channel in robot_colour(robot))
        self._write(
            f"/robot_{robot}/goal",
            "visualization_msgs/msg/Marker",
            time_s,
            **self._arrow(header, robot, own),
            color=self._make("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=1.0),
        )

    def _arrow(self, header: Any, robot: int, own: np.void) -> dict[str, Any]:  # noqa: ANN401
        """Return the fields of a Marker at a robot's target, all but its colour."""
        moment = self._make("builtin_interfaces/msg/Duration", sec=0, nanosec=0)
        empty = np.zeros(0, np.uint8)
        return {
            "header": header,
            "ns": "goals",
            "id": robot,
            "type": 0,
            "action": 0,
            "pose": self._pose(own["target"]),
            "scale": self._vector(*ARROW_M),
            "lifetime": moment,
            "frame_locked": False,
            "points": [],
            "colors": [],
            "texture_resource": "",
            "texture": self._make("sensor_msgs/msg/CompressedImage", header=header, format="", data=empty),
            "uv_coordinates": [],
            "text": "",
            "mesh_resource": "",
            "mesh_file": self._make("visualization_msgs/msg/MeshFile", filename="", data=empty),
            "mesh_use_embedded_materials": False,
        }

    def _write_scan(self, number: int, time_s: float) -> None:
        """Write the hits of a scan in the log as points in its robot's frame: x along the gaze."""
        log, robot = self._log, int(self._log.robot[number])
        sensor = self._missions.scenario.kind_of(robot).sensor
        model, (yaw, pitch) = sensor_model(sensor), log.pose[number, 3:].tolist()
        hit = log.returned[number, : sensor.rays] == int(Return.HIT)
        ranges_m = log.range_m[number, : sensor.rays][hit]
        rays = ray_directions(model.yaw_offsets, model.pitch_offsets, yaw, pitch)[hit]
        rays = rays @ gaze_matrix(yaw, pitch)
        points = (rays * ranges_m[:, None]).astype("<f4")
        fields = [
            self._make("sensor_msgs/msg/PointField", name=axis, offset=4 * number, datatype=7, count=1)
            for number, axis in enumerate("xyz")
        ]
        self._write(
            f"/robot_{robot}/scan",
            "sensor_msgs/msg/PointCloud2",
            time_s,
            header=self._header(time_s, f"robot_{robot}"),
            height=1,
            width=len(points),
            fields=fields,
            is_bigendian=False,
            point_step=12,
            row_step=12 * len(points),
            data=np.frombuffer(points.tobytes(), np.uint8),
            is_dense=True,
        )

    def _write_map(self, time_s: float) -> None:
        """Write what the team knows."""
        belief = joint_map(self._missions)
        if belief.grid.flat:
            self._write_plan(belief, time_s)
        elif belief.known.any():
            grid = dataclasses.replace(belief.grid, origin_m=(0.0, 0.0, 0.0))
            tree = octomap_of(dataclasses.replace(belief, grid=grid), full=False)
            data = np.frombuffer(tree[tree.index(b"\ndata\n") + 6 :], np.int8)
            about = {"binary": True, "id": "OcTree", "resolution": grid.voxel_size_m, "data": data}
            header = self._header(time_s, "octomap")
            self._write("/octomap", "octomap_msgs/msg/Octomap", time_s, header=header, **about)

    def _write_plan(self, belief: Map, time_s: float) -> None:
        """Write an OccupancyGrid."""
        header, grid = self._header(time_s, "map"), belief.grid
        percent = percent_of(belief.labels()[:, :, 0])
        corner = np.array([*grid.origin_m[:2], 0.0, 0.0, 0.0])
        about = self._make(
            "nav_msgs/msg/MapMetaData",
            map_load_time=header.stamp,
            resolution=grid.voxel_size_m,
            width=grid.shape[0],
            height=grid.shape[1],
            origin=self._pose(corner),
        )
        rows = np.ascontiguousarray(percent.T).ravel()
        self._write("/map", "nav_msgs/msg/OccupancyGrid", time_s, header=header, info=about, data=rows)

"""Small sound files of every kind that the workbench reads, made here: what tests damage."""

from __future__ import annotations

import io
import json
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import parquet

ROBOT = """<?xml version="1.0"?>
<robot name="leg">
<link name="trunk"><inertial><mass value="0.5"/><inertia ixx="4e-4" iyy="7e-4" izz="9e-4" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.12 0.08 0.04"/></geometry></collision></link>
<link name="thigh"><inertial><origin xyz="0 0 -0.05"/><mass value="0.06"/>
<inertia ixx="5e-5" iyy="5e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="shank"><inertial><origin xyz="0 0 -0.04"/><mass value="0.03"/>
<inertia ixx="3e-5" iyy="3e-5" izz="3e-6" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 -0.09"/><geometry><sphere radius="0.01"/></geometry></collision></link>
<joint name="hip" type="revolute"><parent link="trunk"/><child link="thigh"/><origin xyz="0.01 0 -0.02" rpy="0.1 0 0"/>
<axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5" effort="2" velocity="6"/></joint>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><origin xyz="0 0 -0.1"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="2" velocity="6"/><dynamics damping="0.01" friction="0.02"/></joint>
</robot>
"""
SDF = """<sdf version="1.9"><model name="m">
<link name="r"><inertial><mass>1</mass><inertia><ixx>.001</ixx><iyy>.001</iyy><izz>.001</izz></inertia></inertial>
<collision name="c"><geometry><sphere><radius>0.05</radius></sphere></geometry></collision></link>
<link name="a"><pose>0 0 -0.1 0 0 0</pose><inertial><mass>.1</mass><inertia><ixx>.0001</ixx><iyy>.0001</iyy><izz>.0001</izz>
</inertia></inertial><visual name="v"><geometry><box><size>.02 .02 .05</size></box></geometry></visual></link>
<joint name="j" type="revolute"><parent>r</parent><child>a</child><axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>1</upper>
<effort>1.5</effort></limit></axis></joint></model></sdf>
"""
SERVO = """model: AX-12A
stall_torque: 1.5
no_load_speed: 6.18
rated_voltage: 12.0
supply_voltage: 11.1
compliance_slope: 32
compliance_margin: 1
punch: 32
coulomb_friction: 0.06
viscous_friction: 0.01
reflected_inertia: 0.0065
"""
MODEL = "format: 1\nrobot: {}\nservos:\n  " + SERVO.strip().replace("\n", "\n  ") + """
effects:
- {effect: backlash, where: [flm], parameters: {gap: 3.1}}
posterior: {names: [backlash(flm).gap], mean: [3.1], covariance: [[0.01]]}
provenance: {seed: 0}
"""
MTN = """type=motion
version=1.01
enable=0 1 0 0 1 1 1 1 1 1 1 1 1 1 1 1 1 1 0 0 0 0 0 0 0 0
motor_type=0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0
page_begin
name=Step
compliance=5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5 5
play_param=0 0 2 1.0 32
step=512 512 512 512 560 470 512 512 512 512 512 512 512 512 512 512 540 512 512 512 512 512 512 512 512 512 0.000 0.400
step=512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 512 0.008 0.400
page_end
"""
POSES = "time,blb,flm\n0,0,0\n0.4,10.5,-3\n0.8,-4,12\n1.2,0,0\n"


def swing(rows: int = 150, rate: float = 50.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], goals and positions [deg] of a servo that follows a swing three rows late, in counts of a 4096th of a turn."""
    time = np.arange(rows) / rate
    goal = 30 * np.sin(4.4 * time)
    late = np.concatenate([np.zeros(3), goal[:-3]]) * 0.97
    return time, goal, np.round(late / (360 / 4096)) * (360 / 4096)


def joint_log(time: np.ndarray, goal: np.ndarray, position: np.ndarray, joint: str = "arm") -> str:
    """As CSV."""
    rows = [f"{t:.6g},{g:.6g},{p:.6g}" for t, g, p in zip(time, goal, position)]
    return "\n".join([f"time,goal.{joint},position.{joint}", *rows]) + "\n"


def motive(frames: int = 240, bodies: int = 1, *, units: str = "Meters", seed: int = 1, rate: float = 120.0) -> list[list[str]]:
    """Cells of a Motive CSV of bodies that swing under noise of 0.1 mm, rows of the header first."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / rate
    header = [["Format Version", "1.23", "Take Name", "demo", "Capture Frame Rate", f"{rate:.6f}", "Export Frame Rate",
               f"{rate:.6f}", "Total Exported Frames", str(frames), "Rotation Type", "Quaternion", "Length Units", units,
               "Coordinate Space", "Global"], []]
    names = [n for k in range(bodies) for n in [f"Body{k}"] * 7]
    header += [["", "Type", *["Rigid Body"] * len(names)], ["", "Name", *names], ["", "ID", *["AA"] * len(names)],
               ["", "", *(["Rotation"] * 4 + ["Position"] * 3) * bodies], ["Frame", "Time (Seconds)", *list("XYZWXYZ") * bodies]]
    columns = []
    for k in range(bodies):
        turn = 0.5 * np.sin(3 * time + k) / 2
        place = np.column_stack([0.1 + 0.05 * np.sin(2 * time), np.full(frames, 0.1 + 0.05 * k), 0.05 + 0 * time])
        columns += [0 * time, 0 * time, np.sin(turn), np.cos(turn), *(place + rng.normal(0, 1e-4, place.shape)).T]
    rows = [[str(n), f"{t:.6f}", *[f"{c[n]:.6f}" for c in columns]] for n, t in enumerate(time)]
    return header + rows


def as_csv(cells: list[list[str]]) -> str:
    """Cells as text."""
    return "\n".join(",".join(row) for row in cells) + "\n"


def bam_log() -> str:
    """Of a pendulum's servo."""
    time, goal, position = swing(60)
    entries = [{"timestamp": float(t), "position": float(np.deg2rad(p)), "goal_position": float(np.deg2rad(g)), "speed": 0.0,
                "load": 3, "input_volts": 7.4, "temp": 30, "torque_enable": True} for t, g, p in zip(time, goal, position)]
    return json.dumps({"motor": "m", "mass": 0.5, "entries": entries})


def sage(names: tuple[str, ...] = ("",), compressed: bool = True) -> bytes:
    """An npz of programmes."""
    time, goal, position = swing(60)
    arrays = {}
    for name in names:
        prefix = f"{name}/" if name else ""
        arrays |= {f"{prefix}t_cmd": time, f"{prefix}t_meas": time + 0.001}
        arrays[f"{prefix}q_cmd"] = np.deg2rad(np.tile(goal[:, None], 6))
        arrays[f"{prefix}q_meas"] = np.deg2rad(np.tile(position[:, None], 6))
    out = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(out, **arrays)
    return out.getvalue()


def lerobot(scale: tuple[float, ...] = (1.0, 1.0), episodes: int = 1) -> bytes:
    """A parquet file of LeRobot; scale: units for each degree, of each joint."""
    time, goal, position = swing(90, 30.0)
    table = {"timestamp": pa.array(np.tile(time, episodes), pa.float32()),
             "action": pa.array(np.tile(np.outer(goal, scale), (episodes, 1)).tolist(), pa.list_(pa.float32())),
             "observation.state": pa.array(np.tile(np.outer(position, scale), (episodes, 1)).tolist(), pa.list_(pa.float32())),
             "episode_index": pa.array(np.repeat(np.arange(episodes), len(time)))}
    out = io.BytesIO()
    parquet.write_table(pa.table(table), out)
    return out.getvalue()


def ros_csv() -> str:
    """As `rostopic echo -p` writes it."""
    time, goal, position = swing(60)
    rows = [f"{1_700_000_000_000_000_000 + round(t * 1e9)},knee,{np.deg2rad(g):.6g},{np.deg2rad(p):.6g}"
            for t, g, p in zip(time, goal, position)]
    return "\n".join(["%time,field.joint_names0,field.desired.positions0,field.actual.positions0", *rows]) + "\n"


def rollout(folder: Path) -> bytes:
    """A table as `simulate` writes it."""
    from workbench.motion import load_motion
    from workbench.recording.formats.rollout_table import save_rollout
    from workbench.recording.take import Take

    time, _, position = swing(40)
    (folder / "poses.csv").write_text(POSES)
    take = Take(name="a", source="simulation", time=time, joints=("blb",), q=np.deg2rad(position)[:, None], starts_at=0.1,
                commands=load_motion(folder / "poses.csv").commands(2))
    return save_rollout(take, folder / "rollout.csv").read_bytes()


SESSION = """format: 1
robot: {model: robot.urdf, base: trunk, servos: servo.yaml}
ground: {friction: 0.6, stiffness: 1.0e5, dissipation: 20.0}
takes:
- {name: swing, recording: legs.csv, base: fixed, starts_at: 0.0}
predict:
- {name: other, commands: commands.csv, servos: {supply_voltage: 10.0}, base: fixed}
"""
RAW = """type,timestamp,positions,velocities,torques
state,1000000,"[0.0, 0.1]","[0.0, 0.0]","[0.1, 0.0]"
state,1020000,"[0.01, 0.1]","[0.5, 0.0]","[0.1, 0.0]"
state,1040000,"[0.03, 0.09]","[0.7, -0.5]","[0.2, 0.1]"
"""
COMPARISON = json.dumps({"format": 1, "joints_by_error": [["walk", "flm", 1.12]], "takes": [{
    "name": "walk", "starts_at": 0.412, "joints": {"flm": {"error": 1.12, "noise": 0.12, "floor": 0.05, "unit": "deg"}},
    "distance": {"recorded": 0.25, "simulated": 0.27}}]})


def beside(folder: Path) -> None:
    """Writes what a session and a folder of a programme name, beside the file that is damaged."""
    time, goal, position = swing(60)
    (folder / "robot.urdf").write_text(ROBOT)
    (folder / "servo.yaml").write_text(SERVO)
    rows = [f"{t:.6g},{g:.6g},{p:.6g},{g / 2:.6g},{p / 2:.6g}" for t, g, p in zip(time, goal, position)]
    (folder / "legs.csv").write_text("\n".join(["time,goal.hip,position.hip,goal.knee,position.knee", *rows]) + "\n")
    rows = [f"{t:.6g},{g:.6g},{g / 2:.6g},1,1,{'0,0,0,0' if not i else ',,,'}" for i, (t, g) in enumerate(zip(time, goal))]
    (folder / "commands.csv").write_text(
        "\n".join(["time,goal.hip,goal.knee,enabled.hip,enabled.knee,position.hip,velocity.hip,position.knee,velocity.knee",
                   *rows]) + "\n")
    (folder / "joint_list.txt").write_text("a\nb\n")
    (folder / "speed.txt").write_text("# joints: blb flm\n2,\n60, 30,\n20, 30,\n")
    (folder / "timeDiff.txt").write_text("# joints: blb flm\n2,\n400,\n400,\n")
    (folder / "control.csv").write_text("".join(
        ["type,timestamp,positions\n", *(f'control,{1_000_000 + 20_000 * k},"[0.0, 0.1]"\n' for k in range(3))]))


@cache
def corpus(folder: Path) -> dict[str, bytes]:
    """Sound files by name; `folder` for what has to be written to be made."""
    return {
        "motive.csv": as_csv(motive(40, 2)).encode(), "log.csv": joint_log(*swing(60)).encode(), "bam.json": bam_log().encode(),
        "ros.csv": ros_csv().encode(), "programmes.npz": sage(("one", "two")), "plain.npz": sage(compressed=False),
        "episode.parquet": lerobot(), "poses.csv": POSES.encode(), "page.mtn": MTN.encode(), "servo.yaml": SERVO.encode(),
        "model.yaml": MODEL.encode(), "robot.urdf": ROBOT.encode(), "robot.sdf": SDF.encode(), "rollout.csv": rollout(folder),
        "session.yaml": SESSION.encode(), "state_motor.csv": RAW.encode(), "comparison.json": COMPARISON.encode(),
        "pos.txt": b"# joints: blb flm\n2,\n512, 500,\n520, 490,\n",
    }

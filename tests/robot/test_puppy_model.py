"""The puppy that ships: its names, masses, lengths, inertias, contact shapes and meshes, and that it stands."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Role
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import RevoluteJoint
from pydrake.systems.framework import DiagramBuilder

from models.build_puppy import ROOT, build
from models.puppy_assembly import links, read_parts
from models.puppy_sdf import Inertia, combined, hunt_crossley_dissipation, part_inertia, read_signs
from models.puppy_shapes import Solid, box, part_shapes
from workbench.robot import BUS_IDS, COUNT, JOINTS, RIGID_BODIES, ConfigureParser, ServoConstants, puppy_model, resource_dir
from workbench.simulation import Simulation, SimulationConfig

TABLE = read_parts(ROOT / "data/parts.csv")
SDF = resource_dir("models") / "puppy" / "puppy.sdf"
WEBOTS = {"t": 0.012, "m": 0.126, "b": {"f": 0.032, "b": 0.034}, "tail": 0.146}
"""Masses [kg] measured for the Webots BioloidDog on the same servos and frames."""


@pytest.fixture(scope="module")
def parsed():
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.001)
    parser = Parser(plant)
    parser.SetStrictParsing()  # a warning in the SDF is an error
    ConfigureParser(parser)
    (instance,) = parser.AddModelsFromUrl("package://puppy/puppy.sdf")
    plant.Finalize()
    return plant, scene_graph, instance, builder.Build()


def test_names_tree_and_axes_are_the_thesis_s():
    kinematics = puppy_model().kinematics
    assert kinematics.joints == JOINTS == tuple(sorted(BUS_IDS))
    assert set(kinematics.links) == {f"{j}_link" for j in JOINTS} | {"body_link"}
    assert set(RIGID_BODIES.values()) <= set(kinematics.links)
    parents = {j: kinematics.frames[j].parent for j in JOINTS}
    assert parents == {"tail": "body_link", "neck": "body_link", "head": "neck_link"} | {
        f"{end}{side}{part}": f"{end}{side}{above}_link" if above else ("body_link" if end == "f" else "tail_link")
        for end in "fb" for side in "lr" for part, above in (("t", ""), ("m", "t"), ("b", "m"))}
    for j in JOINTS:
        assert np.allclose(np.abs(kinematics.frames[j].axis), [1, 0, 0] if len(j) == 3 and j[2] == "t" else [0, 1, 0])
        assert np.allclose(kinematics.frames[j].X_PF_R, np.eye(3))
        assert np.allclose(kinematics.frames[j].X_MB_R, np.eye(3))


def test_signs_are_those_of_the_table_and_mirror_each_other():
    signs = read_signs(ROOT / "data/joint_signs.csv")
    for j, frame in puppy_model().kinematics.frames.items():
        axis, sign = signs[j]
        assert np.array_equal(frame.axis, sign * np.eye(3)["xy".index(axis)])
    for end in "fb":
        for part, relation in (("t", 1), ("m", -1), ("b", -1)):  # the ROBOTIS walk: mirrored servos have opposite angles
            assert signs[f"{end}l{part}"][1] == relation * signs[f"{end}r{part}"][1]


def test_signs_are_those_of_the_servos_as_drawn():
    """Seen from the horn, a servo and the link on its horn turn counterclockwise; a link on its case turns the other way."""
    signs = read_signs(ROOT / "data/joint_signs.csv")
    tree = {link.name: link for link in links(TABLE.length)}
    servos = [(link, link.p_BL + at.p_LP, at.R_LP[:, 2]) for link in tree.values() for at in link.parts if at.part == "ax12a"]
    assert len(servos) == 15
    for link in tree.values():
        if link.joint is None:
            continue
        axis, sign = signs[link.joint]
        e = np.eye(3)["xy".index(axis)]
        (found,) = [(owner, horn) for owner, p, horn in servos if owner.name in (link.name, link.parent)
                    and abs(horn @ e) > 0.99 and np.linalg.norm(np.cross(p - link.p_BL, e)) < 1e-9]
        owner, horn = found
        assert sign == round(float(horn @ e)) * (1 if owner.name == link.parent else -1), link.joint


def test_masses_are_near_those_measured_on_the_same_parts():
    masses = puppy_model().kinematics.masses
    for leg in ("fl", "fr", "bl", "br"):
        assert masses[f"{leg}t_link"] == pytest.approx(WEBOTS["t"], rel=0.05)
        assert masses[f"{leg}m_link"] == pytest.approx(WEBOTS["m"], rel=0.05)
        assert masses[f"{leg}b_link"] == pytest.approx(WEBOTS["b"][leg[0]], rel=0.05)
    assert masses["tail_link"] == pytest.approx(WEBOTS["tail"], rel=0.05)
    # The whole: Webots without neck and head is 1.52 kg with a CM-5 and its pack of cells. Ours has a CM-530 and a lithium pack
    # (lighter by 0.126 kg + cells of unknown mass - 0.144 kg), and neck and head (one servo and brackets, heavier by 0.1 kg).
    # Neither has been weighed, so 15 % either side of 1.52 kg; and never below what is known of it.
    total = sum(masses.values())
    assert total == pytest.approx(1.52, rel=0.15)
    assert total > 15 * 0.0546 + 0.054 + 4 * (0.012 + 0.017 + 0.022)
    assert sum(masses.values()) == pytest.approx(sum(TABLE.mass[p.part] for link in links(TABLE.length) for p in link.parts))


def test_legs_are_as_long_as_measured_and_the_hind_ones_a_bit_shorter():
    poses = puppy_model().kinematics.forward(np.zeros((1, 15)))
    p = {name: at[0] for name, (at, _) in poses.items()}
    tips = {leg: p[f"{leg}b_link"][2] - lowest_contact(f"{leg}b_link") for leg in ("fl", "fr", "bl", "br")}
    for leg in tips:
        thigh = np.linalg.norm(p[f"{leg}m_link"] - p[f"{leg}b_link"])
        shank = p[f"{leg}b_link"][2] - tips[leg]
        # robot.md: 83 mm and about 89 mm from the model, 90 and 85 mm in its controller; 5 mm covers both
        assert thigh == pytest.approx(0.083, abs=0.0005)
        assert shank == pytest.approx(0.089, abs=0.005)
        assert shank == pytest.approx(0.085, abs=0.005)
    lengths = {leg: p[f"{leg}t_link"][2] - tip for leg, tip in tips.items()}
    assert lengths["fl"] == pytest.approx(lengths["fr"])
    assert lengths["bl"] == pytest.approx(lengths["br"])
    assert 0.001 < lengths["fl"] - lengths["bl"] < 0.01


def lowest_contact(link: str) -> float:
    """How far the foot's spheres reach below their link's origin [m]."""
    root = ET.parse(SDF).getroot()
    reach = [float(c.findtext("pose").split()[2]) - float(c.findtext("geometry/sphere/radius"))
             for c in root.iterfind(f".//link[@name='{link}']/collision") if c.get("name").startswith("foot_sphere")]
    assert len(reach) == 4
    return -min(reach)


def test_every_inertia_is_physically_valid(parsed):
    plant, _, instance, _ = parsed
    context = plant.CreateDefaultContext()
    for index in plant.GetBodyIndices(instance):
        M = plant.get_body(index).CalcSpatialInertiaInBodyFrame(context)
        assert M.IsPhysicallyValid()
        principal = np.sort(np.linalg.eigvalsh(M.Shift(M.get_com()).CalcRotationalInertia().CopyToFullMatrix3()))
        assert principal[0] > 1e-7 * M.get_mass()
        assert principal[2] < principal[0] + principal[1]
        assert np.linalg.norm(M.get_com()) < 0.1


def test_inertias_agree_with_closed_forms():
    shape = [Solid(box((-10, 10), (-20, 20), (-30, 30)), (0, 0, 0)), Solid(box((-90, 90), (0, 1), (0, 1)), (0, 0, 0), False)]
    got = part_inertia(shape, 0.12)
    assert np.allclose(got.I_com, 0.12 / 12 * np.diag([0.04**2 + 0.06**2, 0.02**2 + 0.06**2, 0.02**2 + 0.04**2]))
    two = combined([Inertia(1.0, np.array([d, 0, 0]), np.zeros((3, 3))) for d in (0.0, 0.2)])
    assert np.allclose(two.com, [0.1, 0, 0])
    assert np.allclose(two.I_com, np.diag([0, 0.02, 0.02]))


def test_drives_have_the_servo_s_limits_and_inertia(parsed):
    plant, _, instance, _ = parsed
    assert plant.num_actuators(instance) == 15
    for index in plant.GetJointActuatorIndices(instance):
        actuator = plant.get_joint_actuator(index)
        joint = actuator.joint()
        assert isinstance(joint, RevoluteJoint)
        assert actuator.effort_limit() == 1.5
        assert actuator.default_gear_ratio() == 254
        assert actuator.default_reflected_inertia() == pytest.approx(ServoConstants().reflected_inertia, rel=1e-6)
        assert joint.position_lower_limits()[0] == pytest.approx(-512 * COUNT)
        assert joint.position_upper_limits()[0] == pytest.approx(511 * COUNT)
        assert joint.velocity_upper_limits()[0] == 6.18
        assert joint.default_damping() == 0


def test_feet_have_both_contact_models_of_the_same_stiffness_and_dissipation(parsed):
    plant, scene_graph, _, _ = parsed
    inspector = scene_graph.model_inspector()
    for leg in ("fl", "fr", "bl", "br"):
        shapes = {inspector.GetName(g).split("::")[-1]: inspector.GetProximityProperties(g)
                  for g in plant.GetCollisionGeometriesForBody(plant.GetBodyByName(f"{leg}b_link"))}
        assert {f"foot_sphere_{i}" for i in range(4)} | {"foot_hydro", "shank"} == set(shapes)
        for name, properties in shapes.items():
            friction = properties.GetProperty("material", "coulomb_friction")
            assert (friction.static_friction(), friction.dynamic_friction()) == (0.7, 0.5)
            assert properties.GetProperty("material", "hunt_crossley_dissipation") == pytest.approx(
                hunt_crossley_dissipation(sum(puppy_model().kinematics.masses.values()) / 4), rel=1e-6)
            if name.startswith("foot_sphere"):
                assert properties.GetProperty("material", "point_contact_stiffness") == 1e4
        assert shapes["foot_hydro"].HasProperty("hydroelastic", "hydroelastic_modulus")
        assert not shapes["foot_sphere_0"].HasProperty("hydroelastic", "hydroelastic_modulus")


def test_dissipation_stops_a_foot_where_the_thesis_s_damper_does():
    m, K, D, speed = 0.34, 1e4, 1e2, 0.1
    d = hunt_crossley_dissipation(m, K, D, speed)
    depth = []
    for force in (lambda x, v: K * x + D * v, lambda x, v: K * x * (1 + d * v)):
        x, v, dt = 0.0, speed, 1e-7
        while v > 0:
            v -= force(x, v) / m * dt
            x += v * dt
        depth.append(x)
    assert depth[0] == pytest.approx(depth[1], rel=1e-3)
    with pytest.raises(ValueError, match="underdamped"):
        hunt_crossley_dissipation(0.1, K, D, speed)


@pytest.mark.parametrize("contact", ["point", "hydroelastic"])
def test_neutral_pose_stands(contact):
    take = Simulation(puppy_model(), SimulationConfig(time_step=2e-3, contact=contact, settle=0.5)).run(None, 1.0)
    assert np.all(np.isfinite(take.p_WB))
    assert np.ptp(take.p_WB, axis=0).max() < 1e-3
    assert take.p_WB[-1, 2] == pytest.approx(0.185, abs=0.004)
    w, x, y, z = take.quat_WB[-1]
    pitch = np.arcsin(2 * (w * y - z * x))
    assert np.radians(-3) < pitch < np.radians(-0.3)  # tilted back by the shorter hind legs, as the thesis says
    assert abs(np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))) < np.radians(0.5)
    assert np.abs(take.q).max() < np.radians(6)
    feet = np.sum([take.contact[f][-1] for f in take.contact], axis=0)
    assert feet[2] == pytest.approx(9.81 * sum(puppy_model().kinematics.masses.values()), rel=0.03)


def test_build_gives_what_is_shipped_and_gives_it_twice(tmp_path: Path):
    first, second = build(tmp_path / "a"), build(tmp_path / "b")
    for made in sorted((tmp_path / "a").rglob("*.*")):
        assert made.read_bytes() == (tmp_path / "b" / made.relative_to(tmp_path / "a")).read_bytes()
    assert first.read_bytes() == second.read_bytes()
    # On another machine's libm the last digits may differ: numbers to a tolerance, everything else to the letter.
    for made, shipped in zip(first.read_text().split("<"), SDF.read_text().split("<")):
        assert [word if not is_number(word) else "#" for word in made.replace(">", " ").split()] == [
            word if not is_number(word) else "#" for word in shipped.replace(">", " ").split()]
    numbers = [np.array([float(w) for w in p.read_text().replace("<", " ").replace(">", " ").split() if is_number(w)])
               for p in (first, SDF)]
    assert np.allclose(*numbers, rtol=1e-6, atol=1e-12)
    for made in (tmp_path / "a" / "meshes").iterdir():
        ours, theirs = (trimesh.load(p, force="mesh") for p in (made, SDF.parent / "meshes" / made.name))
        assert np.allclose(ours.bounds, theirs.bounds, atol=1e-6)
        assert ours.area == pytest.approx(theirs.area, rel=1e-5)


def is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def test_visuals_load_and_stay_small(parsed):
    plant, scene_graph, instance, _ = parsed
    inspector = scene_graph.model_inspector()
    shown = [g for b in plant.GetBodyIndices(instance) for g in inspector.GetGeometries(
        plant.GetBodyFrameIdOrThrow(b), Role.kIllustration)]
    assert len(shown) == sum(len(link.parts) for link in links(TABLE.length))
    assert sum(f.stat().st_size for f in SDF.parent.rglob("*") if f.is_file()) < 400e3


def test_drawn_parts_have_the_sizes_of_the_table():
    shapes = part_shapes(dict(TABLE.size), TABLE.length["foot_corner"], TABLE.length["foot_radius"])
    assert set(shapes) == set(TABLE.mass)
    for name in ("ax12a", "f3", "cm530", "lbs10", "foot"):
        drawn = np.sort(np.ptp(np.vstack([s.mesh.bounds for s in shapes[name] if s.massive]), axis=0))
        assert np.allclose(drawn, np.sort(TABLE.size[name]), atol=1e-4), name


def test_every_row_of_the_parts_table_says_where_it_comes_from():
    import csv

    with (ROOT / "data/parts.csv").open(encoding="utf-8", newline="") as f:
        rows = list(csv.DictReader(line for line in f if not line.startswith("#")))
    for row in rows:
        assert row["size_mark"] in {"measured", "sourced", "derived", "unsure"}, row["name"]
        assert (row["mass_mark"] in {"measured", "sourced", "derived", "unsure"}) == (row["kind"] == "part"), row["name"]
        assert len(row["source"]) > 10, row["name"]

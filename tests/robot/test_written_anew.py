"""A robot file that is rewritten within one process, as studies and other projects do, is read again."""

from workbench.robot import Kinematics, RobotModel, foot_points


def test_a_file_that_changed_is_not_taken_for_what_it_was(tmp_path):
    path = tmp_path / "robot.sdf"
    origins = []
    for y in (0.05, 0.08):
        path.write_text(
            f"""<sdf version="1.9"><model name="m"><link name="a"><inertial><mass>1</mass></inertial></link>
            <link name="b"><pose>0 {y} 0 0 0 0</pose><inertial><mass>1</mass></inertial></link>
            <joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint>
            </model></sdf>""", encoding="utf-8")
        k = Kinematics.from_file(path)
        origins.append(k.forward([[0.0]])["b"][0][0][1])
    assert origins == [0.05, 0.08]


def test_nor_are_its_feet(tmp_path):
    path, lowest = tmp_path / "robot.sdf", []
    for z in (-0.1, -0.12):
        path.write_text(f"""<?xml version="1.0"?><sdf version="1.7"><model name="leg">
            <link name="body_link"><inertial><mass>1</mass></inertial></link>
            <link name="flb_link"><inertial><mass>0.1</mass></inertial><collision name="foot"><pose>0 0 {z} 0 0 0</pose>
            <geometry><sphere><radius>0.01</radius></sphere></geometry></collision></link>
            <joint name="flb" type="revolute"><parent>body_link</parent><child>flb_link</child>
            <axis><xyz>0 1 0</xyz></axis></joint>
            </model></sdf>""", encoding="utf-8")
        points, radii = foot_points(RobotModel(str(path)))["flb"]
        lowest.append(float((points[:, 2] - radii).min()))
    assert lowest == [-0.11, -0.13]

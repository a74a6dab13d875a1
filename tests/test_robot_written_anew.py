"""A robot's file that is written anew in one process, as studies and other projects do, is read anew."""

from pathlib import Path

from workbench.robot import Kinematics


def test_a_file_that_changed_is_not_taken_for_what_it_was(tmp_path):
    path = tmp_path / "robot.sdf"
    origins = []
    for y in (0.05, 0.08):
        path.write_text(
            f"""<sdf version="1.9"><model name="m"><link name="a"><inertial><mass>1</mass></inertial></link>
            <link name="b"><pose>0 {y} 0 0 0 0</pose><inertial><mass>1</mass></inertial></link>
            <joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint>
            </model></sdf>""", encoding="utf-8")
        k = Kinematics.from_file(Path(path))
        origins.append(k.forward([[0.0]])["b"][0][0][1])
    assert origins == [0.05, 0.08]

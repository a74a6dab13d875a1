"""File kinds that the workbench does not read, by their first bytes: the name of each, and how to convert it."""

from __future__ import annotations

from dataclasses import dataclass

_LFS = b"version https://git-lfs"


@dataclass(frozen=True)
class Kind:
    """A kind of file that is not read. name: its name. remedy: how to convert it."""

    name: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.name}; {self.remedy}"


_TABLE = "a table with time, goal.J and position.J [deg] of each joint J"
_UNPACK = "unpack it and name the file inside"
_VIDEO = Kind("a video or picture", "record the servos' positions, or rigid bodies by motion capture")
_MAT = Kind("a MATLAB file (MAT)", f"write {_TABLE} with writetable(array2table(...), 'log.csv')")
_DESCRIBED = "name the robot's SDF or URDF, which says where its meshes are"
_USD = Kind("a scene of OpenUSD", "name the URDF or SDF that it was made of; Isaac Sim exports URDF")
_BEGINNINGS: tuple[tuple[int, bytes, Kind], ...] = (
    (0, b"\x89MCAP0\r\n", Kind("a bag of ROS 2 (MCAP)", "name its joint topics' table, made by PlotJuggler or `mcap cat`")),
    (0, b"#ROSBAG V", Kind("a bag of ROS 1 (rosbag)", "make a table of its joint topics: rostopic echo -b BAG -p TOPIC > "
                                                      "log.csv")),
    (0, b"SQLite format 3\0", Kind("an SQLite database, as a bag of ROS 2 is (.db3)", "name the bag's folder with its "
                                                                                      "metadata.yaml, or "
                                   f"write {_TABLE}")),
    (0, b"\x89HDF\r\n\x1a\n", Kind("an HDF5 file (h5, MAT 7.3, LeRobot or robomimic episodes)", f"write {_TABLE}, with h5py and "
                                    "pandas")),
    (0, b"MATLAB 5.0", _MAT), (0, b"MATLAB 7.3", _MAT),
    (0, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", Kind("an Excel workbook of the old kind (xls), or another Office file",
                                                   "save the sheet as CSV")),
    (0, b"PK\x03\x04", Kind("a zip archive", _UNPACK)), (0, b"PK\x05\x06", Kind("an empty zip archive", _UNPACK)),
    (0, b"\x1f\x8b", Kind("a gzip archive", _UNPACK)), (0, b"BZh", Kind("a bzip2 archive", _UNPACK)),
    (0, b"\xfd7zXZ\0", Kind("an xz archive", _UNPACK)), (0, b"7z\xbc\xaf\x27\x1c", Kind("a 7z archive", _UNPACK)),
    (0, b"Rar!\x1a\x07", Kind("a rar archive", _UNPACK)), (0, b"\x28\xb5\x2f\xfd", Kind("a zstd archive", _UNPACK)),
    (257, b"ustar", Kind("a tar archive", _UNPACK)),
    (0, b"\x93NUMPY", Kind("a numpy array (npy) without names", f"write {_TABLE}, or an npz as SAGE's")),
    (0, b"\x80\x04", Kind("a Python pickle", f"it can run code and is not read; write {_TABLE} with pandas' to_csv")),
    (0, b"\x80\x05", Kind("a Python pickle", f"it can run code and is not read; write {_TABLE} with pandas' to_csv")),
    (0, b"ARROW1", Kind("an Arrow (Feather) file", f"write {_TABLE} with pandas' read_feather and to_csv")),
    (0, b"RRF2", Kind("a recording of Rerun (rrd)", f"write {_TABLE}")),
    (0, b"ULog\x01\x12\x35", Kind("a log of PX4 (ULog)", "make tables of it: ulog2csv FILE (pyulog)")),
    (0, b"TDSm", Kind("a TDMS file (LabVIEW)", f"write {_TABLE} with nptdms")),
    (0, b"MDF     ", Kind("a measurement file (MDF, MF4)", f"write {_TABLE} with asammdf")),
    (0, b"LOGG", Kind("a CAN log (BLF)", f"decode it and write {_TABLE}")),
    (0, b"HIERARCHY", Kind("a BVH skeleton", "export the rigid bodies (6 degrees of freedom), not a skeleton's joint angles")),
    (0, b"Kaydara FBX Binary", Kind("an FBX scene", "export the rigid bodies as CSV")),
    (0, b"PXR-USDC", _USD), (0, b"#usda", _USD), (0, b"ISO-10303-21", Kind("a CAD model (STEP)", _DESCRIBED)),
    (0, b"solid ", Kind("a mesh (STL)", _DESCRIBED)), (0, b"ply\n", Kind("a mesh (PLY)", _DESCRIBED)),
    (0, b"ply\r\n", Kind("a mesh (PLY)", _DESCRIBED)),
    (0, b"glTF", Kind("a 3D scene (glb)", "name the robot's SDF or URDF, which names its meshes")),
    (4, b"ftyp", _VIDEO), (0, b"RIFF", _VIDEO), (0, b"\x1aE\xdf\xa3", _VIDEO), (0, b"\xff\xd8\xff", _VIDEO), (0, b"GIF8", _VIDEO),
    (0, b"%PDF", Kind("a PDF document", "name the recording itself")),
    (0, b"\x7fELF", Kind("a program", "name the recording itself")),
)
_SUFFIXES = {
    ".tak": Kind("a take of Motive (.tak)", "export it in Motive: File, Export Tracking Data, CSV, with header, quaternions, "
                                            "Global"),
    ".c3d": Kind("a C3D file", "it is damaged, or no C3D: its second byte is not 0x50"),
    ".qtm": Kind("a capture of Qualisys (.qtm)", "export its 6D data in QTM: File, Export, TSV, with 6D and header"),
    ".x2d": Kind("a capture of Vicon (.x2d)", "reconstruct it and export trajectories or C3D in Nexus or Tracker"),
    ".system": Kind("a file of Vicon's system", "export segments from Nexus or Tracker as CSV"),
    ".stl": Kind("a mesh (STL)", _DESCRIBED), ".obj": Kind("a mesh (OBJ)", _DESCRIBED), ".usd": _USD, ".usda": _USD,
    ".usdc": _USD, ".usdz": _USD, ".f3d": Kind("a CAD model (Fusion)", _DESCRIBED),
    ".step": Kind("a CAD model (STEP)", _DESCRIBED),
    ".bin": Kind("a binary log", f"write {_TABLE}"), ".mat": _MAT,
    ".pkl": Kind("a Python pickle", f"it can run code and is not read; write {_TABLE} with pandas' to_csv")}


def kind_of_file(head: bytes, suffix: str = "") -> Kind | None:
    """The kind of a file that begins with `head` (at least 300 bytes, or all) and has this suffix; None if neither tells."""
    for at, beginning, kind in _BEGINNINGS:
        if head[at:at + len(beginning)] == beginning:
            return kind
    if len(head) > 1 and head[1] == 0x50 and 1 <= head[0] <= 20 and b"\0" in head[:64]:
        return Kind("a C3D file", "it is damaged, or of a kind that is not read")
    return _SUFFIXES.get(suffix.lower())


def lfs_pointer(head: bytes) -> str | None:
    """The message for a file that begins with `head` if that is a Git LFS pointer instead of the file itself; else None."""
    if not head.startswith(_LFS):
        return None
    return "the file is a Git LFS pointer: run `git lfs pull` where the repository was cloned"

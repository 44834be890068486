"""Grasps in files: what a grasp is there (stored.py), and one file for each format.

isaac         a YAML file; Isaac Sim and GraspDataGen read it, and `surehold grasp rate` everything that a run says
graspgen      a JSON file of poses and of whether each of them succeeds
dexgraspbench a folder of pickled NumPy dictionaries, one a grasp

Files are data only: nothing in them is executed, fetched or expanded, whoever wrote them.
"""

from surehold.grasping.formats.isaac import read_isaac_grasps, write_isaac_grasps
from surehold.grasping.formats.named import FORMATS, read_grasps
from surehold.grasping.formats.stored import GraspFile, StoredGrasp
from surehold.grasping.plain_data import grasp_to_dict

__all__ = [
    "FORMATS",
    "GraspFile",
    "StoredGrasp",
    "grasp_to_dict",
    "read_grasps",
    "read_isaac_grasps",
    "write_isaac_grasps",
]

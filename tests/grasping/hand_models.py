"""Small models of hands: a five-fingered one that can stand in any frame, three fingers, grippers, a linkage."""

import numpy as np

SLIDING = """
<mujoco><worldbody><body name="palm"><geom type="box" size=".05 .02 .01" pos="0 0 -.01"/>
  <body name="l" pos="-.01 0 0"><joint name="left_slide" type="slide" axis="-1 0 0" range="0 .04"/>
    <geom type="box" size=".006 .015 .035" pos="0 0 .035"/></body>
  <body name="r" pos=".01 0 0"><joint name="right_slide" type="slide" axis="1 0 0" range="0 .04"/>
    <geom type="box" size=".006 .015 .035" pos="0 0 .035"/></body>
</body></worldbody></mujoco>
"""
TURNING = """
<robot name="gripper">
  <link name="palm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size=".08 .04 .02"/></geometry></collision></link>
  <link name="l"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 .04"/><geometry><box size=".016 .03 .08"/></geometry></collision></link>
  <link name="r"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 .04"/><geometry><box size=".016 .03 .08"/></geometry></collision></link>
  <joint name="a" type="revolute"><parent link="palm"/><child link="l"/><origin xyz="-.04 0 .01"/>
    <axis xyz="0 1 0"/><limit lower="-.2" upper="1.2" effort="1" velocity="1"/></joint>
  <joint name="b" type="revolute"><parent link="palm"/><child link="r"/><origin xyz=".04 0 .01"/>
    <axis xyz="0 1 0"/><limit lower="-1.2" upper=".2" effort="1" velocity="1"/>
    <mimic joint="a" multiplier="-1"/></joint>
</robot>
"""
_LINKAGE = """
<mujoco><compiler angle="radian"/><worldbody><body name="base"><geom type="box" size=".04 .02 .02" pos="0 0 -.02"/>{}
</body></worldbody><equality>
  <connect body1="drive_l" body2="pad_l" anchor="0 0 .05"/><connect body1="drive_r" body2="pad_r" anchor="0 0 .05"/>
  <joint joint1="drive_r" joint2="drive_l" polycoef="0 1 0 0 0"/>
</equality><actuator><position joint="drive_l"/></actuator></mujoco>
"""
_SIDE = """
  <body name="drive_{s}" pos="{x} 0 0"><joint name="drive_{s}" axis="0 {a} 0" range="0 .5"/>
    <geom type="capsule" fromto="0 0 .01 0 0 .05" size=".005"/></body>
  <body name="inner_{s}" pos="{y} 0 .01"><joint name="inner_{s}" axis="0 {a} 0" range="0 .5"/>
    <geom type="capsule" fromto="0 0 .01 0 0 .04" size=".004"/>
    <body name="pad_{s}" pos="0 0 .05"><joint name="pad_{s}" axis="0 {a} 0" range="-.9 .1"/>
      <geom type="box" size=".004 .012 .025" pos="0 0 .025"/></body></body>"""


def linkage() -> str:
    """Return MJCF of a gripper of two parallelograms: one bar is driven, the other carries the pad, both hold it."""
    return _LINKAGE.format(_SIDE.format(s="l", x=-0.065, y=-0.05, a=1) + _SIDE.format(s="r", x=0.065, y=0.05, a=-1))


def mimicking_linkage() -> str:
    """Return MJCF of the same gripper as URDFs describe it: no loop is closed, all joints follow that of the left bar.

    Neither bar is a finger, and no joint of a finger leads.
    """
    pairs = (("drive_r", 1), ("inner_l", 1), ("inner_r", 1), ("pad_l", -1), ("pad_r", -1))
    equal = "".join(f'<joint joint1="{name}" joint2="drive_l" polycoef="0 {c} 0 0 0"/>' for name, c in pairs)
    model = linkage()
    start, end = model.index("<equality>"), model.index("</mujoco>")
    return f"{model[:start]}<equality>{equal}</equality>{model[end:]}"


def three_fingers(spread: float = 120.0) -> str:
    """Return MJCF of three fingers of two joints that stand up around a plate, the first one at -x."""
    fingers = ""
    for k, degrees in enumerate((180.0, 180.0 + spread, 180.0 - spread)):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        fingers += f"""
  <body name="p{k}" pos="{0.04 * c} {0.04 * s} .01" euler="0 0 {degrees}">
    <joint name="near{k}" axis="0 -1 0" range="-40 90"/><geom type="capsule" fromto="0 0 .01 0 0 .04" size=".008"/>
    <body name="q{k}" pos="0 0 .05"><joint name="far{k}" axis="0 -1 0" range="0 90"/>
      <geom type="capsule" fromto="0 0 .01 0 0 .03" size=".007"/></body></body>"""
    return f"""<mujoco><worldbody><body name="plate"><geom type="cylinder" size=".05 .01"/>{fingers}
</body></worldbody></mujoco>"""


def five_fingers(turn=None, mirrored=False, palm="palm", before="", after="", words=True) -> str:
    """Return MJCF of a hand: fingers along x, palm to z, thumb at +y, all of it turned by `turn` (3, 3).

    Joints take their ranges from default classes. `mirrored` puts the thumb at -y. Joints of fingers are spread and
    bend 1 to 3, those of the thumb swing (about x) and bend 1 and 2. Without `words` no name says which finger it is.
    """
    turn = np.eye(3) if turn is None else turn
    side = -1.0 if mirrored else 1.0

    def v(*xyz):
        return " ".join(f"{value:.9f}" for value in turn @ np.array(xyz))

    def capsule(start, end, size):
        return f'<geom class="skin" fromto="{v(*start)} {v(*end)}" size="{size}"/>'

    names = ("index", "middle", "ring", "little") if words else "abcd"
    fingers = ""
    for k, name in enumerate(names):
        y = side * (0.03 - 0.02 * k)
        fingers += f"""
  <body name="{name}_0" pos="{v(0.09, y, 0.0)}"><joint class="spread" name="{name}_spread" axis="{v(0, 0, 1)}"/>
    <geom class="skin" type="sphere" size=".007"/>
    <body name="{name}_1" pos="{v(0.01, 0, 0)}"><joint class="bend" name="{name}_bend_1" axis="{v(0, -1, 0)}"/>
      {capsule((0.005, 0, 0), (0.035, 0, 0), 0.008)}
      <body name="{name}_2" pos="{v(0.04, 0, 0)}"><joint class="bend" name="{name}_bend_2" axis="{v(0, -1, 0)}"/>
        {capsule((0.005, 0, 0), (0.025, 0, 0), 0.007)}
        <body name="{name}_3" pos="{v(0.03, 0, 0)}"><joint class="bend" name="{name}_bend_3" axis="{v(0, -1, 0)}"/>
          {capsule((0.005, 0, 0), (0.018, 0, 0), 0.006)}</body></body></body></body>"""
    thumb = "thumb" if words else "e"
    fingers += f"""
  <body name="{thumb}_0" pos="{v(0.03, side * 0.04, 0.0)}">
    <joint class="swing" name="{thumb}_swing" axis="{v(side, 0, 0)}"/>
    {capsule((0, 0, 0), (0, side * 0.02, 0), 0.009)}
    <body name="{thumb}_1" pos="{v(0.0, side * 0.025, 0)}">
      <joint class="bend" name="{thumb}_bend_1" axis="{v(0, 0, -side)}"/>
      {capsule((0, side * 0.005, 0), (0, side * 0.035, 0), 0.008)}
      <body name="{thumb}_2" pos="{v(0, side * 0.04, 0)}">
        <joint class="bend" name="{thumb}_bend_2" axis="{v(0, 0, -side)}"/>
        {capsule((0, side * 0.005, 0), (0, side * 0.022, 0), 0.007)}</body></body></body>"""
    x, y = turn[:, 0], turn[:, 1]
    named = f'name="{palm}"' if palm else ""
    return f"""<mujoco>
<default><default class="skin"><geom type="capsule"/></default><default class="bend"><joint range="0 90"/></default>
  <default class="spread"><joint range="-20 20"/></default>
  <default class="swing"><joint range="0 110"/></default></default>
<worldbody>{before}<body {named}>
  <geom type="box" size=".04 .04 .012" pos="{v(0.045, 0, -0.006)}"
    xyaxes="{x[0]} {x[1]} {x[2]} {y[0]} {y[1]} {y[2]}"/>{fingers}
</body>{after}</worldbody></mujoco>"""

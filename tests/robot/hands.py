"""URDF texts of made-up robots with bodies: a hand, carriages on a rail, a lift on a column."""

from __future__ import annotations

SHAPE = '<{kind}><origin xyz="0 0 {middle}"/><geometry><box size="{size}"/></geometry></{kind}>'


def hand(fingers: int = 4, *, pitch: float = 0.03, thumb: bool = True) -> str:
    """Return a hand with four joints a finger; the last joint of each follows the third.

    pitch: distance between neighbouring fingers, which are 24 mm wide [m]. The thumb stands before
    the palm and bends across the fingers; it has no follower.
    """
    parts = [
        '<robot name="hand"><link name="palm">'
        + _box(f"0.03 {pitch * fingers:.3f} 0.08", 0.04)
        + "</link>"
    ]
    for finger in range(fingers):
        y = pitch * (finger - 0.5 * (fingers - 1))
        name = f"finger{finger + 1}"
        parts += _joint(f"{name}_spread", "palm", f"{name}_base", (0.0, y, 0.082), "1 0 0", 0.35)
        parts.append(f'<link name="{name}_base"/>')
        above = f"{name}_base"
        for number, length in enumerate((0.045, 0.03, 0.025)):
            link = f"{name}_link{number + 1}"
            height = (0.0, 0.047, 0.032)[number]
            mimic = f'<mimic joint="{name}_bend2"/>' if number == 2 else ""
            parts += _joint(
                f"{name}_bend{number + 1}", above, link, (0.0, 0.0, height), "0 1 0", 1.6, mimic
            )
            parts.append(f'<link name="{link}">{_box(f"0.02 0.024 {length}", length / 2)}</link>')
            above = link
    if thumb:
        parts += _joint("thumb_turn", "palm", "thumb_base", (0.05, 0.0, 0.02), "0 0 1", 1.2)
        parts.append('<link name="thumb_base"/>')
        above = "thumb_base"
        for number in range(3):
            place = (0.0, 0.0, 0.0 if number == 0 else 0.037)
            link = f"thumb_link{number + 1}"
            parts += _joint(f"thumb_bend{number + 1}", above, link, place, "0 1 0", 1.4)
            parts.append(f'<link name="{link}">{_box("0.02 0.02 0.035", 0.0175)}</link>')
            above = link
    return "\n".join([*parts, "</robot>\n"])


def rail(kind: str = "collision", gap: float = 0.2) -> str:
    """Return two carriages of 50 mm on one rail, whose middles are ``gap`` [m] apart at rest.

    kind: the element of their shapes. A third one follows the second, 100 mm behind it. Their
    middles are 100 mm above the table.
    """
    shape = SHAPE.format(kind=kind, middle=0.1, size="0.05 0.05 0.05")
    return f"""<robot name="rail">
<link name="base"/>
<link name="left">{shape}</link>
<link name="right">{shape}</link>
<link name="follower">{shape}</link>
<joint name="slide_left" type="prismatic"><parent link="base"/><child link="left"/>
<axis xyz="1 0 0"/><limit lower="-0.1" upper="0.5" velocity="0.5" effort="1"/></joint>
<joint name="slide_right" type="prismatic"><parent link="base"/><child link="right"/>
<origin xyz="{gap} 0 0"/><axis xyz="1 0 0"/>
<limit lower="-0.5" upper="0.3" velocity="0.5" effort="1"/></joint>
<joint name="slide_follower" type="prismatic"><parent link="base"/><child link="follower"/>
<origin xyz="{gap + 0.1} 0 0"/><axis xyz="1 0 0"/><mimic joint="slide_right"/>
<limit lower="-0.5" upper="0.3" velocity="0.5" effort="1"/></joint>
</robot>
"""


def column(foot: float = 0.0, *, carried: str = "base") -> str:
    """Return a column 0.4 m high with a beam that is lifted along it and swings about it.

    foot: height of its underside over its base [m]. carried: "base" if the column is the base, or
    "wheel" if it is a wheel on its side that turns about it. At rest the middle of the beam is 0.35
    m over the foot; it ends 0.3 m beside the axis, and is 40 mm thick.
    """
    post = _box_at("0.06 0.06 0.4", 0.0, foot + 0.2)
    links = f'<link name="base">{post if carried == "base" else ""}</link>'
    wheel = ""
    if carried == "wheel":
        wheel = (
            f'<link name="wheel">{post}</link><joint name="roll" type="continuous">'
            '<parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/>'
            '<limit velocity="1" effort="1"/></joint>'
        )
    beam = _box_at("0.26 0.04 0.04", 0.17, 0.0)
    return f"""<robot name="column">{links}{wheel}
<link name="carriage"/><link name="beam">{beam}</link>
<joint name="lift" type="prismatic"><parent link="base"/><child link="carriage"/>
<origin xyz="0 0 {foot + 0.35}"/><axis xyz="0 0 1"/>
<limit lower="-0.4" upper="0.1" velocity="0.3" effort="1"/></joint>
<joint name="swing" type="revolute"><parent link="carriage"/><child link="beam"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
</robot>
"""


def _box_at(size: str, x: float, z: float) -> str:
    return (
        f'<collision><origin xyz="{x} 0 {z}"/><geometry><box size="{size}"/></geometry></collision>'
    )


def _box(size: str, middle: float) -> str:
    return SHAPE.format(kind="collision", middle=middle, size=size)


def _joint(
    name: str,
    parent: str,
    child: str,
    place: tuple[float, float, float],
    axis: str,
    upper: float,
    mimic: str = "",
) -> list[str]:
    """Return a joint that turns; spreading and turning ones do so to both sides."""
    lower = -upper if name.endswith(("spread", "turn")) else 0.0
    text = (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{place[0]} {place[1]} {place[2]}"/><axis xyz="{axis}"/>'
        f'<limit lower="{lower}" upper="{upper}" velocity="3" effort="1"/>{mimic}</joint>'
    )
    return [text]

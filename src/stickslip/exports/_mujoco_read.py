"""The joints of an MJCF file, with what its ``<default>`` classes give them.

A class inherits from the one around it; an element is of the class that it names, else of the nearest ``childclass``
around it, else of ``main`` (MuJoCo's XML reference, "default" and "body").
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple
from xml.etree.ElementTree import Element

from stickslip.core.errors import InputError

MAIN = "main"
ELSEWHERE = (
    "default",
    "tendon",
    "equality",
    "sensor",
    "actuator",
    "contact",
    "keyframe",
    "custom",
    "extension",
)
"""Sections whose elements called ``joint`` are no joints."""

Class = Mapping[str, Mapping[str, str]]
"""Attributes by the tag of the element."""


class Part(NamedTuple):
    """An element's name and its attributes, its own before those of its class."""

    name: str
    attributes: Mapping[str, str]


def classes_of(root: Element) -> dict[str, Class]:
    """The classes of the file's defaults by name."""
    found: dict[str, Class] = {MAIN: {}}
    waiting = [(top, top.get("class", MAIN), MAIN) for top in root.findall("default")]
    while waiting:
        node, name, around = waiting.pop(0)
        own = {tag: dict(values) for tag, values in found[around].items()}
        for child in node:
            if child.tag != "default":
                own.setdefault(child.tag, {}).update(child.attrib)
        found[name] = own
        waiting[:0] = [(child, child.get("class", ""), name) for child in node.findall("default")]
    return found


def parts(root: Element, tag: str, leave_out: tuple[str, ...] = ()) -> Iterator[Part]:
    """The elements with that tag, in the file's order, outside the sections to be left out.

    Raises
    ------
    InputError
        If one is of a class that the file does not define.
    """
    classes = classes_of(root)
    waiting = [(child, MAIN) for child in root]
    while waiting:
        node, around = waiting.pop(0)
        if node.tag in ("default", *leave_out):
            continue
        if node.tag == tag:
            name = node.get("class", around)
            if name not in classes:
                raise InputError(
                    f"{tag} {node.get('name', '')!r} is of class {name!r}, which no <default> defines"
                )
            yield Part(node.get("name", ""), {**classes[name].get(tag, {}), **node.attrib})
        inner = node.get("childclass", around)
        waiting[:0] = [(child, inner) for child in node]


def joint_named(root: Element, joint: str | None) -> Part:
    """The joint of that name, or the only one.

    Raises
    ------
    InputError
        If there is none, the choice is open, or its friction may stand in a file that is included.
    """
    found = list(parts(root, "joint", ELSEWHERE))
    wanted = found if joint is None and len(found) == 1 else [j for j in found if joint and j.name == joint]
    included = [str(node.get("file")) for node in root.iter("include")]
    missing = [
        key for key in ("frictionloss", "damping") if len(wanted) == 1 and key not in wanted[0].attributes
    ]
    if included and (missing or not wanted):
        raise InputError(
            f"this MJCF includes {', '.join(included)}, which may say more of its joints: give the whole model, as "
            "MuJoCo saves it (mj_saveLastXML)"
        )
    if len(wanted) == 1:
        return wanted[0]
    names = [j.name for j in found if j.name]
    nameless = len(found) - len(names)
    listed = ", ".join(names) or ("none" if nameless else "none: the file has no joint")
    more = f"; {nameless} of the file's joints have no name: give them one" if nameless else ""
    if len(wanted) > 1:
        raise InputError(
            f"joint {joint!r}: {len(wanted)} joints of the file have that name; give each its own"
        )
    raise InputError(f"joint {joint!r}: name one of {listed}{more}")

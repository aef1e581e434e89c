"""How the tests of all formats read the files of one: `CHECKERS` has a row for each. A new format is one more."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import mujoco

from tests.worlds.export import sdf_facts, stages


@dataclass(frozen=True)
class FormatChecker:
    """`file` is the name of a file with all scenes. `names(path)` are its objects' names, among others; `masses(path)`
    are their masses, in kg; `check(path)` fails for a file that the format's own program or rules refuse. `meshes`
    tells whether meshes lie beside the file, `regions(path)` how many regions it shows."""

    file: str
    names: Callable[[Path], list[str]]
    masses: Callable[[Path], dict[str, float]]
    check: Callable[[Path], None]
    regions: Callable[[Path], int]
    meshes: bool = True


def elements(path, tag):
    return list(ElementTree.parse(path).getroot().iter(tag))


def named(tag):
    """Reads the names of XML elements."""
    return lambda path: [one.get("name") for one in elements(path, tag)]


def mujoco_masses(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    return {model.body(k).name: model.body(k).mass.item() for k in range(model.nbody)}


def sdf_masses(path):
    return {one.get("name"): float(mass.text) for one in elements(path, "model") for mass in one.iter("mass")}


def sdf_check(path):
    assert sdf_facts.faults(ElementTree.parse(path).getroot()) == []


def usd_names(path):
    stage = stages.opened(path)  # kept, as prims last no longer than their stage
    return list(stages.things(stage))


def usd_masses(path):
    stage = stages.opened(path)
    return {name: prim.GetAttribute("physics:mass").Get() for name, prim in stages.things(stage).items()}


def usd_regions(path):
    stage = stages.opened(path)
    return len({region(prim.GetName()) for prim in stage.Traverse()} - {None})


def usd_check(path):
    assert stages.faults(stages.opened(path)) == []


def region(name):
    """The region that a part of a file belongs to, by its name; None for other parts."""
    found = re.match(r"region_\d+", name or "")
    return found and found[0]


def xml_regions(path):
    return len({region(one.get("name")) for one in ElementTree.parse(path).getroot().iter()} - {None})


CHECKERS = {
    "mjcf": FormatChecker("all.xml", named("body"), mujoco_masses, mujoco_masses, xml_regions),
    "sdf": FormatChecker("all.sdf", named("model"), sdf_masses, sdf_check, xml_regions),
    "usd": FormatChecker("all.usda", usd_names, usd_masses, usd_check, usd_regions),
}

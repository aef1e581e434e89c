"""What the specification of SDF 1.7 (http://sdformat.org/spec) says of the elements that we write: what may stand in
them and how often, and what their text is. Written down from the specification, in its own words for how often: 0 is at
most once, 1 exactly once, + at least once, * any number."""

import re

BRANCHES = {
    "sdf": "world*",
    "world": "gravity1 magnetic_field1 atmosphere1 physics+ scene1 light* model*",
    "atmosphere": "temperature0 pressure0 temperature_gradient0",
    "physics": "max_step_size1 real_time_factor1 real_time_update_rate1 max_contacts0",
    "scene": "ambient1 background1 shadows1 grid0 origin_visual0",
    "light": "cast_shadows0 pose0 diffuse0 specular0 attenuation0 direction1",
    "model": "static0 self_collide0 allow_auto_disable0 pose0 link*",
    "link": "gravity0 pose0 inertial0 collision* visual*",
    "inertial": "mass0 pose0 inertia0",
    "inertia": "ixx1 ixy1 ixz1 iyy1 iyz1 izz1",
    "collision": "pose0 geometry1 surface0 max_contacts0",
    "visual": "cast_shadows0 transparency0 pose0 material0 geometry1",
    "geometry": "empty0 box0 cylinder0 mesh0 sphere0",
    "box": "size1",
    "mesh": "uri1 scale0",
    "material": "ambient0 diffuse0 specular0 emissive0",
    "surface": "bounce0 friction0 contact0",
    "friction": "torsional0 ode0 bullet0",
    "ode": "mu0 mu20 slip10 slip20",
    "bullet": "friction0 friction20 rolling_friction0",
}
NAMED = ("world", "light", "model", "link", "collision", "visual")
TYPED = ("atmosphere", "physics", "light")

NUMBER = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
TEXTS = {
    "true|false|0|1": "static cast_shadows shadows",
    rf"{NUMBER}( {NUMBER}){{2}}": "gravity magnetic_field direction",
    rf"{NUMBER}( {NUMBER}){{3}}": "ambient background diffuse specular",
    rf"{NUMBER}( {NUMBER}){{5}}": "pose",
    NUMBER: "max_step_size real_time_factor real_time_update_rate mass ixx ixy ixz iyy iyz izz mu mu2 friction2",
    r"[^\s].*": "uri",
}
LEAVES = {tag: pattern for pattern, tags in TEXTS.items() for tag in tags.split()}


def faults(element, parent=""):
    """What is wrong with an element of a file and all below it, by the rules above."""
    tag, found = element.tag, []
    attributes = {"version"} if tag == "sdf" else set()
    attributes |= {"name"} if tag in NAMED else set()
    attributes |= {"type"} if tag in TYPED else set()
    if set(element.attrib) != attributes or not all(element.attrib.values()):
        found.append(f"attributes of <{tag}>: {sorted(element.attrib)}")
    if tag in BRANCHES and (parent, tag) != ("bullet", "friction"):
        found += _branch(element)
    else:
        pattern = _text(tag, parent)
        if pattern is None or len(element) or not re.fullmatch(pattern, element.text or ""):
            found.append(f"<{tag}> in <{parent}>: {element.text!r}")
    return found + [fault for child in element for fault in faults(child, tag)]


def _text(tag, parent):
    if tag == "size":
        return rf"{NUMBER}( {NUMBER}){{2}}"
    return NUMBER if tag == "friction" else LEAVES.get(tag)


def _branch(element):
    rules = {rule[:-1]: rule[-1] for rule in BRANCHES[element.tag].split()}
    found = [f"<{child.tag}> in <{element.tag}>" for child in element if child.tag not in rules]
    if (element.text or "").strip():
        found.append(f"text in <{element.tag}>")
    for tag, often in rules.items():
        count = len(element.findall(tag))
        if (often in "1+" and not count) or (often in "01" and count > 1):
            found.append(f"{count} times <{tag}> in <{element.tag}>")
    names = [child.get("name") for child in element if child.get("name")]
    found += [f"two are called {name}" for name in set(names) if names.count(name) > 1]
    return found

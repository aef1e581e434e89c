"""Top views with priors: circles, regions and dots under the things, in their colours."""

from xml.etree import ElementTree as ET

import pytest

import scenegen
from scenegen.looks.usual import FEW, NormalCircles, UniformArea, UsualPlace
from scenegen.pictures.figures.dimensions import FigureScene
from scenegen.pictures.figures.topview import EDGES, topview

SVG = "{http://www.w3.org/2000/svg}"


def test_circles_end_at_their_box_and_parts_of_a_mixture_are_as_dark_as_they_are_likely():
    box = (0.0, 0.0, 1.0, 1.0)
    disc = NormalCircles((0.9, 0.5), 0.1, 0.2, 0.25)
    area = UniformArea(((0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5)), 0.75)
    places = [UsualPlace((1,), box, (disc,), (area,)), UsualPlace((0, 2), box, dots=((0.5, 0.5),))]
    tree = ET.fromstring(topview(FigureScene([], usual=places), width=264))  # 240 pixels are a metre
    region, outer, inner = tree.iter(f"{SVG}polygon")
    ends = [max(float(pair.split(",")[0]) for pair in one.get("points").split()) for one in (outer, inner, region)]
    assert ends == pytest.approx([252.0, 252.0, 132.0], abs=0.2)
    assert {one.get("fill") for one in (outer, inner, region)} == {EDGES[1]}
    assert outer.get("fill-opacity") == inner.get("fill-opacity") < region.get("fill-opacity")
    (dot,) = tree.iter(f"{SVG}circle")
    assert (dot.get("cx"), dot.get("cy"), dot.get("fill")) == ("132", "132", EDGES[0])


@pytest.mark.long
@pytest.mark.parametrize(("count", "shown"), [(FEW, FEW), (FEW + 1, 0)])
def test_all_are_shown_where_they_are_few(tmp_path, count, shown):
    text = f"object mug, can[{count}]\nusually can ~ normal(mug, 5 cm)\ntask: leftOf(mug, can[1])"
    places = "".join(f"usually can[{k + 1}] ~ normal((0.{k + 1}, 0.5), 5 cm)\n" for k in range(count))
    spec = scenegen.parse(text.replace("usually can ~ normal(mug, 5 cm)\n", places))
    (path,) = scenegen.sample(spec, n=1, seed=0).figures(tmp_path, "topview")
    found = ET.fromstring(path.read_text()).iter(f"{SVG}polygon")
    assert len([one for one in found if one.get("stroke-opacity") == "0.45"]) == 2 * shown

"""What the page shows of scenes: names beside their objects, one light for an object, phi in words; files of pairs and
large files; what is said while nothing is found, and why.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys

import pytest

import scenegen

from ..conftest import ROOT
from .conftest import TEXT, download, settled

pytestmark = pytest.mark.browser

PLACED = """object plate at (0.5, 0.5, NORTH), bowl at (0.5, 0.5, NORTH)
object fork at (0.35, 0.5, NORTH), knife at (0.63, 0.5, NORTH)
object mug_with_a_name_that_is_longer_than_the_plate at (0.66, 0.62, NORTH), spoon
task: leftOf(fork, plate) & x(spoon) >= 20 cm
"""
ON_OTHERS = """() => [...document.querySelectorAll(".tags span.name")].flatMap((tag) => {
    const { left, right, top, bottom } = tag.getBoundingClientRect(), text = tag.textContent;
    const others = window.scenegen.spec.objects.filter(({ name }) => name.slice(0, 9) !== text.slice(0, 9));
    return others.map((one) => [text, one.name, window.table.where(one.name)])
        .filter(([, , { x, y }]) => x > left && x < right && y > top && y < bottom).map(([tag, name]) => [tag, name]);
})"""


def open_text(serve, tab, tmp_path, text: str, **options):
    (tmp_path / "one.spec").write_text(text)
    one = tab(serve("one.spec").link, **options)
    one.ready()
    return one


def test_names_stand_beside_their_objects(serve, tab, tmp_path):
    one = open_text(serve, tab, tmp_path, PLACED)
    one.page.click("button:has-text('Names')")
    one.until("document.querySelectorAll('.tags span.name').length === 6")
    assert one.page.evaluate(ON_OTHERS) == []
    texts = one.page.locator(".tags span.name").all_inner_texts()
    assert max(map(len, texts)) <= 26 and len(set(texts)) == 6
    # the bowl stands on the plate: a name beside both has a line to its own
    assert one.page.locator(".tags line").count() >= 2
    boxes = [node.bounding_box() for node in one.page.locator(".tags span.name").all()]
    for k, a in enumerate(boxes):
        for b in boxes[:k]:
            over = a["x"] < b["x"] + b["width"] and b["x"] < a["x"] + a["width"]
            assert not (over and a["y"] < b["y"] + b["height"] - 1 and b["y"] < a["y"] + a["height"] - 1)
    one.page.keyboard.press("v")
    one.page.wait_for_selector("svg.top .leader", state="attached")
    names = one.page.locator("svg.top text.name").all_text_contents()
    assert len(names) == 6 and "bowl" in names


WORD = """(word) => {  // where its last occurrence stands in the editor
    const walk = document.createTreeWalker(document.querySelector(".cm-content"), NodeFilter.SHOW_TEXT);
    let found = null;
    for (let node = walk.nextNode(); node; node = walk.nextNode()) {
        const at = node.data.lastIndexOf(word);
        if (at >= 0) found = [node, at];
    }
    const range = document.createRange();
    range.setStart(found[0], found[1]);
    range.setEnd(found[0], found[1] + word.length);
    const { x, y, width, height } = range.getBoundingClientRect();
    return [x + width / 2, y + height / 2];
}"""


def test_an_object_is_lit_wherever_it_is_pointed_at(serve, tab, tmp_path):
    text = "object mug, plate, fork[2]\nrequire noOverlap()\ntask: leftOf(fork[2], plate)\n"
    one = open_text(serve, tab, tmp_path, text)
    one.until("!document.querySelector('.grid button[data-scene]:not(.drawn)')")
    ring = "document.querySelectorAll('.grid button > i:not([hidden])').length"
    shown = "[...document.querySelectorAll('.tags span.lit')].map((one) => one.textContent).join()"
    where = one.page.evaluate("window.table.where('plate')")
    one.page.mouse.move(where["x"], where["y"])  # in the picture
    one.until(f"$.lit === 'plate' && {ring} === 16 && {shown} === 'plate'")
    assert one.page.locator(".cm-lit").all_inner_texts() == ["plate", "plate"]
    one.page.hover(".brand")
    one.until(f"$.lit === null && {ring} === 0 && !document.querySelector('.cm-lit')")
    one.page.click("#tab-why")
    one.page.hover(".tree .named[data-object='fork[2]']")  # in the tree
    one.until(f"$.lit === 'fork[2]' && {shown} === 'fork[2]'")
    assert one.page.locator(".tree .row.lit").count() == 1
    assert one.page.locator(".cm-lit").all_inner_texts() == [
        "fork",
        "fork[2]",
    ]  # of `fork[2]` in the declaration, the name
    place = one.page.evaluate(WORD, "plate")
    one.page.mouse.move(*place)  # in the text
    one.until(f"$.lit === 'plate' && {shown} === 'plate'")
    one.page.click("#tab-where")
    one.page.hover(".heat-map:has-text('mug')")  # in the heat maps
    one.until(f"$.lit === 'mug' && {ring} === 16 && {shown} === 'mug'")
    spot = one.page.locator(".grid button[data-scene='3'] > i").bounding_box()
    one.page.mouse.move(
        spot["x"] + spot["width"] / 2, spot["y"] + spot["height"] / 2
    )  # in a small picture, in its ring
    one.until("document.querySelector('.heat-map.lit')?.innerText === 'mug' && $.lit === 'mug'")
    one.page.keyboard.press("v")
    one.page.hover(".segment button:has-text('3D')")
    one.page.hover("svg.top g.thing >> nth=0", force=True)  # from above
    one.until("$.lit === 'mug' && document.querySelector('svg.top .thing.lit')")


def test_axes_and_a_round_length_are_drawn(serve, tab, tmp_path):
    one = open_text(serve, tab, tmp_path, "workspace [0, 3] x [0, 2]\nobject mug, plate\ntask: leftOf(mug, plate)\n")
    assert one.page.locator(".tags .axis").all_inner_texts() == ["x", "y", "50 cm"]
    x, y, long = [node.bounding_box() for node in one.page.locator(".tags .axis").all()]
    assert x["x"] > y["x"] and y["y"] < x["y"] and y["x"] < long["x"] < x["x"]
    one.page.keyboard.press("Escape")
    one.page.keyboard.press("v")
    assert one.page.locator("svg.top text.axis").all_text_contents() == ["x", "y", "50 cm"]


WORDS = """object plate, mug, can, box = box(10 cm, 10 cm, 5 cm)
region mat = rect(0.05, 0.05, 0.4, 0.4)
def low(a, most) = y(a) <= most
left: leftOf(mug, plate)
right: rightOf(mug, plate)
front: belowOf(can, plate)
close: closeTo(plate, can, 35 cm)
not_close: !closeTo(plate, can, 35 cm)
far: farFrom(plate, can)
turned: angle(box, EAST, 15 deg)
within: on(box, mat)
point: closeTo(box, (0.2, 0.3), 4 cm)
nearer: closerThan(plate, mug, can)
own: low(mug, 40 cm)
"""
POSES = {"plate": (0.5, 0.5, 0.0), "mug": (0.48, 0.3, 0.0), "can": (0.5, 0.8, 0.0), "box": (0.2, 0.2, math.pi / 18)}
SAID = {
    "left": "mug is 2 cm left of plate:",
    "right": "mug is 2 cm left of plate:",
    "front": "can is 30 cm behind plate:",
    "close": "plate is 30 cm from can, 5 cm less than 35 cm:",
    "not_close": "plate is 30 cm from can, 5 cm less than 35 cm:",
    "far": "plate is 30 cm from can, 5 cm more than 25 cm:",
    "turned": "box is turned 10 deg from EAST, 5 deg less than 15 deg:",
    "point": "box is 10 cm from (0.2, 0.3), 6 cm more than 4 cm:",
    "within": "the centre of box is 15 cm inside mat:",
    "nearer": "plate is 9.9 cm nearer to mug than to can:",
    "own": "low(mug, 40 cm) holds by 10 cm:",
}


def test_what_sets_phi_is_said_in_words(serve, tab, tmp_path):
    """The distances are those of the poses in the text."""
    scenegen.parse(WORDS).scenes({name: [pose] for name, pose in POSES.items()}).save(tmp_path / "one.json")
    one = tab(serve("one.json").link)
    one.ready()
    assert one.state("$.poses") == [list(pose) for pose in POSES.values()]
    for label, words in SAID.items():
        one.page.click(f".phi[data-label={label}]")
        one.until(f"document.querySelector('.in-words span')?.innerText.trim() === {json.dumps(words)}", 10)
    one.page.click(".phi[data-label=right]")
    assert one.page.inner_text(".in-words b") in ("just fails", "fails", "clearly fails")
    assert "bad" in one.page.get_attribute(".in-words", "class")


SHELVES = """region board[2] = rect(0, 0.6, 1, 1) at 30 cm, 60 cm
object can on any of board, cup on any of board, mug
require noCollision() & atLevel(can, cup)
near: closeTo(can, cup, 40 cm) & atLevel(can, cup)
far: abs(z(can) - z(mug)) >= 10 cm & forall p in [can, cup]: z(p) >= 5 cm
"""


def test_what_keeps_phi_at_one_number_is_named(serve, tab, tmp_path):
    one = open_text(serve, tab, tmp_path, SHELVES)
    one.page.click("#tab-why")
    told = " ".join(one.page.inner_text(".decider").split())
    assert told.startswith("closeTo(can, cup, 40 cm) is +0.") and "atLevel(can, cup, 1 mm), which is the same" in told
    assert told.endswith("keeps phi at +0.001.") and one.page.locator(".tags .good").count() == 1
    one.page.click(".why .tabs button:has-text('far')")
    rows = one.page.locator(".tree code").all_inner_texts()
    assert "abs(z(can) - z(mug)) >= 10 cm" in rows and not any(" or " in row for row in rows)


def test_more_holds_what_few_people_want(serve, tab, tmp_path):
    one = tab(serve().link)
    one.until("$.spec && $.spec.title.startsWith('A tidied desk')")  # behind the examples
    one.page.keyboard.press("Escape")
    one.ready()
    fields = one.page.locator(
        "label:has-text('method') select, label:has-text('seed') input, label:has-text('spread') select"
    )
    assert fields.count() == 3 and not any(field.is_visible() for field in fields.all())
    assert one.page.inner_text(".further summary") == "More: seed 0, auto, evenly"
    one.page.click(".further summary")
    assert all(field.is_visible() for field in fields.all())
    assert one.page.locator(".label-box[data-label=tidy] .tick.side").all_text_contents() == [
        "fails",
        "barely",
        "clearly",
    ]
    status = one.page.inner_text(".status")
    assert status.startswith("16 scenes") and "rejection" not in status


LONG = "a_label_that_is_longer_than_any_box_of_this_page_could_hold_without_cutting_it_somewhere"
INSIDE = """(boxes) => [...document.querySelectorAll(boxes)].filter((one) => one.clientWidth).flatMap((box) => {
    const over = (one) => one.getBoundingClientRect().right > box.getBoundingClientRect().right + 1;
    return [...box.querySelectorAll("*")].filter(over).map((one) => one.outerHTML.slice(0, 90));
})"""


@pytest.mark.parametrize("width", [1920, 1280, 820, 390])
def test_long_labels_and_names_are_cut_and_told(serve, tab, tmp_path, width):
    text = (
        f"workspace [0, 1.4] x [0, 0.9]\nregion mat = rect(0.1, 0.1, 0.5, 0.5)\nobject {LONG[2:]}_thing = mug, plate\n"
    )
    text += f"{LONG}: leftOf({LONG[2:]}_thing, plate)\n"
    one = open_text(serve, tab, tmp_path, text, viewport={"width": width, "height": 800})
    assert one.page.evaluate(INSIDE, ".stage, .phis") == []
    assert LONG in one.page.get_attribute(".phi[data-label]", "title")
    number = one.page.locator(".phi[data-label] b").bounding_box()
    assert number["x"] + number["width"] <= width
    if width <= 860:
        one.page.click(".panes button:has-text('Request')")
    assert one.page.evaluate(INSIDE, ".label-box, .label-box header") == []
    assert LONG in one.page.get_attribute(".label-name", "title")
    one.page.click("#tab-why")
    assert one.page.evaluate(INSIDE, ".why .tabs button, .why") == []
    assert one.page.get_attribute(".why .tabs .cut", "title") == LONG
    one.page.click("#tab-where")
    assert one.page.evaluate(INSIDE, ".where, .heat-map, .histogram") == []
    assert one.page.get_attribute(".histogram b", "title") == LONG
    assert one.page.evaluate("document.documentElement.scrollWidth") <= width


HEAT = """() => {
    const one = document.querySelector(".heat-map canvas"), { width, height } = one;
    const ink = (x, y) => one.getContext("2d").getImageData(x * width, y * height, 1, 1).data[3];
    return { aspect: width / height, wide: width, seen: one.clientWidth,
        mat: ink(0.72, 0.5), bare: ink(0.3, 0.8), mug: ink(0.07, 0.1) };
}"""


def test_heat_maps_are_as_the_table_is(serve, tab, tmp_path):
    text = "workspace [0, 1.4] x [0, 0.9]\nregion mat = rect(0.7, 0.1, 1.3, 0.8)\nobject mug, plate\n"
    text += "task: x(mug) <= 20 cm & y(mug) >= 70 cm\n"
    one = open_text(serve, tab, tmp_path, text)
    one.page.click("#tab-where")
    one.page.wait_for_selector(".heat-map canvas")
    facts = one.page.evaluate(HEAT)
    assert facts["aspect"] == pytest.approx(1.4 / 0.9, rel=0.03) and facts["wide"] >= facts["seen"] > 120
    assert facts["bare"] == 0 and facts["mat"] == 255  # the region is drawn
    assert facts["mug"] > 50  # top left, where the mug is in all scenes
    assert "1.4 x 0.9 m" in one.page.get_attribute(".heat-map", "title")


def test_starts_and_goals_are_shown_together(serve, tab, tmp_path):
    scenegen.pairs(scenegen.parse(TEXT), {"task": (0.0, None)}, n=6).save(tmp_path / "pairs.jsonl")
    command = [sys.executable, "-m", "scenegen", "view", "pairs.jsonl", "--export", "page.html"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    for link in (serve("pairs.jsonl").link, (tmp_path / "page.html").as_uri()):
        one = tab(link)
        one.until("$.result && $.report && $.report.decides && !$.busy")
        pairs = one.page.locator(".grid .pair")
        assert pairs.count() == 6 and pairs.nth(2).get_attribute("aria-label") == "pair 3"
        told = [node.inner_text().split() for node in pairs.nth(2).locator("button span").all()]
        assert [words[:2] for words in told] == [["3", "start"], ["3", "goal"]]
        assert told[0][2].startswith("\N{MINUS SIGN}") and told[1][2].startswith("+")
        boxes = [button.bounding_box() for button in pairs.nth(2).locator("button").all()]
        assert boxes[0]["y"] == boxes[1]["y"] and boxes[1]["x"] - boxes[0]["x"] - boxes[0]["width"] < 6
    one.page.focus(".grid [aria-selected=true]")
    one.page.keyboard.press("ArrowDown")  # by rows of pictures, not of pairs
    assert one.page.locator(".grid [aria-selected=true]").bounding_box()["y"] > boxes[0]["y"] - 200


def test_a_large_file_says_how_much_of_it_is_shown(serve, tab, tmp_path):
    scenegen.sample(scenegen.parse(TEXT), n=450).save(tmp_path / "many.json")
    one = tab(serve("many.json").link)
    one.ready()
    assert one.page.inner_text(".warnings").strip() == "the first 400 of the 450 scenes of many.json"
    assert one.page.is_visible(".warnings li")


def test_a_long_search_says_so_and_can_be_stopped(serve, tab, tmp_path):
    (tmp_path / "full.spec").write_text(
        "object block[170] = box(6 cm, 6 cm, 5 cm)\nrequire noOverlap()\ntask: leftOf(block[1], block[2])\n"
    )  # too full for a first look within seconds, on any machine
    one = tab(serve("full.spec").link)
    one.page.wait_for_selector(".searching:has-text('170 objects')", timeout=60_000)
    one.page.click(".searching button")
    one.until("!$.busy && !document.querySelector('.searching') && !document.querySelector('.working')")
    one.write("object block[30] = box(15 cm, 15 cm, 5 cm)\ntask: leftOf(block[1], block[2])\n")
    one.until("$.result && !$.busy && $.poses.length === 30")
    settled(one)
    one.page.click("#tab-why")
    note = one.page.inner_text(".why .note:has-text('Overlapping')")
    count = len(one.state("$.report.overlaps"))
    assert count > 10 and note.endswith(f"and {count - 5} pairs more.") and len(note) < 260


def test_a_refusal_is_told_once_and_says_of_which_text_the_scenes_are(serve, tab, tmp_path):
    scenegen.sample(scenegen.parse(TEXT), n=450).save(tmp_path / "many.json")
    one = tab(serve("many.json").link)
    one.ready()
    one.page.wait_for_selector(".warnings:has-text('400 of the 450')")
    one.write("object mug, plate, fork\nrequire noOverlap()\ngoal: closeTo(mug, plate, 12 cm)\n")
    one.until("!$.busy && $.refusal && document.querySelector('.trouble')")
    one.until("$.problems.length && document.querySelector('.trouble .quiet')")
    box = one.page.inner_text(".trouble")
    assert "these scenes are of the text before the last change" in box and "request before" not in box
    assert not one.page.query_selector(".notes li") and not one.page.query_selector(".behind-note")
    status = one.page.inner_text(".status").replace("`", "")
    assert status == one.page.inner_text(".trouble b") and status == one.page.inner_text(".problems b")
    one.page.click(".trouble .chip:has-text('close')")
    one.page.wait_for_selector(".behind-note:has-text('of the text before')")


ON_TOP = """(one) => {
    const { right, y, height } = one.getBoundingClientRect();
    return document.elementFromPoint(right - 2, y + height / 2) === one;
}"""


def test_why_a_search_for_motions_goes_on_is_said_and_it_can_be_ended(serve, tab, tmp_path):
    (tmp_path / "three.spec").write_text((ROOT / "examples" / "motions" / "three_places.spec").read_text())
    one = tab(serve("three.spec").link)
    one.page.wait_for_selector(".first button:has-text('keep these')", timeout=90_000)
    told = one.page.inner_text(".first")
    assert ("until they are a fair sample" if told.startswith("16 motions found") else "of 16 motions found") in told
    one.page.click(".first button")
    one.until("!$.busy && !$.preview && $.result.motions.length > 0 && Math.min(...$.result.phi.task) >= 0")
    assert "found when you stopped" in one.page.inner_text(".warnings")
    assert not one.page.query_selector(".behind-note") and not one.page.query_selector(".first")
    one.page.keyboard.press("Escape")
    one.page.keyboard.press("End")
    for value in one.page.locator(".timeline .legend .value").all():  # whole, and in no colour of failure
        box = value.bounding_box()
        assert value.evaluate(ON_TOP)
        assert box["width"] > 30 and value.get_attribute("class") == "value"


def test_a_deed_that_is_done_gives_way_to_the_count(served, tab, tmp_path):
    one = tab(served.link)
    one.ready()
    download(one, "json", tmp_path)
    one.page.wait_for_selector(".status:has-text('downloaded')")
    one.page.wait_for_selector(".status:has-text('16 scenes')", timeout=12_000)


LOW = """() => [...document.querySelectorAll("button, select, input:not([type=range])")].filter((one) => {
    const seen = one.getClientRects().length && getComputedStyle(one).visibility === "visible";
    return seen && one.getBoundingClientRect().height < 44;
}).map((one) => one.outerHTML.slice(0, 80))"""


def test_fingers_and_phones(serve, tab, tmp_path):
    one = tab(serve().link, viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    close = one.page.wait_for_selector("dialog button:has-text('Close')").bounding_box()
    assert close["x"] + close["width"] <= 374 and close["height"] >= 44
    one.page.tap("dialog button:has-text('Close')")
    one.ready()
    for pane in ("Scenes", "Request", "Spec"):
        one.page.tap(f".panes button:has-text('{pane}')")
        assert one.page.evaluate(LOW) == [], pane
    assert one.page.evaluate("getComputedStyle(document.querySelector('.cm-content')).fontSize") == "16px"
    assert one.page.evaluate("document.documentElement.scrollWidth") <= 390


TABLE = """() => {  // how wide the table is on the screen, in front
    const { table: [x0, y0, x1] } = window.scenegen.spec, { camera } = window.table;
    const [left, right] = [x0, x1].map((x) => camera.position.clone().set(x, y0, 0).project(camera).x);
    return (right - left) / 2 * document.querySelector(".stage canvas").getBoundingClientRect().width;
}"""


def test_large_letters_and_large_screens(serve, tab):
    link = serve("breakfast").link
    one = tab(link, viewport={"width": 640, "height": 400})  # 1280 x 800 at 200 %
    one.ready()
    one.page.click(".panes button:has-text('Request')")
    table = one.page.evaluate(TABLE)
    handles = one.page.locator(".handles").first.bounding_box()
    assert table > 150 and handles["y"] + handles["height"] <= 348
    for width in (700, 820):
        one.page.set_viewport_size({"width": width, "height": 900})
        one.page.wait_for_timeout(200)
        plot, box = (one.page.locator(what).first.bounding_box() for what in (".handles", ".label-box"))
        assert box["width"] - plot["width"] < 30
    one = tab(link, viewport={"width": 1920, "height": 1080})
    one.ready()
    one.page.click("button:has-text('Grid')")
    boxes = [button.bounding_box() for button in one.page.locator(".grid button[data-scene]").all()]
    assert boxes[0]["width"] > 230 and max(box["y"] + box["height"] for box in boxes) > 1000


SIGHTS = """robot arm = so101 at (0.5, 0.3, NORTH)
camera front = at (0.5, 0.05, 0.45) looks at (0.5, 0.6, 0) fov 40 deg, 4:3
object mug, bottle, lemon
require noOverlap() & insideWorkspace(others(arm))
task: graspable(lemon, arm) & visible(mug, front, 30 %, 90 %)
"""


def test_rings_frames_hands_and_shares_in_the_view_from_above(serve, tab, tmp_path):
    one = open_text(serve, tab, tmp_path, SIGHTS)
    one.page.keyboard.press("v")
    one.page.wait_for_selector("svg.top .hand", state="attached")
    assert one.page.locator("svg.top .ring").count() == one.page.locator("svg.top .camera-frame").count() == 1
    assert one.page.locator("svg.top .hand polygon").count() == 3
    assert one.page.locator("svg.top .camera-name").all_text_contents() == ["front"]
    names = one.page.locator("svg.top text.name").all_text_contents()
    assert f"mug {one.page.evaluate('scenegen.report.seen[0].words')}" in names and "bottle" in names
    # the hand goes with what it grasps, and turns to where there is most room
    (stands,) = one.page.locator("svg.top .hand").evaluate_all("all => all.map((one) => one.getAttribute('transform'))")
    index = [thing["name"] for thing in one.page.evaluate("scenegen.spec.objects")].index("lemon")
    x, y, _ = one.page.evaluate(f"scenegen.poses[{index}]")
    assert stands.startswith(f"translate({x} {y})")


USUAL = """object mug, saucer, cup
usually mug ~ [normal((0.7, 0.4), 5 cm): 3, uniform(left): 1]
region left = rect(0, 0, 0.3, 1)
usually cup ~ normal((x(saucer) + 20 cm, y(saucer)), 3 cm)
require noOverlap() & insideWorkspace()
task: leftOf(saucer, mug)
"""


def test_the_view_from_above_shades_where_things_usually_are(serve, tab, tmp_path):
    one = open_text(serve, tab, tmp_path, USUAL)
    one.page.keyboard.press("v")
    one.page.wait_for_selector("svg.top .usual", state="attached")
    assert one.page.locator("svg.top .usual").count() == 2 and not one.page.locator("svg.top .usual.near").count()
    mug = one.page.locator("svg.top .usual[data-things=mug]")
    assert (mug.locator("g circle").count(), mug.locator("polygon").count()) == (2, 1)
    circle = "document.querySelector('svg.top .usual[data-things=cup] circle')"
    stands = (
        f"Math.hypot({circle}.cx.baseVal.value - $.poses[1][0] - 0.2, {circle}.cy.baseVal.value - $.poses[1][1]) < 1e-6"
    )
    one.page.hover("svg.top g.thing >> nth=2", force=True)
    one.page.wait_for_selector("svg.top .usual.near[data-things=cup]", state="attached")
    one.until(stands)  # beside its saucer, and goes with it
    before = one.page.evaluate(f"{circle}.cx.baseVal.value")
    one.page.hover("svg.top g.thing >> nth=1", force=True)
    one.page.mouse.down()
    one.page.wait_for_selector("svg.top .thing.chosen", state="attached")
    box = one.page.locator("svg.top .thing.chosen > path").bounding_box()
    one.page.mouse.move(box["x"] + box["width"] / 2 + 60, box["y"] + box["height"] / 2, steps=4)
    one.page.mouse.up()
    one.until(f"{stands} && Math.abs({circle}.cx.baseVal.value - {before}) > 0.01")


def test_words_of_robots_and_cameras_are_coloured(serve, tab, tmp_path):
    one = open_text(serve, tab, tmp_path, SIGHTS)
    code = """(word) => [...document.querySelectorAll(".cm-line span")].filter((one) => one.textContent === word)
        .map((one) => getComputedStyle(one).color)"""
    colours = {word: one.page.evaluate(code, word) for word in ("camera", "robot", "looks", "fov", "40 deg", "30 %")}
    assert all(colours.values())
    keyword = one.page.evaluate(code, "require")[0]
    assert {colours[word][0] for word in ("camera", "robot", "looks", "fov")} == {keyword}
    assert colours["30 %"] == colours["40 deg"] != [keyword]


def test_what_decides_is_told_of_hands_and_shares(serve, tab, tmp_path):
    one = open_text(serve, tab, tmp_path, SIGHTS.replace("graspable(lemon, arm) & ", ""))
    words = one.page.locator(".over").inner_text()
    assert (
        "front sees " in words and f"{one.page.evaluate('scenegen.report.seen[0].words').split(',')[0]} of mug" in words
    )

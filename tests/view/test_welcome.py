"""The examples of the page's first screen."""

import re
from pathlib import Path

from scenegen.resources import shipped_specs
from scenegen.show.view.project import STATIC, open_

ROOT = Path(__file__).resolve().parents[2]


def test_every_shipped_spec_has_a_topic_and_a_small_picture():
    text = (ROOT / "page" / "src" / "panels" / "Welcome.tsx").read_text()
    topics = text[text.index("const TOPICS") : text.index("];", text.index("const TOPICS"))]
    named = re.findall(r'"([a-z0-9_]+)"', topics)
    assert sorted(named) == sorted(shipped_specs())
    pictures = {one.stem: one.stat().st_size for one in (STATIC / "examples").iterdir()}
    assert pictures.keys() == set(shipped_specs()) and max(pictures.values()) < 20_000


def test_only_a_page_of_nothing_begins_with_them(tmp_path):
    (tmp_path / "one.spec").write_text("leftOf(mug, plate)")
    assert open_(tmp_path).data()["welcome"]
    assert not open_(tmp_path / "one.spec").data()["welcome"] and not open_(Path("first")).data()["welcome"]

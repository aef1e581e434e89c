"""What the server sends to browsers is what the sources in page/ build, small, and has its licences with it."""

from __future__ import annotations

import gzip
import json
import re
import shutil
import subprocess

import pytest

from scenegen.page.project import STATIC, alone, html

from ..conftest import ROOT

PAGE = ROOT / "page"
FILES = ("page.js", "page.css", "icon.svg", "licences.txt")


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
@pytest.mark.skipif(not (PAGE / "node_modules" / "esbuild").is_dir(), reason="the packages are not: npm ci in page/")
def test_the_bundle_is_what_the_sources_build(tmp_path):
    subprocess.run(["node", "build.mjs", str(tmp_path)], cwd=PAGE, check=True, timeout=120)
    for name in FILES:
        assert (tmp_path / name).read_bytes() == (STATIC / name).read_bytes(), "run `make page`, and commit the result"


def test_the_page_is_small():
    assert sum(len(gzip.compress((STATIC / name).read_bytes())) for name in FILES) < 1_500_000


def test_every_package_of_the_bundle_has_its_licence():
    facts = json.loads((PAGE / "package.json").read_text())
    told = (STATIC / "licences.txt").read_text()
    for name, version in facts["dependencies"].items():
        assert f"{name} {version}" in told
    assert told.count("MIT") >= len(facts["dependencies"])


def test_the_lock_names_no_registry():
    assert "resolved" not in (PAGE / "package-lock.json").read_text()


def test_texts_cannot_break_out_of_the_page():
    text = '</script><script>alert(1)</script><!-- \u2028 {title} {script} "&'
    for page in (html({"text": text, "name": "<b>"}), alone({"text": text, "name": "<b>"})):
        assert "<script>alert" not in page and "<b> ·" not in page
        data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1]
        assert json.loads(data)["text"] == text


def test_a_page_without_a_server_fetches_nothing():
    page = alone({"text": "", "name": "x"})
    head = page.split("<script")[0]
    assert "connect-src data: blob:" in head and "http" not in re.sub(r"http-equiv|http://www.w3.org/\S+", "", head)
    assert not re.search(r'<(link|script|img)[^>]+(src|href)="(?!data:)', page[: len(head) + 200])

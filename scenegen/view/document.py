"""The page as one HTML document: with links to its files where a server has them, or with everything in it."""

from __future__ import annotations

import html as markup
from pathlib import Path
from typing import Any

STATIC = Path(__file__).resolve().parent / "static"

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
{head}
</head>
<body>
<div id="app"></div>
<noscript>This page needs JavaScript.</noscript>
<script type="application/json" id="data">{data}</script>
{script}
</body>
</html>
"""


def html(data: dict[str, Any]) -> str:
    """The page as a server sends it; `data` is what it shows first."""
    head = '<link rel="stylesheet" href="/static/page.css">\n<link rel="icon" href="/static/icon.svg">'
    return _filled(data, head, '<script type="module" src="/static/page.js"></script>')


def alone(data: dict[str, Any]) -> str:
    """The page as one file that needs no server."""
    css = (STATIC / "page.css").read_text(encoding="utf-8")
    js = (STATIC / "page.js").read_text(encoding="utf-8")
    policy = (
        "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
        "connect-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<style>{css}</style>'
    safe = js.replace("</script", "<\\/script").replace("<!--", "<\\!--")
    return _filled(data, head, f'<script type="module">{safe}</script>')


def _filled(data: dict[str, Any], head: str, script: str) -> str:
    from scenegen.view.wire import dumps

    text = dumps(data).decode().replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    title = markup.escape(f"{data.get('name') or 'scenegen'} · scenegen view")
    page = _PAGE.replace("{title}", title).replace("{head}", head).replace("{script}", script)
    return page.replace("{data}", text)

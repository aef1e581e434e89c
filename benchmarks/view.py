"""How soon the page of `scenegen view` shows scenes, in headless Chromium with software rendering.

For every shipped spec: milliseconds from the last change of the text to the first scenes on the screen, and to the
scenes that are wanted; and the CPU time of the server and of the browser until the first scenes, which a busy machine
changes less. Then a handle is moved twice, by a step to lower phi and to `barely satisfied`: milliseconds until every
shown scene lies in the new range, how many are shown then, and until all wanted scenes are there again. Last, how many
pictures a second a drag of one of 40 objects has. Needs the extra `browser` and Chromium. Name specs to measure only
these; `--first` measures only the first scenes, and does not wait for the others.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

FLAGS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
).split()
FORTY = (
    "workspace [0, 2] x [0, 2]\nobject block[40] = box(5 cm, 5 cm, 5 cm)\nrequire noOverlap()\n"
    "task: leftOf(block[1], block[2])\n"
)
# from inside the page: when the first new result was drawn, and when the one that is wanted was
WAIT = """async (all) => {
  const next = () => new Promise(requestAnimationFrame);
  const soon = () => new Promise((then) => setTimeout(then, 8)); // waiting for pictures would make the browser busy
  let frames = window.table.frames;
  const drawn = async () => {
    while (window.table.frames === frames) await next();
    return performance.now() - window.began();
  };
  const before = window.before;
  const late = setTimeout(() => { window.before = window.late = "late"; }, 60000);
  const there = () =>
    window.scenegen.spec !== window.old && window.scenegen.result && window.scenegen.result !== before;
  while (!window.late && !there()) {
    frames = window.table.frames;
    await soon();
  }
  const early = window.scenegen.preview, found = window.scenegen.result;
  clearTimeout(late);
  const first = await drawn();
  if (!early || !all) return [first, early ? null : first];
  while (window.scenegen.preview || window.scenegen.result === found) {
    frames = window.table.frames;
    await soon();
  }
  return [first, await drawn()];
}"""

# from inside the page: a handle is moved by `move`; when all scenes on the screen are in the new range, how many those
# are, and when all that are wanted are there
MOVED = """async (move) => {
  const next = () => new Promise(requestAnimationFrame);
  const before = JSON.stringify(window.scenegen.request.phi);
  const began = performance.now(), late = began + 60000;
  move === "step"
    ? document.querySelector("[role=slider]").dispatchEvent(
        new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true }))
    : [...document.querySelectorAll(".chip")].find((one) => one.textContent === move).click();
  const wanted = window.scenegen.request.phi;
  if (JSON.stringify(wanted) === before) return null;
  const inside = () =>
    !document.querySelector(".grid button[data-scene]:not(.drawn)") &&
    [...document.querySelectorAll(".grid button[data-scene] span")].every((one) =>
      Object.entries(JSON.parse(one.dataset.phi)).every(
        ([name, phi]) => (wanted[name][0] ?? -1e9) <= phi && phi <= (wanted[name][1] ?? 1e9),
      ),
    );
  await next();
  while (!inside() && performance.now() < late) await next();
  await next(); // it is on the screen by now
  const redrawn = performance.now() - began, shown = document.querySelectorAll(".grid button[data-scene]").length;
  let some = shown ? redrawn : null; // until there is a scene at all
  while ((window.scenegen.preview || window.scenegen.busy) && performance.now() < late) {
    await new Promise((then) => setTimeout(then, 8));
    if (some === null && inside() && document.querySelector(".grid button[data-scene]"))
      some = performance.now() - began;
  }
  await next();
  return [redrawn, shown, some ?? performance.now() - began, performance.now() - began];
}"""

# three seconds of a drag, one movement with every picture; pictures a second over the last two
DRAG = """async ([x, y]) => {
  const canvas = document.querySelector(".three canvas");
  const next = () => new Promise(requestAnimationFrame);
  const began = performance.now();
  let frames = 0, from = began;
  for (let step = 0; performance.now() < began + 3000; step++) {
    const place = { clientX: x + 60 * Math.sin(step / 9), clientY: y + 40 * Math.sin(step / 7) };
    canvas.dispatchEvent(new PointerEvent("pointermove", { ...place, pointerId: 1, bubbles: true }));
    await next();
    if (from === began && performance.now() > began + 1000) [frames, from] = [window.table.frames, performance.now()];
  }
  return (1000 * (window.table.frames - frames)) / (performance.now() - from);
}"""


def main() -> None:
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        command = [sys.executable, "-m", "scenegen", "view"]
        server = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True)
        try:
            link = next(found[0] for line in server.stderr or () if (found := re.search(r"http://\S+", line)))
            browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.goto(link)
            until(page, "window.scenegen && window.scenegen.result && !window.scenegen.busy")
            measure(page, [one for one in sys.argv[1:] if one != "--first"], "--first" in sys.argv)
            browser.close()
        finally:
            server.terminate()
            server.wait()


def line(name: str, row: list[float]) -> str:
    widths = (8, 9, 9, 8, 8, 7, 7, 8, 8, 7, 7, 8)
    return f"{name:<26}" + "".join(f"{one:{wide}.0f}" for one, wide in zip(row, widths, strict=True))


def cpu(program: str) -> float:
    """Milliseconds of CPU time that the programs below this one whose command line has `program` in it have used."""
    parents, times = {}, {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
            words = path.with_name("cmdline").read_text()
        except OSError:  # it has ended
            continue
        number = int(path.parent.name)
        parents[number] = int(fields[1])
        times[number] = sum(map(int, fields[11:15])) if program in words else 0
    below, found = [os.getpid()], 0
    while below:
        mine = below.pop()
        children = [one for one, parent in parents.items() if parent == mine]
        found += sum(times[one] for one in children)
        below += children
    return 1000.0 * found / os.sysconf("SC_CLK_TCK")


def until(page: Any, what: str, seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not page.evaluate(f"!!({what})") and time.monotonic() < end:
        time.sleep(0.02)


def write(page: Any, text: str) -> None:
    page.click(".cm-content")
    page.keyboard.press("Control+a")
    page.evaluate(
        "[window.before, window.old] = [window.scenegen.result, window.scenegen.spec];"
        "window.began = () => window.scenegen.typed"
    )
    page.keyboard.insert_text(text)


def measure(page: Any, only: list[str], quick: bool) -> None:
    from scenegen.resources import shipped_specs

    table: list[list[float]] = []
    print(f"{'':<26}{'first scenes':^34}{'handle: a step':^30}{'handle: barely satisfied':^30}")
    print(
        f"{'spec':<26}{'ms':>8}{'server':>9}{'browser':>9}{'all':>8}"
        + f"{'inside':>8}{'shown':>7}{'some':>7}{'all':>8}" * 2
    )
    for name, path in shipped_specs().items():
        if only and name not in only:
            continue
        spent = cpu("scenegen"), cpu("chrom")
        write(page, path.read_text(encoding="utf-8"))
        first, whole = page.evaluate(WAIT, not quick)
        row = [first, cpu("scenegen") - spent[0], cpu("chrom") - spent[1], whole or math.nan]
        if quick:
            table.append([*row, *[math.nan] * 8])
            print(line(name, table[-1]), flush=True)
            continue
        until(page, "!window.scenegen.busy")
        until(page, "window.scenegen.rested", 15.0)
        for move in ("step", "barely satisfied"):
            row += page.evaluate(MOVED, move) or [math.nan] * 4
            until(page, "!window.scenegen.busy")
        table.append(row)
        print(line(name, row), flush=True)
    for what, of in (("median", statistics.median), ("worst", max)):
        known = [[one for one in column if one == one] for column in zip(*table, strict=True)]
        print(line(what, [of(column) if column else math.nan for column in known]))
    print("first scenes within 1 s:", sum(row[0] <= 1000 for row in table), "of", len(table))
    if quick:
        return
    print("handle inside within 300 ms:", sum(max(row[4], row[8]) <= 300 for row in table), "of", len(table))
    write(page, FORTY)
    page.evaluate(WAIT, True)
    until(page, "!window.scenegen.busy")
    time.sleep(1.0)
    place = page.evaluate("window.table.where('block[1]')")
    page.mouse.move(place["x"], place["y"])
    page.mouse.down()
    rate = page.evaluate(DRAG, [place["x"], place["y"]])
    page.mouse.up()
    print(f"dragging one of 40 objects: {rate:.0f} pictures a second")


if __name__ == "__main__":
    main()

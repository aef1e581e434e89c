"""What goes wrong with the page of `scenegen view`: opening it, serving it, and what it wants."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

NOTHING_TO_OPEN = Kind(
    "nothing-to-open",
    "cannot open {name}: there is no such file",
    help=(NEAREST, "name a spec, a scene file, a model or a folder; `scenegen specs` lists specs"),
)
NOT_OPENED = Kind("not-opened", "cannot open {file}: {reason}")
PUBLIC_ADDRESS = Kind(
    "public-address",
    "{host} is an address that other machines can reach",
    help="everyone with the link can then read and write specs in the opened folder; add --public if you mean it",
)
SERVED_IN_PUBLIC = Kind(
    "served-in-public",
    "the page is served on {host}: other machines can reach it, over a connection that is not encrypted",
    help="give its link only to people whom you trust",
    severity="warning",
)
CANNOT_LISTEN = Kind(
    "cannot-listen",
    "cannot listen on {host}:{port}: {reason}",
    help="leave --port out: any free one is taken then",
)
PAGE_TOO_LARGE = Kind("page-too-large", "the page would have {size:.0f} MB", help="ask for fewer scenes with -n")
NO_MESSAGE = Kind("no-message", "the server does not know what to do with this: {reason}", help="reload the page")
TOO_MANY_SHOWN = Kind(
    "too-many-shown",
    "the page shows 1 to {most} {what} of these objects, not {count:,}",
    help="`scenegen sample` makes as many as you like",
)
MOTION_TOO_LONG = Kind(
    "motion-too-long",
    "a motion of {poses:,} poses, each object's at each moment, is too long for the page: {most:,} are the most",
    help="`scenegen sample` draws it; on the page take fewer steps",
)
LONG_GIF = Kind(
    "long-gif",
    "a motion of {moments:,} moments takes too long to be drawn here: {most} are the most",
    help="`scenegen render MOTIONS --out x.gif` draws it",
)
ANOTHER_SPEC = Kind(
    "another-spec",
    "the model was trained on another spec than the one in the editor",
    help="choose another method, or bring the model's spec back",
)

"""Pages of an animation as an MP4 file: H.264, which browsers, slides and viewers play.

PyAV (https://pyav.basswood.io) brings the encoder. One thread and fixed settings: the same pages give the same bytes
with the same version of PyAV.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

from PIL import Image

from scenegen.errors import RequestError
from scenegen.errors.requests import NO_ENCODER
from scenegen.figures.sheet import PAPER
from scenegen.needs import need

ENCODER = "libx264"
QUALITY = "18"  # constant rate factor: edges and small letters stay sharp
BLOCK = 2  # pixels: colours of H.264 have half the resolution, so both sides are even


def video(pages: Sequence[Image.Image], step: int, held: int) -> bytes:
    """The pages one after the other, each `step` milliseconds long, and the last one `held`. All have one size; a row
    or column of paper makes it even. Raises RequestError without PyAV, or where it cannot write H.264."""
    need("av", "for MP4 files")
    import av

    if ENCODER not in av.codecs_available:
        raise RequestError(NO_ENCODER(encoder=ENCODER))
    width, height = (size + size % BLOCK for size in pages[0].size)
    with tempfile.TemporaryDirectory() as folder:  # the index is moved to the front of a whole file: it plays at once
        path = Path(folder) / "video.mp4"
        with av.open(path, "w", options={"movflags": "+faststart", "fflags": "+bitexact"}) as file:
            stream = file.add_stream(ENCODER, rate=Fraction(1000, step))
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            # Macroblock trees differ once in some thousand runs, on one thread, too.
            stream.options = {"crf": QUALITY, "preset": "slow", "flags": "+bitexact", "x264-params": "mbtree=0"}
            stream.codec_context.thread_count = 1
            for page in [*pages, *[pages[-1]] * (-(-held // step) - 1)]:
                even = page
                if page.size != (width, height):
                    even = Image.new("RGB", (width, height), PAPER)
                    even.paste(page, (0, 0))
                file.mux(stream.encode(av.VideoFrame.from_image(even)))
            file.mux(stream.encode(None))
        return path.read_bytes()

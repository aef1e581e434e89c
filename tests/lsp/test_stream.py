"""Frames, and bytes that are none."""

import io

from scenegen.editors.lsp.server import Fault, frames


def read(data):
    """Bodies as they are, faults as "fault"."""
    return ["fault" if isinstance(one, Fault) else one for one in frames(io.BytesIO(data))]


def framed(body):
    return b"Content-Length: %d\r\n\r\n" % len(body) + body


def test_frames():
    data = framed(b"{}") + b"Content-Type: x; charset=utf-8\r\ncontent-length:3\r\n\r\nabc" + b"\r\n" + framed(b"")
    assert read(data) == [b"{}", b"abc", b""]
    assert read(framed(b"abc")[:-1]) == []


def test_a_wrong_header_costs_its_own_message_only():
    good = framed(b"good")
    for wrong in (
        b"Content-Length: -5\r\n\r\n",
        b'Content-Length: -5\r\n\r\n{"id": 1}',
        b"Content-Length: many\r\n\r\nabc\r\n",
        b"Content-Length: 9999999999999999999999\r\n\r\n{}",
        b"Content-Length: 999999999\r\n\r\n{}",
        b"Content-Length: 1\xb2\r\n\r\n{}",
        b"Content-Length:\r\n\r\n{}",
        b"Content-Type: x\r\n\r\n{}\r\n",
        b'{"id": 1}\n',
        b"\0\xff\n\n\n",
    ):
        assert read(good + wrong + good) == [b"good", "fault", b"good"], wrong


def test_a_wrong_length_is_found_out():
    assert read(b"Content-Length: 1\r\n\r\nabc" + framed(b"good")) == [b"a", "fault", b"good"]
    assert read(b"Content-Length: 30\r\n\r\nabc" + framed(b"this one is lost") + framed(b"good"))[1:] == [
        "fault",
        b"good",
    ]

"""Make a damaged file's checksums right again, so that a fuzz run gets past them."""

from __future__ import annotations

import hashlib
import struct
import zlib

from lfstereo.container.format import DATA_START, FILE_HEAD, MAGICS

_SECTION = b"\x89LF"


def repaired_container(data: bytes) -> bytes:
    """Give every section the SHA-1 of its data, here and where the tables of contents name it."""
    content, tables, order = data, [], []
    at = len(FILE_HEAD)
    while at + DATA_START <= len(content):
        at = content.find(_SECTION, at)
        if at < 0:
            break
        magic, length = content[at : at + 8], int.from_bytes(content[at + 12 : at + 16], "big")
        if magic not in MAGICS:
            at += 1
            continue
        if MAGICS[magic] == "toc":
            tables.append((at, length))
        elif length:
            order.append((at, length))
        at += DATA_START + length if length else 16
    whole = bytearray(content)
    for at, length in order:
        body = bytes(whole[at + DATA_START : at + DATA_START + length])
        new = b"sha1-" + hashlib.sha1(body, usedforsecurity=False).hexdigest().encode()
        old = bytes(whole[at + 16 : at + 61])
        if old != new and len(old) == len(new):
            for start, size in tables:
                place = slice(start + DATA_START, start + DATA_START + size)
                whole[place] = bytes(whole[place]).replace(old, new)
            whole[at + 16 : at + 61] = new
    for at, length in tables:
        body = bytes(whole[at + DATA_START : at + DATA_START + length])
        whole[at + 16 : at + 61] = b"sha1-" + hashlib.sha1(body, usedforsecurity=False).hexdigest().encode()
    return bytes(whole)


def repaired_tar(data: bytes) -> bytes:
    """Give every block that may be a head the sum of its bytes."""
    whole = bytearray(data)
    for at in range(0, len(whole) - 511, 512):
        head = whole[at : at + 512]
        if head[257:262] == b"ustar" or at == 0:
            head[148:156] = b" " * 8
            whole[at + 148 : at + 156] = b"%06o\0 " % sum(head)
    return bytes(whole)


def repaired_png(data: bytes) -> bytes:
    """Give every chunk the checksum of its content."""
    whole, at = bytearray(data), 8
    while at + 12 <= len(whole):
        length = int.from_bytes(whole[at : at + 4], "big")
        end = at + 8 + length
        if end + 4 > len(whole):
            break
        whole[end : end + 4] = struct.pack(">I", zlib.crc32(whole[at + 4 : end]))
        at = end + 4
    return bytes(whole)

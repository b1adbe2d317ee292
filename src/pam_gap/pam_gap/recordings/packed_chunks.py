"""Refuses chunks of an MCAP file that unpack to far more than any recorder writes.

rosbags unpacks a chunk whole, whatever its frame holds. What the chunk and the frame claim is
compared with a limit before; where the frame claims nothing, it is unpacked as far as the limit.
LZ4 cannot unpack to more than 255 times its size. Formats: MCAP (mcap.dev/spec), Zstandard
(RFC 8878).
"""

from __future__ import annotations

from typing import Final

MOST_CHUNK: Final = 1 << 28
"""Bytes of an unpacked chunk; recorders write chunks of about a megabyte."""


def refuse_bomb(packed: bytes | memoryview, compression: str, size: int) -> None:
    """Refuse a chunk that unpacks to more than `MOST_CHUNK`.

    Parameters
    ----------
    packed : bytes-like
        The records of the chunk as they are stored.
    compression : str
        "", "zstd" or "lz4".
    size : int
        What the chunk claims to unpack to [bytes].

    Raises
    ------
    ValueError
        When it is too large. A chunk that cannot be unpacked at all is left to the reader.
    """
    if size > MOST_CHUNK or _unpacked(packed, compression) > MOST_CHUNK:
        raise ValueError(f"a chunk unpacks to more than {MOST_CHUNK} bytes")


def _unpacked(packed: bytes | memoryview, compression: str) -> int:
    """Bytes that a chunk unpacks to, or more than `MOST_CHUNK`; 0 if it cannot be unpacked."""
    from backports import zstd  # noqa: PLC0415  (optional; comes with rosbags)

    try:
        if compression == "zstd":
            claimed = zstd.get_frame_info(bytes(packed[:18])).decompressed_size
            if claimed is not None:
                return claimed
            return len(zstd.ZstdDecompressor().decompress(packed, MOST_CHUNK + 1))
    except zstd.ZstdError:
        return 0
    return 0

"""Bytes of MCAP, CDR, PNG, JPEG and SQLite files, as far as the attacks need them; none is checked."""

import struct
import zlib

JOINTS = ["shoulder_yaw", "shoulder_pitch", "forearm_pitch", "wrist_pitch", "wrist_yaw", "wrist_rotate"]


class Cdr:
    """One message, little endian, header first."""

    def __init__(self):
        self.out = bytearray(b"\0\1\0\0")

    def put(self, form, *values):
        """Numbers of one form, each aligned to its own size."""
        size = struct.calcsize("<" + form)
        self.out += b"\0" * (-(len(self.out) - 4) % size)
        self.out += struct.pack(f"<{len(values)}{form}", *values)
        return self

    def text(self, text):
        data = text if isinstance(text, bytes) else text.encode()
        self.put("I", len(data) + 1)
        self.out += data + b"\0"
        return self

    def header(self, seconds, frame=""):
        return self.put("I", seconds, 0).text(frame)

    def data(self, data):
        self.put("I", len(data))
        self.out += data
        return self


def joint_state(seconds, names, positions=None):
    cdr = Cdr().header(seconds).put("I", len(names))
    for name in names:
        cdr.text(name)
    positions = [30000.0] * len(names) if positions is None else positions
    cdr.put("I", len(positions))
    if positions:
        cdr.put("d", *positions)
    return bytes(cdr.put("I", 0).put("I", 0).out)


def compressed(seconds, form, data):
    return bytes(Cdr().header(seconds, "fisheye").text(form).data(data).out)


def raw_image(seconds, size, step, encoding, data):
    cdr = Cdr().header(seconds, "fisheye").put("I", size[1], size[0]).text(encoding).put("B", 0).put("I", step)
    return bytes(cdr.data(data).out)


def camera_info(seconds, size):
    cdr = Cdr().header(seconds, "fisheye").put("I", size[1], size[0]).text("plumb_bob").put("I", 5).put("d", *[0.0] * 5)
    focal, center = 0.7 * size[0], [0.5 * n for n in size]
    cdr.put("d", focal, 0, center[0], 0, focal, center[1], 0, 0, 1).put("d", 1, 0, 0, 0, 1, 0, 0, 0, 1)
    cdr.put("d", focal, 0, center[0], 0, 0, focal, center[1], 0, 0, 0, 1, 0).put("I", 0, 0)
    return bytes(cdr.put("I", 0, 0, 0, 0).put("B", 0).out)


def detections(seconds, ids):
    cdr = Cdr().header(seconds, "fisheye").put("I", len(ids))
    for number in ids:
        cdr.text("36h11").put("i", number, 0).put("f", 0, 50)
        cdr.put("d", *[500.0] * 2, 400, 400, 600, 400, 600, 600, 400, 600).put("d", *[0.0] * 9)
    return bytes(cdr.out)


def transforms(seconds, names):
    cdr = Cdr().put("I", len(names))
    for parent, child in names:
        cdr.header(seconds, parent).text(child).put("d", 0.1, 0.2, 1.0, 0.0, 0.0, 0.0, 1.0)
    return bytes(cdr.out)


def record(opcode, body):
    return bytes([opcode]) + struct.pack("<Q", len(body)) + body


def text(value):
    data = value if isinstance(value, bytes) else value.encode()
    return struct.pack("<I", len(data)) + data


MAGIC = b"\x89MCAP0\r\n"
START = MAGIC + record(1, text("ros2") + text("hostile"))
END = record(0x0F, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0)) + MAGIC


def schema(number, name, definition="", encoding="ros2msg"):
    return record(3, struct.pack("<H", number) + text(name) + text(encoding) + text(definition))


def channel(number, of_schema, topic, pairs=b""):
    return record(4, struct.pack("<HH", number, of_schema) + text(topic) + text("cdr") + text(pairs))


def message(number, seconds, data):
    nanos = round(seconds * 1_000_000_000)
    return record(5, struct.pack("<HIQQ", number, 0, nanos, nanos) + data)


def chunk(unpacked_bytes, compression, packed, crc=0):
    head = struct.pack("<QQQI", 0, 0, unpacked_bytes, crc)
    return record(6, head + text(compression) + struct.pack("<Q", len(packed)) + packed)


def mcap(streams):
    """A file of `(topic, type, [(seconds, data)])`, without chunks."""
    out = [START]
    for number, (topic, kind, messages) in enumerate(streams, 1):
        out += [schema(number, kind), channel(number, number, topic)]
        out += [message(number, seconds, data) for seconds, data in messages]
    return b"".join([*out, END])


def png_chunk(kind, data, crc=True):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data) if crc else 0)


def png(size, depth=8, colour=0, interlaced=0, between=b"", rows=None):
    """A black picture; `rows`: how many of them are there."""
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
    row = 1 + (size[0] * channels * depth + 7) // 8
    packer = zlib.compressobj(9)
    left, parts = row * (size[1] if rows is None else rows), []
    while left > 0:
        parts.append(packer.compress(bytes(min(left, 1 << 24))))
        left -= 1 << 24
    head = struct.pack(">IIBBBBB", *size, depth, colour, 0, 0, interlaced)
    data = b"".join([*parts, packer.flush()])
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        [png_chunk(b"IHDR", head), between, png_chunk(b"IDAT", data), png_chunk(b"IEND", b"")]
    )


def bomb(unpacked_bytes):
    """Zeros, packed by zlib."""
    packer = zlib.compressobj(9)
    parts = [packer.compress(bytes(1 << 20)) for _ in range(unpacked_bytes >> 20)]
    return b"".join([*parts, packer.flush()])


def segment(marker, data):
    return b"\xff" + bytes([marker]) + struct.pack(">H", len(data) + 2) + data


def jpeg(size, scans=1, is_progressive=False, components=1, scan_bytes=64):
    """One of `scans` scans of `scan_bytes`, whose code is that of zeros."""
    head = b"\xff\xd8" + segment(0xDB, b"\0" + b"\1" * 64)
    frame = struct.pack(">BHHB", 8, size[1], size[0], components)
    frame += b"".join(bytes([k + 1, 0x11, 0]) for k in range(components))
    out = [head, segment(0xC2 if is_progressive else 0xC0, frame)]
    # One code of each table: a difference, or an end of block, of one bit.
    for table in (0x00, 0x10):
        out.append(segment(0xC4, bytes([table, 1]) + b"\0" * 15 + b"\0"))
    for number in range(scans):
        spectral = (b"\0\0\0" if number == 0 else b"\1\x3f\0") if is_progressive else b"\0\x3f\0"
        of = components if number == 0 else 1
        ids = b"".join(bytes([k + 1, 0]) for k in range(of))
        out.append(segment(0xDA, bytes([of]) + ids + spectral) + b"\0" * scan_bytes)
    return b"".join([*out, b"\xff\xd9"])


def varint(value):
    out = [value & 0x7F]
    while value := value >> 7:
        out.append(0x80 | value & 0x7F)
    return bytes(reversed(out))


def lz4_frame(block, unpacked_bytes):
    """A frame of one block of zeros whose length bytes are all 255."""
    head = b"\x04\x22\x4d\x18" + bytes([0x60, 0x70]) + b"\x73"
    literal = b"\x1f\0\1\0"
    body = literal + b"\xff" * (unpacked_bytes // 255) + b"\0" + b"\x50" + b"\0" * 5
    del block
    return head + struct.pack("<I", len(body)) + body + b"\0" * 4


def zstd_frame(unpacked_bytes):
    """A frame of run-length blocks of 128 KiB of zeros, with a window of 128 KiB."""
    blocks = max(unpacked_bytes >> 17, 1)
    one = struct.pack("<I", (0x20000 << 3) | 2)[:3] + b"\0"
    last = struct.pack("<I", (0x20000 << 3) | 3)[:3] + b"\0"
    return struct.pack("<I", 0xFD2FB528) + bytes([0x00, 0x38]) + one * (blocks - 1) + last

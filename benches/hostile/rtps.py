"""A peer of DDS that says what it likes: RTPS 2.3 by hand, over UDP on the loopback."""

import os
import socket
import struct
import time

# Of the first participant of domain 0 on a machine; the next ones are two further each.
METATRAFFIC_PORT = 7410
SPDP, PUBLICATIONS, SUBSCRIPTIONS = 0x0001_00, 0x0000_03, 0x0000_04
BUILTIN_WRITER, BUILTIN_READER = 0xC2, 0xC7
USER_WRITER = 0x03
BEST_EFFORT, RELIABLE = 1, 2
# What every participant of ROS 2 has, and writers of the node's graph.
ALL_ENDPOINTS = 0xC3F
CDR, PARAMETERS = b"\0\1\0\0", b"\0\3\0\0"


def entity(key, kind):
    return key.to_bytes(3, "big") + bytes([kind])


def number(n):
    """A sequence number."""
    return struct.pack("<iI", n >> 32, n & 0xFFFFFFFF)


def text(value):
    """A string of CDR, filled up to four bytes."""
    data = value if isinstance(value, bytes) else value.encode()
    data += b"\0"
    return struct.pack("<I", len(data)) + data + b"\0" * (-len(data) % 4)


def parameter(key, value):
    return struct.pack("<HH", key, len(value)) + value


def parameters(*all_of_them):
    return PARAMETERS + b"".join(all_of_them) + struct.pack("<HH", 1, 0)


def submessage(kind, flags, body):
    # A length that does not fit says: to the end of the datagram.
    return struct.pack("<BBH", kind, flags | 1, len(body) if len(body) < 65536 else 0) + body


def data(reader, writer, n, payload):
    return submessage(0x15, 4, struct.pack("<HH", 0, 16) + reader + writer + number(n) + payload)


def fragment(reader, writer, n, start, size, total, payload, count=1):
    head = struct.pack("<HH", 0, 28) + reader + writer + number(n)
    return submessage(0x16, 0, head + struct.pack("<IHHI", start, count, size, total) + payload)


def heartbeat(reader, writer, first, last, count):
    return submessage(0x07, 0, reader + writer + number(first) + number(last) + struct.pack("<i", count))


def gap(reader, writer, start, base):
    return submessage(0x08, 0, reader + writer + number(start) + number(base) + struct.pack("<I", 0))


ANYBODY = bytes(4)


class Peer:
    """A participant that speaks to another one, given by its index. `count` hears of the bytes that are sent."""

    def __init__(self, count=lambda n: None, port=17410, other=0):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 22)
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        self.socket.bind(("127.0.0.1", port))
        self.port, self.count = port, count
        self.metatraffic = ("127.0.0.1", METATRAFFIC_PORT + 2 * other)
        self.user = ("127.0.0.1", METATRAFFIC_PORT + 2 * other + 1)
        self.prefix = b"\1\20" + os.urandom(10)
        self.numbers = {}

    def send(self, to, *submessages, prefix=None):
        datagram = b"RTPS\2\3\1\20" + (prefix or self.prefix) + b"".join(submessages)
        self.socket.sendto(datagram, to)
        self.count(len(datagram))

    def next(self, writer):
        self.numbers[writer] = self.numbers.get(writer, 0) + 1
        return self.numbers[writer]

    def locator(self):
        return struct.pack("<iI", 1, self.port) + bytes(12) + socket.inet_aton("127.0.0.1")

    def announce(self, prefix=None, *more):
        guid = (prefix or self.prefix) + entity(1, 0xC1)
        body = parameters(
            parameter(0x15, b"\2\3\0\0"),
            parameter(0x16, b"\1\20\0\0"),
            parameter(0x50, guid),
            parameter(0x32, self.locator()),
            parameter(0x31, self.locator()),
            parameter(0x02, struct.pack("<iI", 100, 0)),
            parameter(0x58, struct.pack("<I", ALL_ENDPOINTS)),
            *more,
        )
        n = 1 if prefix else self.next(SPDP)
        self.send(self.metatraffic, data(ANYBODY, entity(SPDP, BUILTIN_WRITER), n, body), prefix=prefix)

    def join(self):
        """Announced, and given the time to be taken up."""
        self.announce()
        time.sleep(0.5)

    def endpoint(self, kind, guid, topic, type_name, reliability=RELIABLE, *more):
        """Announces a writer (PUBLICATIONS) or reader (SUBSCRIPTIONS)."""
        body = parameters(
            parameter(0x5A, self.prefix + guid),
            parameter(0x05, text(topic)),
            parameter(0x07, text(type_name)),
            parameter(0x1A, struct.pack("<IiI", reliability, 0, 100_000_000)),
            *more,
        )
        writer = entity(kind, BUILTIN_WRITER)
        n = self.next(kind)
        self.send(self.metatraffic, data(entity(kind, BUILTIN_READER), writer, n, body), heartbeat(entity(kind, BUILTIN_READER), writer, 1, n, n))

    def writer(self, key, topic, type_name, reliability=RELIABLE):
        """A writer of a topic of ROS, announced; its identity."""
        guid = entity(key, USER_WRITER)
        package, kind, name = type_name.split("/")
        self.endpoint(PUBLICATIONS, guid, "rt" + topic, f"{package}::{kind}::dds_::{name}_", reliability)
        return guid

    def publish(self, writer, body):
        self.send(self.user, data(ANYBODY, writer, self.next(writer), CDR + body))

    def publish_large(self, writer, body, size=60_000):
        """In fragments, all of them."""
        n, whole = self.next(writer), CDR + body
        for start in range(0, len(whole), size):
            piece = whole[start : start + size]
            self.send(self.user, fragment(ANYBODY, writer, n, start // size + 1, size, len(whole), piece))


class Cdr:
    """A message in the making, little endian."""

    def __init__(self):
        self.bytes = bytearray()

    def value(self, form, value):
        size = struct.calcsize("<" + form)
        self.bytes += bytes(-len(self.bytes) % size) + struct.pack("<" + form, value)
        return self

    def text(self, value):
        data = value if isinstance(value, bytes) else value.encode()
        self.value("I", len(data) + 1).bytes += data + b"\0"
        return self

    def texts(self, values, claimed=None):
        self.value("I", len(values) if claimed is None else claimed)
        for value in values:
            self.text(value)
        return self

    def doubles(self, values, claimed=None):
        self.value("I", len(values) if claimed is None else claimed)
        if values:
            self.bytes += bytes(-len(self.bytes) % 8)
            self.bytes += struct.pack(f"<{len(values)}d", *values)
        return self

    def header(self, sec, nanosec=0, frame=""):
        return self.value("i", sec).value("I", nanosec).text(frame)

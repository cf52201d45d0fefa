"""Servers made to harm in the place of a rosbridge, and what a program spends on each -> a table.

    rosbridge.py ARMCAL OUT.csv [NAME ..]

Each attack is a server on the loopback that a process of its own connects to, without motion. Budget: 100 MB and 20 times the bytes that were
sent, 10 s of processor time and 10 s a MB more; neither a signal nor a panic; no character that steers a terminal.
"""

import base64
import hashlib
import json
import mmap
import os
import shutil
import socket
import struct
import sys
import tempfile
import time
import zlib
from pathlib import Path

import measured

ROOT = Path(__file__).parents[2]
ROUTINE = ROOT / "routines/titan4-quickstart.toml"
MAGIC = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10
# Seconds for which an attack that repeats itself lasts.
LASTS_S = 6.0
STEERING = "\x1b]0;mine\x07\x1b[2J\x9b31m\r\b\u202eevil\u2066"
ATTACKS = []


def attack(function):
    ATTACKS.append(function)
    return function


def before_the_handshake(function):
    function.is_raw = True
    return attack(function)


class Client:
    """The other side. `sent` counts bytes."""

    def __init__(self, stream, sent):
        self.stream, self.sent_bytes, self.n = stream, sent, 0

    def send(self, data):
        self.stream.sendall(data)
        self.n += len(data)
        self.sent_bytes[:] = struct.pack("<q", self.n)

    def request(self):
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            head += self.stream.recv(4096)
        return head.decode()

    def accept(self, more=""):
        key = next(line.split(": ", 1)[1] for line in self.request().split("\r\n") if line.startswith("Sec-WebSocket-Key"))
        answer = base64.b64encode(hashlib.sha1((key + MAGIC).encode()).digest()).decode()
        head = f"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {answer}\r\n{more}\r\n"
        self.send(head.encode())

    def frame(self, payload, kind=TEXT, last=True, claimed=None, more=0):
        self.send(head_of(len(payload) if claimed is None else claimed, kind, last, more) + payload)

    def say(self, message):
        self.frame(message.encode() if isinstance(message, str) else json.dumps(message).encode())


def head_of(length, kind=TEXT, last=True, more=0):
    first = bytes([(128 if last else 0) | kind | more])
    if length < 126:
        return first + bytes([length])
    return first + (b"\x7e" + struct.pack(">H", length) if length < 65536 else b"\x7f" + struct.pack(">Q", length))


def published(message, topic="/joint_sensors"):
    return {"op": "publish", "topic": topic, "msg": message}


def state(names, counts, secs=1, nsecs=0):
    header = {"seq": 1, "stamp": {"secs": secs, "nsecs": nsecs}, "frame_id": ""}
    return published({"header": header, "name": names, "position": counts, "velocity": [], "effort": []})


def again(once, pause_s=0.0):
    end = time.monotonic() + LASTS_S
    while time.monotonic() < end:
        once()
        time.sleep(pause_s)


@before_the_handshake
def an_answer_without_end(client):
    again(lambda: client.send(b"x" * 1000))


@before_the_handshake
def headers_without_end(client):
    client.send(b"HTTP/1.1 101 Switching Protocols\r\n")
    again(lambda: client.send(b"X-More: " + b"y" * 1000 + b"\r\n"))


@before_the_handshake
def an_answer_that_trickles(client):
    client.request()
    again(lambda: client.send(b"H"), 0.2)


@before_the_handshake
def a_wrong_key(client):
    client.request()
    client.send(b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nSec-WebSocket-Accept: AAAA\r\n\r\n")
    time.sleep(1)


@before_the_handshake
def an_answer_that_steers_the_terminal(client):
    client.request()
    client.send(f"HTTP/1.1 404 {STEERING}\r\n\r\n".encode())
    time.sleep(1)


@before_the_handshake
def silence(client):
    time.sleep(LASTS_S)


@before_the_handshake
def another_place(client):
    client.request()
    client.send(b"HTTP/1.1 301 Moved\r\nLocation: ws://127.0.0.1:1/\r\n\r\n")
    time.sleep(1)


@attack
def silence_after_the_handshake(client):
    time.sleep(LASTS_S)


@attack
def a_frame_that_claims_all_there_is(client):
    client.frame(b"{", claimed=(1 << 63) - 1)
    time.sleep(LASTS_S)


@attack
def a_frame_that_claims_4_gb(client):
    client.frame(b"{" * 1000, claimed=4 << 30)
    time.sleep(LASTS_S)


@attack
def a_frame_that_claims_30_mb(client):
    client.frame(b"{", claimed=30 << 20)
    time.sleep(LASTS_S)


@attack
def a_frame_of_40_mb(client):
    client.frame(b"x" * (40 << 20))
    time.sleep(1)


@attack
def texts_of_30_mb(client):
    text = b'{"op":"publish","topic":"/joint_sensors","msg":"' + b"x" * (30 << 20) + b'"}'
    for _ in range(5):
        client.frame(text)
    time.sleep(1)


@attack
def fragments_without_end(client):
    client.frame(b"{", last=False)
    again(lambda: client.frame(b" " * 100_000, kind=0, last=False))


@attack
def empty_fragments_without_end(client):
    client.frame(b"{", last=False)
    again(lambda: client.send(head_of(0, 0, False) * 1000))


@attack
def pings_without_end(client):
    again(lambda: client.send((head_of(125, PING) + b"p" * 125) * 100))


@attack
def a_compressed_bomb(client):
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    packed = packer.compress(b" " * (1 << 27)) + packer.flush(zlib.Z_SYNC_FLUSH)
    client.frame(packed[:-4], more=0x40)
    time.sleep(1)


@attack
def nesting_of_a_million(client):
    again(lambda: client.frame(b"[" * 1_000_000), 0.2)


@attack
def objects_within_objects(client):
    again(lambda: client.frame(b'{"a":' * 100_000 + b"1" + b"}" * 100_000), 0.2)


@attack
def values_of_many(client):
    text = b'{"op":"publish","topic":"/joint_sensors","msg":[0' + b",0" * 4_000_000 + b"]}"
    for _ in range(3):
        client.frame(text)
    time.sleep(1)


@attack
def keys_of_many(client):
    text = b"{" + b",".join(b'"%x":0' % n for n in range(1_500_000)) + b"}"
    for _ in range(3):
        client.frame(text)
    time.sleep(1)


@attack
def empty_lists_of_many(client):
    client.frame(b'{"op":"publish","topic":"/joint_sensors","msg":[[]' + b",[]" * 4_000_000 + b"]}")
    time.sleep(1)


@attack
def topics_that_steer_the_terminal(client):
    def once():
        client.say({"op": "publish", "topic": STEERING, "msg": {}})
        client.say({"op": STEERING})
        client.say({"op": "status", "level": "error", "msg": STEERING * 1000})
        client.say(state([STEERING], [0.0]))
        client.say({"op": "service_response", "service": STEERING, "result": False, "values": STEERING})

    again(once, 0.05)


@attack
def a_goodbye_that_steers_the_terminal(client):
    client.frame(struct.pack(">H", 1000) + STEERING.encode()[:120], kind=CLOSE)
    time.sleep(1)


@attack
def complaints_that_differ(client):
    """One line each."""
    n = iter(range(1 << 30))
    again(lambda: client.say({"op": "status", "level": "warning", "msg": f"complaint {next(n)}"}))


@attack
def a_hundred_thousand_joints(client):
    message = state([f"joint_{n}" for n in range(100_000)], [0.0] * 100_000)
    again(lambda: client.say(message), 0.2)


@attack
def numbers_of_a_million_digits(client):
    again(lambda: client.frame(b'{"op":' + b"9" * 1_000_000 + b"}"), 0.1)


@attack
def stamps_of_the_future(client):
    names = ["shoulder_yaw", "shoulder_pitch", "forearm_pitch", "wrist_pitch", "wrist_yaw", "wrist_rotate"]
    for secs in (1, 4_000_000_000, 1 << 62, -1):
        for _ in range(100):
            client.say(state(names, [1000.0] * 6, secs, 4_000_000_000))
    time.sleep(LASTS_S)


@attack
def bytes_that_are_no_text(client):
    again(lambda: client.frame(b"\xff\xfe\xfd" * 100), 0.01)


@attack
def frames_of_unknown_kinds(client):
    for kind in (3, 7, 11, 15):
        client.frame(b"x", kind=kind, more=0x70)
    time.sleep(1)


@attack
def binary_frames_without_end(client):
    again(lambda: client.frame(bytes(1_000_000), kind=BINARY))


@attack
def a_trickle_of_a_message(client):
    client.send(head_of(1000))
    again(lambda: client.send(b" "), 0.05)


@attack
def one_who_never_reads(client):
    """And sends pings that are to be answered."""
    client.stream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    again(lambda: client.send((head_of(125, PING) + b"p" * 125) * 1000))


@attack
def images_of_many_bytes(client):
    header = {"seq": 1, "stamp": {"secs": 1, "nsecs": 0}, "frame_id": ""}
    data = base64.b64encode(bytes(20_000_000)).decode()
    message = json.dumps(published({"header": header, "format": "jpeg", "data": data}, "/camera/wrist/image/compressed"))
    for _ in range(6):
        client.say(message)
    time.sleep(1)


def main(program, out, *names):
    program = str(Path(program).resolve())
    chosen = [one for one in ATTACKS if not names or any(name in one.__name__ for name in names)]
    with measured.Table(out, "attack", "sent_bytes") as table:
        for one in chosen:
            table.add([one.__name__], *meet(program, one))
    return table.end()


def meet(program, one):
    """Bytes that were sent, and what the program spent."""
    folder, sent = Path(tempfile.mkdtemp()), mmap.mmap(-1, 8)
    try:
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
            (folder / "arm.toml").write_text(f'version = 1\nkind = "arm"\n[guard]\nconnect_s = 4.0\n[rosbridge]\nurl = "ws://127.0.0.1:{port}"\n')
            attacker = os.fork()
            if attacker == 0:
                play(one, server, sent)
        arguments = ["drive", ROUTINE, "--arm", "arm.toml", "--no-motion"]
        spent = measured.Child([program, *map(str, arguments)], folder).wait()
        measured.end(attacker)
        return struct.unpack("<q", sent)[0], spent
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def play(one, server, sent):
    """Serves one client; this process ends with it."""
    client = Client(server.accept()[0], sent)
    try:
        if not getattr(one, "is_raw", False):
            client.accept()
        one(client)
    except OSError:
        # It hung up, as it should.
        pass
    except BaseException as problem:
        print(f"{one.__name__}: {problem!r}", file=sys.stderr, flush=True)
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

"""Peers made to harm in the ROS 2 domain of an arm, and what a program spends on each -> a table.

    dds.py ARMCAL OUT.csv [NAME ..]

Needs user namespaces and `ip`: it runs in a network namespace of its own. Each attack meets a process of its own: `discover` looks around,
`listen` hears an arm out without motion, `serve` is the simulated arm. Budget: 100 MB and 20 times the bytes that were sent, 10 s of processor
time and 10 s a MB more; neither a signal nor a panic; no control characters and no marks of direction in what is printed.
"""

import mmap
import os
import shutil
import struct
import sys
import tempfile
import threading
import time
import tomllib
from math import degrees, inf, nan
from pathlib import Path

import measured
from rtps import (ANYBODY, BUILTIN_READER, BUILTIN_WRITER, METATRAFFIC_PORT, PUBLICATIONS, SPDP, SUBSCRIPTIONS, USER_WRITER, Cdr, Peer, data, entity,
                  fragment, gap, heartbeat, number, parameter, parameters, submessage, text)

ROOT = Path(__file__).parents[2]
NAMESPACE = "ip link set lo up multicast on && ip route add 239.0.0.0/8 dev lo && exec \"$@\""
STATES, IMAGE = "sensor_msgs/msg/JointState", "sensor_msgs/msg/CompressedImage"
JOINTS, IMAGES, COMMANDS = "/joint_sensors", "/camera/wrist/image/compressed", "/joint_commands"
CLAIM = 0xFFFFFFFF
# More than is claimed: what the program allows counts, not what it is refused.
ADDRESS_BYTES = 12 << 30
# Seconds for which an attack that repeats itself lasts.
LASTS_S = 4.0
ROUTINE = ROOT / "routines/titan4-quickstart.toml"
MAP = 'version = 1\nkind = "arm"\nnetworks = ["127.0.0.1"]\n[guard]\nconnect_s = 6.0\nready_s = 5.0\nstale_s = 2.0\n'
COMMAND = {
    "discover": ["discover", "--network", "127.0.0.1", "--for", "6", "--robot", ROOT / "robots/titan4"],
    "listen": ["drive", ROUTINE, "--arm", "arm.toml", "--no-motion"],
    "search": ["drive", ROUTINE, "--arm", "search.toml", "--no-motion"],
    "serve": ["serve", ROUTINE, "--arm", "arm.toml", "--for", "6"],
    "drive": ["drive", ROUTINE, "--arm", "arm.toml", "--unattended", "--out", "out"],
}
ATTACKS = []


def attack(*commands):
    def add(function):
        ATTACKS.extend((function, command) for command in commands)
        return function

    return add


def joints():
    """Names and resting counts of the arm."""
    robot = tomllib.loads((ROOT / "robots/titan4/robot.toml").read_text())
    sensors = robot["joint_sensor"]
    counts = [
        (s["offset_counts"] + s["scale_counts_per_deg"] * degrees(angle)) % s["wrap_counts"] for s, angle in zip(sensors, robot["stowed_rad"])
    ]
    return [s["joint"] for s in sensors], counts


NAMES, COUNTS = joints()


def state(names, counts, at=None):
    sec, nanosec = at if at else divmod(time.time_ns(), 1_000_000_000)
    return bytes(Cdr().header(sec, nanosec).texts(names).doubles(counts).doubles([]).doubles([]).bytes)


class Driver(threading.Thread):
    """A sound arm at rest, beside the one that harms."""

    def __init__(self, count):
        super().__init__(daemon=True)
        self.peer = Peer(count, port=17510)
        self.peer.join()
        self.writer = self.peer.writer(1, JOINTS, STATES)
        self.start()

    def run(self):
        n = 0
        while True:
            self.peer.publish(self.writer, state(NAMES, [count + n % 2 for count in COUNTS]))
            n += 1
            time.sleep(0.02)


def sound(peer):
    return Driver(peer.count)


def announced(peer, topic=JOINTS, type_name=STATES):
    """A writer that the other side knows."""
    peer.join()
    writer = peer.writer(1, topic, type_name)
    time.sleep(0.3)
    return writer


def again(once, pause_s=0.02):
    """Repeats it."""
    end = time.monotonic() + LASTS_S
    while time.monotonic() < end:
        once()
        time.sleep(pause_s)


def repeat(peer, *bodies, topic=JOINTS, type_name=STATES):
    writer = announced(peer, topic, type_name)
    again(lambda: [peer.publish(writer, body) for body in bodies])


@attack("discover", "listen")
def joints_claim_names(peer):
    repeat(peer, bytes(Cdr().header(1).texts(NAMES, CLAIM).bytes))


@attack("discover", "listen")
def joints_claim_positions(peer):
    repeat(peer, bytes(Cdr().header(1).texts(NAMES).doubles(COUNTS, CLAIM).bytes))


@attack("discover", "listen")
def joints_claim_a_text(peer):
    repeat(peer, bytes(Cdr().header(1).value("I", 1).value("I", CLAIM).bytes) + b"abc\0")


@attack("discover", "listen")
def joints_cut_anywhere(peer):
    whole = state(NAMES, COUNTS)
    repeat(peer, *(whole[:n] for n in range(len(whole))))


@attack("discover", "listen")
def a_hundred_thousand_joints(peer):
    writer = announced(peer)
    names = [f"joint_{n}" for n in range(100_000)]
    body = state(names, [float(n) for n in range(100_000)])
    again(lambda: peer.publish_large(writer, body), 0.5)


@attack("discover", "listen")
def joints_named_again_and_again(peer):
    names = [name for name in NAMES for _ in range(300)]
    repeat(peer, state(names, [float(n) for n in range(len(names))]))


@attack("discover", "listen")
def joints_that_are_no_numbers(peer):
    repeat(peer, *(state(NAMES, [value] * len(NAMES)) for value in (nan, inf, -inf, 1e308, -0.0, 5e-324)))


@attack("discover", "listen")
def names_that_steer_the_terminal(peer):
    steering = [b"\x1b]0;mine\x07\x1b[2J\x9b31m", "\u202eevil\u2066\u200f".encode(), b"\0", b"\xff\xfe", b"a\nb\rc\x08"]
    repeat(peer, state(steering, [0.0] * len(steering)), state([b"\x1b[2J" * 2000], [0.0]))


def stamped(name, *stamps):
    def stamps_of(peer):
        writer = announced(peer)
        # Sound readings first, by the stamps that are usual.
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            peer.publish(writer, state(NAMES, COUNTS))
            time.sleep(0.02)
        again(lambda: [peer.publish(writer, state(NAMES, COUNTS, at)) for at in stamps])

    stamps_of.__name__ = name
    attack("discover", "listen")(stamps_of)


stamped("stamps_of_the_future", (0x7FFFFFFF, 999_999_999))
stamped("stamps_of_tomorrow", (int(time.time()) + 86_400, 0))
stamped("stamps_of_the_past", (-0x80000000, 0), (-1, 0))
stamped("stamps_of_zero", (0, 0))
stamped("stamps_with_too_many_nanoseconds", (1, CLAIM))


@attack("discover", "listen")
def stamps_of_the_future_from_the_first(peer):
    repeat(peer, state(NAMES, COUNTS, (0x7FFFFFFF, 999_999_999)))


@attack("discover", "listen")
def samples_stamped_in_the_future(peer):
    """Those of the middleware, not of the message."""
    writer = announced(peer)
    stamp = submessage(0x09, 0, struct.pack("<II", CLAIM, CLAIM))
    again(lambda: peer.send(peer.user, stamp, data(ANYBODY, writer, peer.next(writer), b"\0\1\0\0" + state(NAMES, COUNTS))))


def claimed(name, total, times=1, writers=1, topic=JOINTS, type_name=STATES):
    def fragments(peer):
        sound(peer)
        writer = announced(peer, topic, type_name)
        for k in range(writers):
            prefix = peer.prefix if k == 0 else os.urandom(12)
            for n in range(times):
                piece = fragment(ANYBODY, writer, peer.next(writer), 1, 60_000 if total > 60_000 else 100, total, bytes(100))
                peer.send(peer.user, piece, prefix=prefix)
                time.sleep(0.001)
        time.sleep(LASTS_S)

    fragments.__name__ = name
    attack("discover", "listen")(fragments)


claimed("one_fragment_of_4_gb", CLAIM)
claimed("one_fragment_of_2_gb", 2_000_000_000)
claimed("one_fragment_of_200_mb", 200_000_000)
claimed("fragments_of_many_large_samples", 50_000_000, times=200)
claimed("fragments_of_many_small_samples", 60_000, times=3000)
claimed("fragments_of_many_writers", 10_000_000, writers=300)


@attack("listen", "search")
def fragments_of_images_without_end(peer):
    """Images of 2 MB of which one fragment each comes."""
    sound(peer)
    writer = announced(peer, IMAGES, IMAGE)
    end = time.monotonic() + LASTS_S
    while time.monotonic() < end:
        peer.send(peer.user, fragment(ANYBODY, writer, peer.next(writer), 1, 60_000, 2_000_000, bytes(60_000)))
        time.sleep(0.01)


@attack("discover", "listen")
def fragments_that_lie_about_their_place(peer):
    writer = announced(peer)
    for start in (0, 1, 2, CLAIM):
        for size in (0, 1, 100, 65535):
            for total in (0, 1, 100, 65536, 10_000_000):
                for count in (0, 1, 65535):
                    peer.send(peer.user, fragment(ANYBODY, writer, peer.next(writer), start, size, total, bytes(100), count))
    time.sleep(LASTS_S)


@attack("discover", "listen")
def ten_thousand_participants(peer):
    sound(peer)
    for n in range(10_000):
        peer.announce(prefix=b"\1\20" + n.to_bytes(10, "big"))
        if n % 20 == 0:
            time.sleep(0.004)
    time.sleep(1)


@attack("discover", "listen")
def ten_thousand_topics(peer):
    sound(peer)
    peer.join()
    for n in range(10_000):
        kind = (PUBLICATIONS, SUBSCRIPTIONS)[n % 2]
        peer.endpoint(kind, entity(n + 10, 0x03 if kind == PUBLICATIONS else 0x04), f"rt/topic_{n}", "std_msgs::msg::dds_::Bool_")
        if n % 20 == 0:
            time.sleep(0.004)
    time.sleep(1)


@attack("discover", "listen")
def three_thousand_topics_of_joints(peer):
    """A listener to each is a thing of its own."""
    sound(peer)
    peer.join()
    for n in range(3000):
        peer.writer(n + 10, f"/joints_{n}", STATES)
        if n % 20 == 0:
            time.sleep(0.01)
    time.sleep(1)


@attack("discover", "listen")
def three_thousand_writers_of_the_joints(peer):
    sound(peer)
    peer.join()
    for n in range(3000):
        peer.writer(n + 10, JOINTS, STATES)
        if n % 20 == 0:
            time.sleep(0.01)
    time.sleep(1)


@attack("discover")
def services_without_end(peer):
    peer.join()
    for n in range(5000):
        peer.endpoint(SUBSCRIPTIONS, entity(n + 10, 0x04), f"rq/stop_{n}Request", "std_srvs::srv::dds_::Trigger_Request_")
        if n % 20 == 0:
            time.sleep(0.01)
    time.sleep(1)


@attack("discover", "listen")
def names_of_topics_that_steer_the_terminal(peer):
    sound(peer)
    peer.join()
    for n, name in enumerate(["\x1b[2J\x1b]0;mine\x07", "\u202e\u2066\u200fevil", "a\nversion = 9\n#", "\x9b31m\r\b", "x" * 20_000]):
        for kind in (PUBLICATIONS, SUBSCRIPTIONS):
            guid = entity(2 * n + 10 + (kind == PUBLICATIONS), 0x03 if kind == PUBLICATIONS else 0x04)
            peer.endpoint(kind, guid, "rt/" + name, "sensor_msgs::msg::dds_::JointState_")
            peer.endpoint(kind, entity(100 + n, guid[3]), "rt/ok", f"std_msgs::msg::dds_::{name}_")
            peer.endpoint(kind, entity(200 + n, guid[3]), f"rq/{name}Request", f"std_srvs::srv::dds_::{name}Trigger_Request_")
        # Of a node, with properties and user data that say as much.
        peer.announce(None, parameter(0x62, text(name)), parameter(0x2C, text(name)))
    time.sleep(2)


@attack("discover", "listen")
def long_names_of_topics(peer):
    peer.join()
    for n in range(500):
        peer.writer(n + 10, "/" + f"{n}_" + "n" * 30_000, STATES)
        time.sleep(0.002)
    time.sleep(1)


@attack("discover", "listen")
def readers_that_ask_for_what_is_not_offered(peer):
    """One complaint each."""
    sound(peer)
    peer.join()
    for n in range(3000):
        persistent = parameter(0x1D, struct.pack("<I", 3))
        guid = entity(n + 10, 0x04)
        peer.endpoint(SUBSCRIPTIONS, guid, "rt" + COMMANDS, "trajectory_msgs::msg::dds_::JointTrajectory_", 2, persistent)
        if n % 20 == 0:
            time.sleep(0.01)
    time.sleep(1)


@attack("discover", "listen")
def heartbeats_of_all_numbers(peer):
    sound(peer)
    peer.join()
    for kind in (PUBLICATIONS, SUBSCRIPTIONS):
        peer.send(peer.metatraffic, heartbeat(entity(kind, BUILTIN_READER), entity(kind, BUILTIN_WRITER), 1, (1 << 62), 1))
    time.sleep(LASTS_S)


@attack("discover", "listen")
def a_gap_of_all_numbers(peer):
    sound(peer)
    peer.join()
    for kind in (PUBLICATIONS, SUBSCRIPTIONS):
        peer.send(peer.metatraffic, gap(entity(kind, BUILTIN_READER), entity(kind, BUILTIN_WRITER), 2, (1 << 62)))
    time.sleep(LASTS_S)


@attack("discover", "listen")
def numbers_at_their_ends(peer):
    writer = announced(peer)
    for n in (0, -1, (1 << 63) - 1, -(1 << 63)):
        peer.send(peer.user, data(ANYBODY, writer, n, b"\0\1\0\0" + state(NAMES, COUNTS)))
        for m in (0, -1, (1 << 63) - 1, -(1 << 63)):
            for reader, kind in ((peer.metatraffic, PUBLICATIONS), (peer.metatraffic, SUBSCRIPTIONS)):
                ours, theirs = entity(kind, BUILTIN_READER), entity(kind, BUILTIN_WRITER)
                if m - n < 1 << 20:
                    peer.send(reader, heartbeat(ours, theirs, n, m, 0x7FFFFFFF))
                    peer.send(reader, gap(ours, theirs, n, m))
    time.sleep(LASTS_S)


@attack("discover", "listen")
def acknowledgements_of_nothing(peer):
    """Of the builtin writers: everything is asked for again and again."""
    peer.join()
    count = 0
    end = time.monotonic() + LASTS_S
    while time.monotonic() < end:
        for kind in (PUBLICATIONS, SUBSCRIPTIONS):
            count += 1
            body = entity(kind, BUILTIN_READER) + entity(kind, BUILTIN_WRITER) + number(1) + struct.pack("<I8Ii", 256, *[CLAIM] * 8, count)
            peer.send(peer.metatraffic, submessage(0x06, 0, body))
        time.sleep(0.0005)


@attack("discover", "listen")
def announcements_of_nonsense(peer):
    """Lists of parameters that are cut, doubled, too long or of another kind."""
    random = __import__("random").Random(1)
    writer = entity(SPDP, BUILTIN_WRITER)
    for n in range(3000):
        keys = [random.choice([0x05, 0x07, 0x15, 0x16, 0x1A, 0x2C, 0x2F, 0x31, 0x32, 0x50, 0x58, 0x59, 0x5A, 0x62, 0x70]) for _ in range(8)]
        body = b"".join(parameter(key, random.randbytes(random.choice([0, 1, 4, 12, 16, 24, 200]))) for key in keys)
        peer.send(peer.metatraffic, data(ANYBODY, writer, n + 1, parameters(body)[: random.randrange(4, 400)]))
        kind = random.choice([PUBLICATIONS, SUBSCRIPTIONS])
        peer.send(peer.metatraffic, data(ANYBODY, entity(kind, BUILTIN_WRITER), n + 1, parameters(body)))
        peer.send(random.choice([peer.metatraffic, peer.user]), random.randbytes(random.randrange(1, 300)))
        if n % 20 == 0:
            time.sleep(0.004)


@attack("discover", "listen")
def locators_without_end(peer):
    peer.join()
    for n in range(20):
        more = [parameter(0x32, struct.pack("<iI", 1, 20_000 + k) + bytes(12) + b"\x7f\0\0\1") for k in range(2000)]
        peer.announce(None, *more)
        time.sleep(0.1)
    time.sleep(1)


@attack("discover", "listen")
def graphs_of_many_nodes(peer):
    """ros_discovery_info: names of nodes, with the identities of what they have."""
    sound(peer)
    peer.join()
    writer = entity(5, USER_WRITER)
    peer.endpoint(PUBLICATIONS, writer, "ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_", 2, parameter(0x1D, struct.pack("<I", 1)))
    time.sleep(0.3)
    body = Cdr()
    body.bytes += peer.prefix + entity(1, 0xC1) + bytes(8)
    body.value("I", 20_000)
    for n in range(20_000):
        body.text("/").text(f"node\x1b[2J_{n}").value("I", 0).value("I", 0)
    for _ in range(20):
        peer.publish_large(writer, bytes(body.bytes))
        time.sleep(0.1)


def image(body, claimed=None, form="jpeg"):
    made = Cdr().header(*divmod(time.time_ns(), 1_000_000_000), "camera").text(form).value("I", len(body) if claimed is None else claimed)
    return bytes(made.bytes) + body


def jpeg(width, height):
    """A frame that says its size and has no pixels."""
    frame = struct.pack(">BHHB", 8, height, width, 1) + b"\1\x11\0"
    return b"\xff\xd8\xff\xc0" + struct.pack(">H", 2 + len(frame)) + frame + b"\xff\xda\0\x08\1\1\0\0\x3f\0" + bytes(100) + b"\xff\xd9"


@attack("discover", "listen", "search")
def images_that_claim_more_than_they_carry(peer):
    sound(peer)
    repeat(peer, image(b"\xff\xd8", CLAIM), image(jpeg(65535, 65535)), image(jpeg(1224, 1024)), image(b""), topic=IMAGES, type_name=IMAGE)


@attack("search")
def images_of_many_pixels(peer):
    import zlib

    def chunk(name, body):
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    rows = zlib.compress(bytes(20_001 * 2000), 9)
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 20_000, 20_000, 8, 0, 0, 0, 0)) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    sound(peer)
    writer = announced(peer, IMAGES, IMAGE)
    again(lambda: peer.publish_large(writer, image(png, form="png")), 0.1)


@attack("discover", "listen")
def images_of_5_mb(peer):
    """Whole, as fast as they go."""
    sound(peer)
    writer = announced(peer, IMAGES, IMAGE)
    body = image(bytes(5_000_000))
    again(lambda: peer.publish_large(writer, body), 0.1)


def wait_for_motion():
    """The recording grows from the first motion on."""
    recording = Path("out/run.mcap.partial")
    while not recording.is_file() or recording.stat().st_size < 150_000:
        time.sleep(0.05)


def while_it_moves(name, total):
    """One fragment in mid-motion."""

    def fragment_of(peer):
        writer = announced(peer)
        wait_for_motion()
        peer.send(peer.user, fragment(ANYBODY, writer, 1, 1, 60_000, total, bytes(60_000)))

    fragment_of.__name__ = name
    attack("drive")(fragment_of)


while_it_moves("one_fragment_of_300_mb_in_motion", 300_000_000)
while_it_moves("one_fragment_of_3_gb_in_motion", 3_000_000_000)


@attack("drive")
def heartbeats_of_all_numbers_in_motion(peer):
    peer.join()
    wait_for_motion()
    peer.send(peer.metatraffic, heartbeat(entity(PUBLICATIONS, BUILTIN_READER), entity(PUBLICATIONS, BUILTIN_WRITER), 1, (1 << 62), 1))


@attack("serve")
def set_points_of_many_points(peer):
    writer = announced(peer, COMMANDS, "trajectory_msgs/msg/JointTrajectory")
    many = Cdr().header(1).texts(NAMES).value("I", 100_000)
    for _ in range(100_000):
        many.doubles([]).doubles([]).doubles([]).doubles([]).value("i", 0).value("I", 0)
    claims = Cdr().header(1).texts(NAMES).value("I", CLAIM).doubles(COUNTS, CLAIM)
    nothing = Cdr().header(1).texts(NAMES).value("I", 1).doubles([nan] * len(NAMES)).doubles([]).doubles([]).doubles([]).value("i", 0).value("I", 0)

    def once():
        peer.publish_large(writer, bytes(many.bytes))
        peer.publish(writer, bytes(claims.bytes))
        peer.publish(writer, bytes(nothing.bytes))

    again(once, 0.3)


@attack("serve")
def set_points_without_end(peer):
    writer = announced(peer, COMMANDS, "trajectory_msgs/msg/JointTrajectory")
    names = [name for name in NAMES for _ in range(100)]
    one = Cdr().header(1).texts(names).value("I", 1).doubles([0.0] * len(names)).doubles([]).doubles([]).doubles([]).value("i", 0).value("I", 0)
    end = time.monotonic() + LASTS_S
    while time.monotonic() < end:
        peer.publish(writer, bytes(one.bytes))


def main(program, out, *names):
    program = str(Path(program).resolve())
    chosen = [(one, command) for one, command in ATTACKS if not names or any(name in f"{one.__name__}/{command}" for name in names)]
    with measured.Table(out, "attack", "command", "sent_bytes") as table:
        for one, command in chosen:
            table.add([one.__name__, command], *meet(program, one, command))
    return table.end()


def meet(program, one, command):
    """Bytes that were sent, and what the program spent."""
    folder = Path(tempfile.mkdtemp())
    sent = mmap.mmap(-1, 8)
    try:
        (folder / "arm.toml").write_text(MAP)
        (folder / "search.toml").write_text('detections = ""\n' + MAP)
        arm = served(program, folder) if command == "drive" else None
        child = measured.Child([program, *map(str, COMMAND[command])], folder, ADDRESS_BYTES)
        attacker = os.fork()
        if attacker == 0:
            os.chdir(folder)
            play(one, sent, 1 if arm else 0)
        spent = child.wait()
        measured.end(attacker)
        if arm:
            arm_ended = "[arm_was_stopped]" if "told to stop" in arm.stop().said else "[arm_was_not_stopped]"
            spent.said = f"{arm_ended} {spent.said}"
        return struct.unpack("<q", sent)[0], spent
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def served(program, folder):
    """The simulated arm, as soon as it can be reached."""
    (folder / "arm").mkdir()
    arm = measured.Child([program, "serve", str(ROUTINE), "--arm", "../arm.toml", "--factor", "8"], folder / "arm")
    wait_for(0)
    return arm


def wait_for(participant):
    port = f":{METATRAFFIC_PORT + 2 * participant:04X} "
    while port not in Path("/proc/net/udp").read_text():
        time.sleep(0.01)
    time.sleep(0.5)


def play(one, sent, participant):
    """Attacks as soon as the other side listens, until this process is ended."""
    lock = threading.Lock()

    def count(n):
        with lock:
            sent[:] = struct.pack("<q", struct.unpack("<q", sent)[0] + n)

    try:
        wait_for(participant)
        one(Peer(count, other=participant))
        # A sound driver next to it works on.
        time.sleep(measured.WALL_LIMIT_S)
    except BaseException as problem:
        print(f"{one.__name__}: {problem!r}", file=sys.stderr, flush=True)
        os._exit(1)
    os._exit(0)


if __name__ == "__main__":
    if os.environ.get("HOSTILE_NAMESPACE") is None:
        os.environ["HOSTILE_NAMESPACE"] = "1"
        inner = ["bash", "-c", NAMESPACE, "netns", sys.executable, *sys.argv]
        os.execvp("unshare", ["unshare", "-rn", "--pid", "--fork", "--kill-child", *inner])
    sys.exit(main(*sys.argv[1:]))

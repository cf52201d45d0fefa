"""Files made to harm. Each attack writes into its own folder and returns the arguments of the command that reads it."""

import shutil
import sqlite3
import struct
import zlib
from pathlib import Path

import wire

ROOT = Path(__file__).parents[2]
LENS = (1224, 1024)
STATES, IMAGE = "sensor_msgs/msg/JointState", "sensor_msgs/msg/CompressedImage"
TAGS = "apriltag_msgs/msg/AprilTagDetectionArray"
IMAGES_MAP = '[joint_sensors]\ntopic = "/joint_states"\n[tags]\ntopic = "/tags"\ncamera_frame = "fisheye"\nuse = "corners"\n'
POSITIONS_MAP = """[joint_sensors]
topic = "/joint_states"
[tags]
topic = "/tf"
camera_frame = "fisheye"
child_frame = "tag36h11:{id}"
use = "position"
"""
TABLE_MAP = """[table]
[joint_sensors]
unit = "rad"
[tags]
use = "pose"
child_frame = "board"
[tags.columns]
direction = "tag_from_camera"
position = ["x", "y", "z"]
rotation = ["rx", "ry", "rz"]
rotation_form = "fixed_xyz"
"""
ATTACKS = []


def attack(function):
    ATTACKS.append(function)
    return function


def robot(folder, name="titan4-pinhole"):
    """A copy of a robot, with the URDF of its arm beside it."""
    for needed in {name, "titan4"}:
        shutil.copytree(ROOT / "robots" / needed, folder / needed)
    return folder / name


def without_lens(folder):
    """A robot whose lens the recording tells."""
    made = robot(folder)
    keys = ("model", "resolution_px", "focal_px", "center_px", "distortion =")
    lines = (made / "robot.toml").read_text().splitlines(keepends=True)
    (made / "robot.toml").write_text("".join(line for line in lines if not line.startswith(keys)))
    return made


def calibrate(folder, recording, map_text, of=None):
    (folder / "map.toml").write_text('version = 1\nkind = "input"\n' + map_text)
    return ["calibrate", recording, "--robot", of or robot(folder), "--input", folder / "map.toml", "--out", folder / "out"]


def write(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def joints(n=20):
    return ("/joint_states", STATES, [(k, wire.joint_state(k, wire.JOINTS)) for k in range(1, n + 1)])


def images(folder, messages, kind=IMAGE, info=None):
    """A recording of images; with `info`, its own lens says their size."""
    streams = [joints(), ("/tags", kind, [(k + 0.1, data) for k, data in enumerate(messages, 1)])]
    of, map_text = robot, IMAGES_MAP
    if info:
        streams.append(("/info", "sensor_msgs/msg/CameraInfo", [(1, wire.camera_info(1, info))]))
        of, map_text = without_lens, IMAGES_MAP + 'camera_info = "/info"\n'
    return calibrate(folder, write(folder, "a.mcap", wire.mcap(streams)), map_text, of(folder))


def image(folder, form, data, info=None):
    return images(folder, [wire.compressed(1, form, data)], info=info)


# Images.


@attack
def png_of_another_size(folder):
    return image(folder, "png", wire.png((20_000, 20_000)))


@attack
def png_20000_with_its_lens(folder):
    return image(folder, "png", wire.png((20_000, 20_000)), (20_000, 20_000))


@attack
def png_9999_with_its_lens(folder):
    return image(folder, "png", wire.png((9_999, 9_999)), (9_999, 9_999))


@attack
def png_9999_of_no_rows(folder):
    return image(folder, "png", wire.png((9_999, 9_999), rows=0), (9_999, 9_999))


@attack
def png_1000000_wide(folder):
    return image(folder, "png", wire.png((65_536, 1_500)), (65_536, 1_500))


@attack
def png_16_bit_rgba_9999(folder):
    return image(folder, "png", wire.png((9_999, 9_999), 16, 6), (9_999, 9_999))


@attack
def png_interlaced_9999(folder):
    return image(folder, "png", wire.png((9_999, 9_999), 16, 0, 1), (9_999, 9_999))


@attack
def png_4_megapixels(folder):
    return image(folder, "png", wire.png((2_000, 2_000)), (2_000, 2_000))


@attack
def png_of_the_lens_20_times(folder):
    return images(folder, [wire.compressed(1, "png", wire.png(LENS))] * 20)


def text_chunk(kind, head):
    def of(folder):
        chunk = wire.png_chunk(kind, head + wire.bomb(3 << 30))
        return image(folder, "png", wire.png(LENS, between=chunk))

    of.__name__ = f"png_{kind.decode()}_of_3_GiB"
    return attack(of)


for made in (b"zTXt", b"a\0\0"), (b"iTXt", b"a\0\1\0\0\0"), (b"iCCP", b"a\0\0"):
    text_chunk(*made)


@attack
def png_text_chunks_by_the_100000(folder):
    return image(folder, "png", wire.png(LENS, between=wire.png_chunk(b"zTXt", b"a\0\0" + zlib.compress(b"b")) * 100_000))


@attack
def png_data_of_1_GiB_more(folder):
    bomb = wire.png_chunk(b"IDAT", wire.bomb(1 << 30))
    return image(folder, "png", wire.png(LENS, between=bomb))


@attack
def png_palette_and_transparency(folder):
    between = wire.png_chunk(b"PLTE", bytes(768)) + wire.png_chunk(b"tRNS", bytes(256))
    return image(folder, "png", wire.png((9_999, 9_999), 1, 3, between=between), (9_999, 9_999))


@attack
def jpeg_of_another_size(folder):
    return image(folder, "jpeg", wire.jpeg((16_383, 16_383), scan_bytes=1_500))


@attack
def jpeg_16383_with_its_lens(folder):
    return image(folder, "jpeg", wire.jpeg((16_383, 16_383), scan_bytes=1_500), (16_383, 16_383))


@attack
def jpeg_9999_with_its_lens(folder):
    return image(folder, "jpeg", wire.jpeg((9_999, 9_999), scan_bytes=1_500), (9_999, 9_999))


@attack
def jpeg_progressive_of_5000_scans(folder):
    return image(folder, "jpeg", wire.jpeg(LENS, 5_000, True))


@attack
def jpeg_progressive_9999_of_5000_scans(folder):
    return image(folder, "jpeg", wire.jpeg((9_999, 9_999), 5_000, True), (9_999, 9_999))


@attack
def jpeg_two_sizes(folder):
    second = struct.pack(">BHHB", 8, 16_383, 16_383, 1) + b"\1\x11\0"
    good = wire.jpeg(LENS)
    at = good.index(b"\xff\xda")
    return image(folder, "jpeg", good[:at] + wire.segment(0xC0, second) + good[at:])


@attack
def jpeg_profiles_of_4_MB(folder):
    icc = b"".join(wire.segment(0xE2, b"ICC_PROFILE\0\1\xff" + bytes(65_000)) for _ in range(64))
    return image(folder, "jpeg", wire.jpeg(LENS).replace(b"\xff\xd8", b"\xff\xd8" + icc, 1))


@attack
def raw_image_of_claimed_size(folder):
    data = wire.raw_image(1, (60_000, 60_000), 60_000, "mono8", bytes(1_000))
    return images(folder, [data], "sensor_msgs/msg/Image", (60_000, 60_000))


@attack
def raw_image_without_width(folder):
    return images(folder, [wire.raw_image(1, (0, 2**32 - 1), 0, "bayer_rggb8", b"")], "sensor_msgs/msg/Image")


# Messages.


@attack
def tags_100000_in_a_message(folder):
    streams = [joints(), ("/tags", TAGS, [(1.1, wire.detections(1, range(100_000)))])]
    return calibrate(folder, write(folder, "a.mcap", wire.mcap(streams)), IMAGES_MAP)


@attack
def tags_100000_of_one_id(folder):
    streams = [joints(), ("/tags", TAGS, [(1.1, wire.detections(1, [0] * 100_000))])]
    return calibrate(folder, write(folder, "a.mcap", wire.mcap(streams)), IMAGES_MAP)


@attack
def tags_of_100000_in_each_of_5_messages(folder):
    streams = [joints(), ("/tags", TAGS, [(k + 0.1, wire.detections(k, range(20_000))) for k in range(1, 6)])]
    return calibrate(folder, write(folder, "a.mcap", wire.mcap(streams)), IMAGES_MAP)


def tagmap(name, n_tags, n_views):
    def of(folder):
        # Each view shows other tags, and tag 0 in all.
        ids = [[0, *range(1 + k * n_tags, 1 + (k + 1) * n_tags)] for k in range(n_views)]
        messages = [(k, wire.detections(k, of_view)) for k, of_view in enumerate(ids, 1)]
        recording = write(folder, "a.mcap", wire.mcap([("/tags", TAGS, messages)]))
        return ["tagmap", recording, "--robot", robot(folder)]

    of.__name__ = name
    return attack(of)


tagmap("tagmap_of_100000_tags_in_a_view", 100_000, 1)
tagmap("tagmap_of_1000_tags_in_a_view", 1_000, 1)
tagmap("tagmap_of_400_tags_in_100_views", 400, 100)
tagmap("tagmap_of_10_tags_in_1000_views", 10, 1_000)


@attack
def tags_in_50000_messages(folder):
    streams = [joints(), ("/tags", TAGS, [(1.1 + k * 1e-3, wire.detections(1, [0, 1])) for k in range(50_000)])]
    return calibrate(folder, write(folder, "a.mcap", wire.mcap(streams)), IMAGES_MAP)


@attack
def transforms_100000_of_other_frames(folder):
    names = [(f"parent{k}", f"child{k}") for k in range(100_000)]
    streams = [joints(), ("/tf", "tf2_msgs/msg/TFMessage", [(1.1, wire.transforms(1, names))])]
    return calibrate(folder, write(folder, "a.mcap", wire.mcap(streams)), POSITIONS_MAP)


@attack
def transforms_100000_of_tags(folder):
    names = [("fisheye", f"tag36h11:{k}") for k in range(100_000)]
    streams = [joints(), ("/tf", "tf2_msgs/msg/TFMessage", [(1.1, wire.transforms(1, names))])]
    return calibrate(folder, write(folder, "a.mcap", wire.mcap(streams)), POSITIONS_MAP)


def joint_names(name, names, n_messages=1):
    def of(folder):
        messages = [(k, wire.joint_state(k, names(k))) for k in range(1, n_messages + 1)]
        streams = [("/joint_states", STATES, messages), ("/tf", "tf2_msgs/msg/TFMessage", [])]
        return calibrate(folder, write(folder, "a.mcap", wire.mcap(streams)), POSITIONS_MAP)

    of.__name__ = name
    return attack(of)


joint_names("joints_1000000_other_names", lambda k: [f"j{n}" for n in range(1_000_000)])
joint_names("joints_1000000_of_one_name", lambda k: [*wire.JOINTS, *["shoulder_yaw"] * 1_000_000])
joint_names("joints_of_20000_messages_with_new_names", lambda k: [f"{k}_{n}" for n in range(20)], 20_000)
joint_names("joints_without_a_name", lambda k: [""] * 1_000_000)


@attack
def joints_inspected_with_1000000_names(folder):
    streams = [("/joint_states", STATES, [(1, wire.joint_state(1, [f"j{n}" for n in range(1_000_000)]))])]
    recording = write(folder, "a.mcap", wire.mcap(streams))
    return ["inspect", recording, "--robot", robot(folder), "--write-input", folder / "map.toml"]


@attack
def claimed_lengths_in_a_message(folder):
    data = b"\0\1\0\0" + struct.pack("<II", 1, 0) + struct.pack("<I", 2**31) + b"a\0"
    names = wire.Cdr().header(1).put("I", 2**32 - 1)
    streams = [("/joint_states", STATES, [(1, data), (2, bytes(names.out))])]
    return calibrate(folder, write(folder, "a.mcap", wire.mcap(streams)), POSITIONS_MAP)


# Recordings.


def chunks(name, content):
    def of(folder):
        return ["inspect", write(folder, "a.mcap", wire.START + content() + wire.END)]

    of.__name__ = name
    return attack(of)


chunks("chunk_zstd_of_1_GiB", lambda: wire.chunk(1 << 30, "zstd", wire.zstd_frame(1 << 30)))
chunks("chunk_zstd_of_1_GiB_that_claims_1_kB", lambda: wire.chunk(1 << 10, "zstd", wire.zstd_frame(1 << 30)))
chunks("chunk_zstd_of_120_MiB_of_zeros", lambda: wire.chunk(120 << 20, "zstd", wire.zstd_frame(120 << 20)))
chunks("chunk_lz4_of_1_GiB", lambda: wire.chunk(1 << 30, "lz4", wire.lz4_frame(0, 1 << 30)))
chunks("chunk_lz4_that_claims_1_EiB", lambda: wire.chunk(1 << 60, "lz4", wire.lz4_frame(0, 1 << 20)))
chunks("chunks_zstd_500", lambda: wire.chunk(64 << 20, "zstd", wire.zstd_frame(64 << 20)) * 500)
chunks("chunks_of_nothing_200000", lambda: wire.chunk(0, "", b"") * 200_000)
chunks("schemas_60000", lambda: b"".join(wire.schema(k, f"a/msg/T{k}", "int32 a\n" * 20) for k in range(1, 60_000)))
chunks(
    "channels_60000",
    lambda: wire.schema(1, STATES) + b"".join(wire.channel(k, 1, f"/t{k}") for k in range(1, 60_000)),
)
chunks(
    "channels_60000_with_messages",
    lambda: wire.schema(1, STATES)
    + b"".join(wire.channel(k, 1, f"/t{k}") + wire.message(k, k, wire.joint_state(k, ["a"])) for k in range(1, 60_000)),
)
chunks("channel_declared_100000_times", lambda: b"".join(wire.channel(1, 0, f"/t{k}") for k in range(100_000)))
chunks("channel_with_1000000_pairs", lambda: wire.channel(1, 0, "/a", (wire.text("k") + wire.text("v")) * 1_000_000))
chunks("metadata_100000", lambda: wire.record(0x0C, wire.text("a") + wire.text(wire.text("k") + wire.text("v"))) * 100_000)
chunks("record_of_claimed_length", lambda: b"\x05" + struct.pack("<Q", 2**62) + bytes(100))
chunks("zeros_50_MB", lambda: bytes(50_000_000))
chunks(
    "messages_at_all_times",
    lambda: wire.schema(1, STATES)
    + wire.channel(1, 1, "/joint_states")
    + b"".join(wire.message(1, (k * 2_654_435_761) % 9_000_000_000, b"") for k in range(1_000_000)),
)


@attack
def attachments_100000(folder):
    body = struct.pack("<QQ", 0, 0) + wire.text("robot.toml") + wire.text("a") + struct.pack("<QI", 0, 0)
    content = wire.START + wire.record(9, body) * 100_000 + wire.END
    return ["replay", write(folder, "a.mcap", content), "--save", folder / "a.rrd"]


@attack
def index_of_overlapping_chunks(folder):
    index = struct.pack("<QQQQ", 0, 2**63, 8, 2**40) + wire.text(b"") + struct.pack("<Q", 0) + wire.text("zstd")
    content = wire.START + wire.record(8, index + struct.pack("<QQ", 1, 1)) * 200_000 + wire.END
    return ["inspect", write(folder, "a.mcap", content)]


# ROS 2 bags.

TOPICS = "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT,type TEXT,serialization_format TEXT,offered_qos_profiles TEXT)"
MESSAGES = "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER,timestamp INTEGER,data BLOB)"


def bag(folder, tables=(TOPICS, MESSAGES), rows=(), page=4096):
    path = folder / "a.db3"
    with sqlite3.connect(path) as connection:
        connection.execute(f"PRAGMA page_size={page}")
        for sql in tables:
            connection.execute(sql)
        connection.execute("INSERT INTO topics VALUES(1,'/joint_states',?,'cdr','')", [STATES])
        connection.executemany("INSERT INTO messages(topic_id,timestamp,data) VALUES(1,?,?)", rows)
    connection.close()
    return path


@attack
def bag_with_a_long_comment(folder):
    return ["inspect", bag(folder, [TOPICS, MESSAGES[:-1] + " /*" + "-- " * 310_000 + "*/)"])]


@attack
def bag_with_many_comments(folder):
    return ["inspect", bag(folder, [TOPICS, MESSAGES[:-1] + "/**/" * 230_000 + ")"])]


@attack
def bag_with_many_dashes(folder):
    return ["inspect", bag(folder, [TOPICS, MESSAGES[:-1] + "--\n" * 300_000 + ")"])]


@attack
def bag_with_2000_columns(folder):
    return ["inspect", bag(folder, [TOPICS, MESSAGES[:-1] + "".join(f",c{k}" for k in range(1_900)) + ")"])]


@attack
def bag_with_20000_tables(folder):
    return ["inspect", bag(folder, [TOPICS, MESSAGES, *[f"CREATE TABLE t{k}(a,b,c)" for k in range(5_000)]])]


@attack
def bag_of_small_pages(folder):
    data = wire.joint_state(1, wire.JOINTS)
    return ["inspect", bag(folder, rows=[(k, data) for k in range(100_000)], page=512)]


@attack
def bag_whose_pages_name_each_other(folder):
    path = bag(folder, rows=[(k, bytes(3_000)) for k in range(5_000)], page=1024)
    content = bytearray(path.read_bytes())
    path.unlink()
    for at in range(1024, len(content), 1024):
        content[at : at + 4] = struct.pack(">I", 3) if content[at] not in (2, 5, 10, 13) else content[at : at + 4]
    return ["inspect", write(folder, "b.db3", bytes(content))]


@attack
def bag_whose_rows_claim_gigabytes(folder):
    path = bag(folder, rows=[(k, bytes(3_000)) for k in range(5_000)], page=1024)
    content = path.read_bytes()
    path.unlink()
    return ["inspect", write(folder, "b.db3", content.replace(wire.varint(3_012), b"\xff\x7f"))]


@attack
def bag_compressed_by_zstd(folder):
    return ["inspect", write(folder, "a.db3.zstd", wire.zstd_frame(4 << 30))]


@attack
def bag_with_a_log_of_zeros(folder):
    path = bag(folder)
    write(folder, "a.db3-wal", struct.pack(">II", 0x377F0682, 3_007_000) + bytes(30_000_000))
    return ["inspect", path]


# Meshes.


def mesh(name, ending, content):
    """A mesh that an obstacle of a scene names."""

    def of(folder):
        write(folder, f"a.{ending}", content())
        scene = f'[[obstacle]]\nname = "a"\nshape = "mesh"\nfile = "a.{ending}"\nscale_m = 1.0\nposition_m = [9.0, 9.0, 9.0]\n'
        routine = (ROOT / "routines/titan4-quickstart.toml").read_text()
        routine = routine.replace('"../', f'"{ROOT}/')
        return ["check", write(folder, "routine.toml", routine + "\n" + scene)]

    of.__name__ = name
    return attack(of)


def collada(primitives, numbers="0 0 0 1 0 0 0 1 0 0 0 1"):
    return (
        '<COLLADA><library_geometries><geometry id="g"><mesh><source id="p"><float_array id="f">'
        f'{numbers}</float_array></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
        f"{primitives}</mesh></geometry></library_geometries></COLLADA>"
    )


VERTEX = '<input semantic="VERTEX" source="#v" offset="0"/>'
POINTS = " ".join(f"{k % 97} {k % 89} {k % 83}" for k in range(30_000))
mesh("dae_one_long_strip", "dae", lambda: collada(f"<tristrips>{VERTEX}<p>{'0 1 2 3 ' * 7_500_000}</p></tristrips>"))
mesh("dae_one_long_fan", "dae", lambda: collada(f"<trifans>{VERTEX}<p>{'0 1 2 3 ' * 7_500_000}</p></trifans>"))
mesh("dae_long_triangles", "dae", lambda: collada(f"<triangles>{VERTEX}<p>{'0 1 2 ' * 10_000_000}</p></triangles>"))
mesh(
    "dae_long_polylist",
    "dae",
    lambda: collada(f"<polylist>{VERTEX}<vcount>{'3 ' * 9_000_000}</vcount><p>{'0 1 2 ' * 9_000_000}</p></polylist>"),
)
mesh("dae_counts_without_corners", "dae", lambda: collada(f"<polylist>{VERTEX}<vcount>{'0 ' * 30_000_000}</vcount><p/></polylist>"))
mesh("dae_20000_empty_primitives", "dae", lambda: collada(f"<triangles>{VERTEX}</triangles>" * 20_000, POINTS))
mesh("dae_20000_empty_lists", "dae", lambda: collada(f"<polygons>{VERTEX}{'<p/>' * 190_000}</polygons>", POINTS))
mesh(
    "dae_10000_instances_of_nothing",
    "dae",
    lambda: collada("", POINTS).replace(
        "</COLLADA>",
        '<library_visual_scenes><visual_scene id="s"><node>'
        + '<instance_geometry url="#g"/>' * 9_000
        + "</node></visual_scene></library_visual_scenes></COLLADA>",
    ),
)
mesh("dae_instances_multiplied", "dae", lambda: nodes_that_multiply())
mesh("dae_with_3000000_words_of_text", "dae", lambda: collada("", "0 " * 30_000_000))
mesh("dae_of_200000_elements", "dae", lambda: "<COLLADA>" + '<a id="b" c="d"/>' * 199_000 + "</COLLADA>")
mesh("stl_that_claims_a_lot", "stl", lambda: bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(1_000))
mesh("stl_of_1000000_triangles", "stl", lambda: binary_stl(999_999))
mesh("stl_text_of_20_MB", "stl", lambda: "solid a\n" + "vertex 0 0 0\n" * 1_500_000)
mesh("stl_text_of_one_line", "stl", lambda: "solid a\n" + "vertex " * 8_000_000)
mesh("obj_face_of_1000000", "obj", lambda: "v 0 0 0\nv 1 0 0\nv 0 1 0\nf " + "1 2 3 " * 333_333)
mesh("obj_face_of_10000000", "obj", lambda: "v 0 0 0\nv 1 0 0\nv 0 1 0\nf " + "1 2 3 " * 10_000_000)
mesh("obj_of_3000000_vertices", "obj", lambda: "v 0 0 0\n" * 3_000_000)


def nodes_that_multiply():
    inner = "".join(f'<node id="n{k}">' + f'<instance_node url="#n{k + 1}"/>' * 10 + "</node>" for k in range(20))
    scene = f'<library_visual_scenes><visual_scene id="s">{inner}<node id="n20"/></visual_scene></library_visual_scenes>'
    return collada("").replace("</COLLADA>", scene + "</COLLADA>")


def binary_stl(n):
    """Triangles that share no corner."""
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, k, 0, 0, k, 1, 0, k, 0, 1, 0) for k in range(n))
    return bytes(80) + struct.pack("<I", n) + facets


# Tables.

COLUMNS = ",".join([*wire.JOINTS, "x", "y", "z", "rx", "ry", "rz"])


def table(name, content, ending="csv", command="calibrate"):
    def of(folder):
        path = write(folder, f"a.{ending}", content())
        board = 'name = "board"\nposition_m = [1.0, 0.0, 0.0]\nquaternion_wxyz = [1.0, 0.0, 0.0, 0.0]\n'
        tags = write(folder, "tags.toml", 'version = 1\nkind = "tag_map"\nframe = "base_link"\n[[tag]]\n' + board)
        return ["inspect", path] if command == "inspect" else [*calibrate(folder, path, TABLE_MAP), "--tag-map", tags]

    of.__name__ = name
    return attack(of)


for reader in ("calibrate", "inspect"):
    table(f"csv_line_of_66_MB_of_commas_{reader}", lambda: COLUMNS + "\n" + "," * 66_000_000, command=reader)
    table(f"csv_head_of_60_MB_of_commas_{reader}", lambda: COLUMNS + "," * 60_000_000 + "\n1,2\n", command=reader)
    table(
        f"csv_of_1000000_columns_{reader}",
        lambda: COLUMNS + "".join(f",c{k}" for k in range(1_000_000)) + "\n" + "1," * 1_000_011 + "1\n",
        command=reader,
    )
    table(f"csv_quoted_field_of_60_MB_{reader}", lambda: COLUMNS + '\n"' + "a\n" * 30_000_000, command=reader)
    table(f"csv_quotes_{reader}", lambda: COLUMNS + "\n" + '"' * 60_000_000, command=reader)
    table(f"csv_rows_of_nothing_{reader}", lambda: COLUMNS + "\n" * 60_000_000, command=reader)
    table(f"csv_comments_{reader}", lambda: "#\n" * 30_000_000 + COLUMNS + "\n", command=reader)
    table(f"csv_rows_100000_of_60_cells_{reader}", lambda: COLUMNS + ",a" * 40 + "\n" + ("1," * 51 + "1\n") * 99_000, command=reader)
    table(f"yaml_deep_{reader}", lambda: "[" * 1_000_000, "yaml", reader)
    table(f"yaml_deep_by_indent_{reader}", lambda: "".join(" " * k + "a:\n" for k in range(3_000)), "yaml", reader)
    table(f"yaml_of_8_MB_of_zeros_{reader}", lambda: "[" + "0," * 4_000_000 + "0]", "yaml", reader)
    table(f"yaml_of_rows_of_one_{reader}", lambda: "[" + "[0]," * 1_000_000 + "[0]]", "json", reader)
    table(f"yaml_keys_{reader}", lambda: "".join(f"k{k}: 0\n" for k in range(500_000)), "yaml", reader)
    table(
        f"yaml_aliases_{reader}",
        lambda: "a0: &a0 [1,1,1,1,1,1,1,1,1,1]\n"
        + "".join(f"a{k}: &a{k} [{','.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 10)),
        "yaml",
        reader,
    )
    table(f"yaml_nested_rows_{reader}", lambda: "[" + ("[" * 20 + "0" + "]" * 20 + ",") * 150_000 + "0]", "yaml", reader)
    table(f"yaml_names_of_1_kB_{reader}", lambda: ("? " + "a" * 1_000 + "\n: {") + "b: {" * 20 + "c: 1" + "}" * 21, "yaml", reader)


@attack
def motion_of_one_line(folder):
    write(folder, "a.csv", "time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad" + "," * 60_000_000)
    routine = (ROOT / "routines/titan4-quickstart.toml").read_text().replace('"../', f'"{ROOT}/')
    motion = '[world.vehicle]\nmotion = "recorded"\nmotion_file = "a.csv"\n'
    return ["check", write(folder, "routine.toml", routine + "\n" + motion)]


@attack
def campaign_of_one_line(folder):
    head = (ROOT / "fuzz/corpus/campaign_table/rows.csv").read_text().splitlines()[0]
    write(folder, "rows.csv", head + "," * 60_000_000)
    return ["campaign", "--merge", folder / "rows.csv", "--out", folder / "out.csv"]


# Texts.


def text_file(name, file, content, command="check"):
    def of(folder):
        return [command, write(folder, file, content())]

    of.__name__ = name
    return attack(of)


TAG = "[[tag]]\nid = {}\nsize_m = 0.1\nposition_m = [0.0, 0.0, 1.0]\nquaternion_wxyz = [1.0, 0.0, 0.0, 0.0]\n"
text_file("toml_deep_lists", "a.toml", lambda: "version = 1\na = " + "[" * 4_000_000)
text_file("toml_deep_tables", "a.toml", lambda: "version = 1\na = " + "{b=" * 1_000_000)
text_file("toml_deep_keys", "a.toml", lambda: "version = 1\n" + "a." * 2_000_000 + "b = 1")
text_file("toml_many_keys", "a.toml", lambda: "version = 1\n" + "".join(f"k{k} = 1\n" for k in range(500_000)))
text_file("toml_many_deep_keys", "a.toml", lambda: "version = 1\n" + "".join("a." * 70 + f"k{k} = 1\n" for k in range(50_000)))
text_file("toml_many_tables", "a.toml", lambda: "version = 1\n" + "".join(f"[a{k}]\n" for k in range(700_000)))
text_file("tag_map_of_60000", "a.toml", lambda: 'version = 1\nkind = "tag_map"\nframe = "a"\n' + "".join(TAG.format(k) for k in range(60_000)))
text_file("tag_map_of_100000_short", "a.toml", lambda: 'version = 1\nkind = "tag_map"\nframe = "a"\n' + "[[tag]]\nid=0\n" * 500_000)
text_file("tag_map_of_one_name", "a.toml", lambda: 'version = 1\nkind = "tag_map"\nframe = "a"\n' + TAG.format(7) * 5_000)
text_file("task_of_targets", "a.toml", lambda: "version = 1\nkind = \"task\"\ntolerance_m = 0.02\ntargets_m = [" + "[0,0,0]," * 900_000 + "]")
text_file(
    "calibration_of_joints",
    "calibration.toml",
    lambda: (ROOT / "recordings/sample/calibration.toml").read_text() + '[[joint]]\njoint = "a"\n' * 200_000,
)
text_file("compact_of_8_MB", "a.txt", lambda: "armcal1 " + "a" * 8_000_000)


@attack
def covariance_of_claimed_size(folder):
    sample = ROOT / "recordings/sample"
    covariance = (sample / "calibration.covariance.toml").read_text()
    names = ", ".join(f'"p{k}"' for k in range(400_000))
    head = covariance.index("parameters = [") + len("parameters = [")
    write(folder, "calibration.covariance.toml", covariance[:head] + names + ", " + covariance[head:])
    return ["export", write(folder, "calibration.toml", (sample / "calibration.toml").read_text()), "--as", "ros-parameters"]


def urdf(name, content):
    def of(folder):
        made = robot(folder, "titan4")
        write(made, "titan4.urdf", content((made / "titan4.urdf").read_text()))
        return ["check", made]

    of.__name__ = name
    return attack(of)


def before_end(text, more):
    return text.replace("</robot>", more + "</robot>")


def links(n, parent):
    """Links in a chain (`parent` is the one before) or a fan."""
    return "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="fixed"><parent link="{parent(k)}"/><child link="l{k}"/></joint>'
        for k in range(n)
    )


urdf("urdf_100000_links", lambda text: before_end(text, links(60_000, lambda k: "base_link")))
urdf("urdf_2400_links_in_a_fan", lambda text: before_end(text, links(2_400, lambda k: "base_link")))
urdf("urdf_2400_links_in_a_chain", lambda text: before_end(text, links(2_400, lambda k: f"l{k - 1}" if k else "base_link")))
urdf("urdf_12000_links_in_a_fan", lambda text: before_end(text, links(12_000, lambda k: "base_link")))
urdf("urdf_12000_links_in_a_chain", lambda text: before_end(text, links(12_000, lambda k: f"l{k - 1}" if k else "base_link")))
urdf("urdf_chains_of_190", lambda text: before_end(text, links(990, lambda k: f"l{k - 1}" if k % 190 else "base_link")))
urdf("urdf_2400_links_in_a_circle", lambda text: before_end(text, links(2_400, lambda k: f"l{(k + 1) % 2400}")))
urdf("urdf_nested", lambda text: before_end(text, "<a>" * 500_000))
urdf("urdf_8_MB_of_text", lambda text: before_end(text, "<a>" + "b" * 7_900_000 + "</a>"))
urdf("urdf_comments", lambda text: before_end(text, "<!---->" * 1_000_000))
urdf("urdf_entities", lambda text: before_end(text, "<a b='" + "&lt;" * 1_900_000 + "'/>"))
urdf("urdf_attributes", lambda text: before_end(text, "<a " + " ".join(f'b{k}="1"' for k in range(400_000)) + "/>"))
urdf(
    "urdf_shapes",
    lambda text: before_end(
        text,
        '<link name="many">' + '<collision><geometry><box size="1 1 1"/></geometry></collision>' * 2_900 + "</link>"
        '<joint name="jm" type="fixed"><parent link="base_link"/><child link="many"/></joint>',
    ),
)


@attack
def urdf_of_12000_links_as_a_new_robot(folder):
    text = before_end((ROOT / "robots/titan4/titan4.urdf").read_text(), links(12_000, lambda k: "base_link"))
    return ["new-robot", write(folder, "a.urdf", text), "--out", folder / "made"]


@attack
def urdf_of_a_long_arm_with_leaves_as_a_new_robot(folder):
    """The chain of 190, all others at its end."""
    made = links(990, lambda k: f"l{min(k, 190) - 1}" if k else "base_link").replace("fixed", "continuous")
    text = before_end((ROOT / "robots/titan4/titan4.urdf").read_text(), made)
    return ["new-robot", write(folder, "a.urdf", text), "--out", folder / "made"]


def yaml(name, content):
    def of(folder):
        recording = write(folder, "a.mcap", wire.mcap([joints()]))
        arguments = ["--camera", write(folder, "cameras.yaml", content()), "--tags", write(folder, "tags.yaml", content())]
        return ["tagmap", recording, *arguments]

    of.__name__ = name
    return attack(of)


yaml("yaml_tags_deep", lambda: "tags: " + "[" * 2_000_000)
yaml("yaml_tags_of_8_MB", lambda: "bodies:\n" + "  - a: {b: 1}\n" * 500_000)
yaml(
    "yaml_tags_aliases",
    lambda: "a0: &a0 [1,1,1,1,1,1,1,1,1,1]\n"
    + "".join(f"a{k}: &a{k} [{','.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 10)),
)

"""Structure of the estimator's sources: one table of figures with their limits, read from the sources alone.

    python3 benches/structure.py [ROOT] [--list]

ROOT: the root of the repository, by default the working folder. --list: below the table, the places behind each figure. Product code is
what remains without `#[cfg(test)]` items, modules declared under `#[cfg(test)]`, and files and folders with a test's name. A script of
names knows less than a compiler: where a design renames what the tables below name, rename it there too, or its figure falls for nothing.

lines        lines of src/belief and src/paper with product code: not blank, not comment alone, not of a `use` statement.
constants    numbers that decide in belief: constants with a number, numbers in comparisons other than ORDINARY, numbers of defaults.
block        files of belief that list blocks of parameters by hand: the mounts of further cameras beside the others, or three
             variants of `Block` in one function.
corner       files of src/core and src/belief that name the pixels of a tag's four corners.
carriers     structs and enums of those folders that hold these pixels, formats of messages aside.
projections  functions of belief that ask a lens for the Jacobian of its projection, or difference its pixels.
events       rooms of the product with a text that says that a sensor, camera or tag slipped, moved or failed, or an offset walks.
circles      groups of rooms of belief that import each other.
"""

import argparse
import re
from collections import defaultdict
from pathlib import Path

LIMITS = {"lines": 28_500, "constants": 200, "constants outside of tables": 0, "block": 2, "corner": 12, "carriers": 3,
          "projections": 1, "events": 1, "circles": 0}
TEST_NAME = re.compile(r"/(tests?|fixtures?)(/|\.rs$)|_tests\.rs$")
TABLE_NAME = re.compile(r"/constants\.rs$")  # One table for each room.
# A block of parameters that is listed by hand: as a field beside the others, or as one of several variants.
BLOCK_FIELD = re.compile(r"\bfurther_mounts\b")
BLOCK = re.compile(r"\b(?:Block|Self)::(Mount|Clock|Lens|Tag|GripperTag)\b")
FOUR_PIXELS = r"\[\[f64; 2\]; 4\]|\[(?:Vector2<f64>|Point2<f64>|Pixel\w*|Point); 4\]"
CORNER = re.compile(rf"\bcorners_px\b|{FOUR_PIXELS}")
CORNER_OTHERWISE = re.compile(rf"\bcorners_px\b|{FOUR_PIXELS}|\bMeanCorners\b|\b(?:Raw|Tag|Weighted)Measurement::Corners\b|\bTagCorners\b")
NO_TAG = ("DetectionReject",)  # Its corners are of what was not taken for a tag.
MESSAGES = "src/core/log/messages/"
JACOBIAN = re.compile(r"\b(?:project\w*_with_jacobian|image_jacobian)\s*\(")
PROJECT = re.compile(r"\.project\w*\(")
STEP = re.compile(r"\b(?:step|eps|epsilon|delta)\w*\b")
EVENT = re.compile(r"\b(?<!no )(?:sensor|camera|tags?|offset)\b[^.,;:?]{0,40}\b(?:slipped|moved|failed|walks|walked)\b")
NOT_THE_PRODUCT = ("src/lab/", "src/sim/", "src/replay/fault_words.rs")  # They make the events, or word the truth of one.
ORDINARY = (0.0, 1.0, 2.0, 0.5)
NUMBER = re.compile(r"(?<![\w.])(\d[\d_]*(?:\.(?!\.)[\d_]*)?(?:e[+-]?\d+)?)(?:_?[fiu](?:8|16|32|64|size))?(?![\w.])")
COMPARISON = re.compile(r"\s(?:<|>|<=|>=|==|!=)\s")
NO_LIMIT = re.compile(r"\[[^\[\]]*\]|\b(?:powi|powf|pow|nth|get)\([^()]*\)|\b(?:k|row|axis) < \d+")  # Indices, exponents.
CONSTANT = re.compile(r"^([ \t]*)(?:pub(?:\([^)]*\))?\s+)?(?:const|static)\s+([A-Z]\w*)\s*:\s*([^=;]*(?:;[^=;]*)?)=([^;]*)", re.M)
SCALAR = re.compile(r"(?:[fiu]\d+|usize)\s*$")
DEFAULTS = re.compile(r"default|datasheet")


TOKEN = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/)|(?P<raw>b?r(?P<hash>\#*)".*?"(?P=hash))|(?P<text>b?"(?:\\.|[^"\\])*")"""
    r"""|(?P<char>b?'(?:\\(?:u\{\w+\}|x\w\w|.)|[^'\\\n])')""", re.S)
VISIBLE = r"(?:pub(?:\([^)]*\))?\s+)?"
ITEM = re.compile(rf"(?:\s*#\[[^\]]*\])*\s*{VISIBLE}(?:(?:unsafe|async|const)\s+)*(?:fn|mod|impl|struct|enum|use|const|static|type|trait)\b")
TEST_ITEM = re.compile(r"#\[cfg\((?:all\()?test\b[^\]]*\]")
USE = re.compile(rf"^[ \t]*{VISIBLE}use\s+([^;]*);", re.M)
PATH = re.compile(r"\b(?:crate|super)(?:::\w+)+")


def blanked(text, fill=" "):
    return re.sub(r"[^\n]", fill, text)


def end_of_item(code, start):
    """Where the item, field or arm that begins at `start` ends: behind its brace, semicolon or comma."""
    depth, item = 0, ITEM.match(code, start)
    for at in range(item.end() if item else start, len(code)):
        c = code[at]
        depth += (c in "([{") - (c in ")]}")
        if depth < 0:
            return at
        if depth == 0 and (c in ";}" or (c == "," and not item)):
            return at + 1
    return len(code)


class Source:
    """One file: its product code without comments and with blanked texts, the same without imports, and its texts by position."""

    def __init__(self, root, path):
        self.name = path.relative_to(root).as_posix()
        self.raw = path.read_text(encoding="utf-8")
        texts = []

        def replaced(match):
            if match["comment"]:
                return blanked(match[0])
            if not match["char"]:
                texts.append((match.start(), " ".join(match[0].split())))
            return '"' + blanked(match[0][1:-1], "~") + '"'

        code = TOKEN.sub(replaced, self.raw)
        self.test_modules = re.findall(rf"{TEST_ITEM.pattern}\s*{VISIBLE}mod\s+(\w+)\s*;", code)
        for match in TEST_ITEM.finditer(code):
            end = end_of_item(code, match.end())
            code = code[: match.start()] + blanked(code[match.start() : end]) + code[end:]
        self.code = code
        self.body = USE.sub(lambda match: blanked(match[0]), code)
        self.texts = [(at, text) for at, text in texts if code[at] == '"']
        self.module = re.sub(r"/(mod|lib|main)$", "", self.name.removesuffix(".rs"))
        self.place = self.module.split("/")[2:]  # Module path below the root of a crate src/NAME.

    def line(self, at):
        return f"{self.name}:{self.code.count(chr(10), 0, at) + 1}"

    def functions(self):
        """(name, start, end) of each function."""
        return [(m[1], m.start(), end_of_item(self.code, m.start())) for m in re.finditer(r"\bfn\s+(\w+)", self.code)]

    def room(self):
        """Folder that the file belongs to: the first of belief, of other crates the crate."""
        parts = self.name.split("/")[1:-1] or ["(root)"]
        return "/".join(parts[: 2 if parts[0] == "belief" else 1])


def product(root):
    """All sources without those of tests."""
    sources = [Source(root, path) for path in sorted((root / "src").rglob("*.rs"))]
    tests = tuple(f"{source.module}/{name}/" for source in sources for name in source.test_modules)
    return [s for s in sources if not TEST_NAME.search(s.name) and not f"{s.module}/".startswith(tests)]


# From here on figures, as (name, value, places).


def lines(sources):
    def filled(text):
        return sum(1 for line in text.splitlines() if line.strip())

    rooms = defaultdict(int)
    for source in sources:
        rooms[source.room()] += filled(source.body)
    return [("lines", sum(rooms.values()), [f"{n:6} {name}" for name, n in sorted(rooms.items())]),
            ("  with `use` statements", sum(filled(s.code) for s in sources), []),
            ("  with these, comments, blank lines and tests within", sum(len(s.raw.splitlines()) for s in sources), [])]


def compared_numbers(source):
    """Positions of the numbers in conditions that compare, but not with a count of elements."""
    body = NO_LIMIT.sub(lambda match: blanked(match[0]), source.body)
    for part in re.finditer(r"(?:[^;{},|&=]|(?<!&)&(?!&)|(?<!\|)\|(?!\|)|=(?!>))+", body):
        if COMPARISON.search(part[0]) and ".len()" not in part[0]:
            numbers = NUMBER.finditer(part[0])
            yield from (part.start() + n.start() for n in numbers if float(n[1].replace("_", "")) not in ORDINARY)


def default_numbers(source):
    """Positions of the numbers that functions of defaults give to fields."""
    for name, start, end in source.functions():
        if DEFAULTS.match(name):
            fields = re.finditer(rf"\b\w+:\s*-?(?={NUMBER.pattern})", source.code[start:end])
            yield from (start + field.start() for field in fields)


def constants(sources):
    inside, outside, scalars = [], [], 0
    for source in sources:
        named = [match for match in CONSTANT.finditer(source.body) if NUMBER.search(match[4])]
        kinds = {at: "compared" for at in compared_numbers(source)} | {at: "default" for at in default_numbers(source)}
        kinds = {at: kind for at, kind in kinds.items() if not any(m.start() <= at < m.end() for m in named)}
        kinds |= {m.start(2): f"const {m[2]}" for m in named}
        places = inside if TABLE_NAME.search(source.name) else outside
        places += [f"{source.line(at)} {kind}" for at, kind in sorted(kinds.items())]
        scalars += sum(1 for m in named if not m[1] and SCALAR.match(m[3]))
    files = len({place.split(":")[0] for place in inside + outside})
    return [("constants", len(inside + outside), inside), ("constants outside of tables", len(outside), outside),
            ("  single numbers that a module names", scalars, []), ("  files that have constants", files, [])]


def files_naming(name, sources, pattern):
    found = [(source, pattern.findall(source.body)) for source in sources]
    return name, sum(1 for _, hits in found if hits), [f"{s.name}: {len(hits)} times, first {hits[0]}" for s, hits in found if hits]


def listing_blocks(sources):
    found = {}
    for source in sources:
        lists = [sorted(set(BLOCK.findall(source.body[start:end]))) for _, start, end in source.functions()]
        longest = max(lists, key=len, default=[]) + BLOCK_FIELD.findall(source.body)[:1]
        if len(longest) > 2 or "further_mounts" in longest:
            found[source.name] = ", ".join(longest)
    return "block", len(found), [f"{name}: {kinds}" for name, kinds in found.items()]


def carriers(sources):
    places, formats = [], 0
    for source in sources:
        for match in re.finditer(r"\b(?:struct|enum)\s+(\w+)", source.body):
            item = source.body[match.start() : end_of_item(source.body, match.start())]
            if re.search(FOUR_PIXELS, item) and match[1] not in NO_TAG:
                formats += source.name.startswith(MESSAGES)
                places += [] if source.name.startswith(MESSAGES) else [f"{source.line(match.start())} {match[1]}"]
    return [("carriers", len(places), places), ("  formats of messages that do too", formats, [])]


def projections(sources):
    places = {}
    for source in sources:
        functions = source.functions()
        hits = [match.start() for match in JACOBIAN.finditer(source.body)]
        for _, start, end in functions:
            differs = STEP.search(source.code, start, end) and len(PROJECT.findall(source.code, start, end)) > 1
            hits += [PROJECT.search(source.code, start, end).start()] if differs else []
        for at in hits:
            start, name = max((start, name) for name, start, end in functions if start <= at < end)
            places.setdefault((source.name, start), f"{source.line(at)} fn {name}")
    return [("projections", len(places), sorted(places.values()))]


def events(sources):
    rooms = defaultdict(list)
    for source in sources:
        rooms[source.room()] += [f"  {source.line(at)} {text}" for at, text in source.texts if EVENT.search(text)]
    told = {name: places for name, places in sorted(rooms.items()) if places}
    return [("events", len(told), [line for name, places in told.items() for line in (name, *places)])]


def use_paths(tree):
    """Paths of a use tree: `a::{b, c as d}` has `a::b` and `a::c as d`."""
    def spread(match):
        return ",".join(match[1] + part.strip() for part in match[2].split(",") if part.strip())

    while "{" in tree:
        tree = re.sub(r"([\w:]*)\{([^{}]*)\}", spread, tree)
    return [path.strip() for path in tree.split(",")]


def imports(source):
    """(position, path below the crate's root) of what a source names."""
    named = [(use.start(1), path) for use in USE.finditer(source.code) for path in use_paths(use[1])]
    named += [(match.start(), match[0]) for match in PATH.finditer(source.body)]
    for at, text in named:
        path, base = text.split(" as ")[0].split("::"), list(source.place)
        if path[0] in ("crate", "super"):
            base = [] if path[0] == "crate" else base
            while path and path[0] in ("crate", "super"):
                base = base[:-1] if path.pop(0) == "super" else base
            yield at, base + path


def handed_on(sources, folder):
    """Module by name of what the folder's own module re-exports."""
    trees = [use[1] for s in sources if s.place == folder for use in USE.finditer(s.code)]
    paths = [path for tree in trees for path in use_paths(tree) if not path.startswith(("crate", "super", "std"))]
    return {re.split(r"::| as ", path)[-1]: path.removeprefix("self::").split("::")[0] for path in paths}


def edges(sources, folders_alone):
    """{(from, to): lines} among the rooms."""
    found, exports = defaultdict(set), handed_on(sources, [])
    inside = [s for s in sources if s.place]
    rooms = {s.place[0] for s in inside if not folders_alone or s.name.count("/") > 2}
    for source in inside:
        for at, path in imports(source):
            if path:
                ends = source.place[0], exports.get(path[0], path[0])
                if ends[0] != ends[1] and rooms.issuperset(ends):
                    found[ends].add(source.line(at))
    return found


def circles_of(pairs):
    """Strongly connected groups of more than one room."""
    reached = {a: {a} for pair in pairs for a in pair}
    for _ in reached:
        for a, b in pairs:
            reached[a] |= reached[b]
    return {group for a in reached if len(group := frozenset(b for b in reached[a] if a in reached[b])) > 1}


def circles(name, sources, folders_alone):
    places, found = [], edges(sources, folders_alone)
    groups = sorted(circles_of(found), key=sorted)
    for group in groups:
        places.append(", ".join(sorted(group)))
        within = sorted((ends, sorted(at)) for ends, at in found.items() if group.issuperset(ends))
        places += [f"  {a} -> {b}: {len(at)}, {' '.join(at[:6])}" for (a, b), at in within]
    return name, len(groups), places


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", nargs="?", type=Path, default=Path())
    parser.add_argument("--list", action="store_true", help="the places behind each figure")
    options = parser.parse_args()
    if not (options.root / "src/belief").is_dir():
        parser.error(f"{options.root} has no src/belief: give the root of the repository")
    everything = product(options.root)
    belief, estimators, passed = ([s for s in everything if s.name.startswith(folders)] for folders in (
        "src/belief/", ("src/belief/", "src/paper/"), ("src/core/", "src/belief/")))
    figures = [
        *lines(estimators), *constants(belief),
        listing_blocks(belief), files_naming("  files that name any", belief, BLOCK),
        files_naming("corner", passed, CORNER), files_naming("  files with any name of its data", passed, CORNER_OTHERWISE),
        *carriers(passed), *projections(belief), *events(s for s in everything if not s.name.startswith(NOT_THE_PRODUCT)),
        circles("circles", belief, True), circles("  with single files as rooms too", belief, False),
    ]
    print(f"{'figure':54} {'value':>7} {'limit':>7}")
    for name, number, _ in figures:
        print(f"{name:54} {number:7} {LIMITS.get(name, ''):>7}")
    for name, _, places in figures if options.list else []:
        if places:
            print("\n".join([f"\n{name.strip()}", *(f"  {place}" for place in places)]))


if __name__ == "__main__":
    main()

"""The committed JSON Schemas by an independent validator: every TOML file of the repository, and falsified ones.

    schemas.py ARMCAL      (needs jsonschema, see requirements.txt)

Every file that states a kind must be valid. Then each kind's first files are falsified, one key at a time: a needed key is left out, an
unknown one put in, a number is put beyond its range, a word or a type is none of the allowed ones. Validator and `armcal check` must
both refuse each. The falsified files go to tests/golden/falsified-files.csv, which a test gives to `armcal check`.
"""

import copy
import csv
import json
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from jsonschema import Draft7Validator

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "tests/golden/falsified-files.csv"
SCHEMAS = {path.stem: json.loads(path.read_text()) for path in sorted((ROOT / "src/core/schemas").glob("*.json"))}
FOLDERS = ("robots", "routines", "tests/cases", "recordings/sample")
FALSIFIED = {"robot": 3, "vehicle": 2, "routine": 3, "task": 1, "input": 2, "tag_map": 1}
PER_FILE = 24


def toml_of(value):
    """An inline TOML value."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml_of(below)}" for key, below in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_of, value)) + "]"
    return json.dumps(value) if isinstance(value, str) else repr(value)


def text_of(table):
    return "".join(f"{json.dumps(key)} = {toml_of(value)}\n" for key, value in table.items())


def followed(schema, root):
    while reference := schema.get("$ref") or schema.get("allOf", [{}])[0].get("$ref"):
        schema = root["definitions"][reference.rsplit("/", 1)[1]]
    return schema


def chosen(schema, value, root):
    """The kind of table that `value` is, where the schema has several."""
    kinds = [followed(kind, root) for kind in schema.get("oneOf", [])]
    return next((kind for kind in kinds if Draft7Validator({**kind, "definitions": root["definitions"]}).is_valid(value)), schema)


def wrong_values(schema):
    for key, beyond in (("minimum", -1), ("maximum", 1)):
        if (limit := schema.get(key)) is not None:
            step = max(1, abs(limit))
            yield limit + beyond * (int(step) if schema["type"] == "integer" else float(step))
    if "enum" in schema or any("const" in one for one in schema.get("oneOf", [])):
        yield "none of these"
    yield {"number": "a text", "integer": 0.5, "string": 7, "boolean": 7, "array": "a text", "object": 7}.get(schema.get("type"), [7])


def falsifications(value, schema, root, path=()):
    """(path, value) of each; None leaves the key out."""
    schema = chosen(followed(schema, root), value, root)
    if isinstance(value, dict) and "properties" in schema:
        yield (*path, "no_such_key"), 1
        for key, below in value.items():
            if key == "kind" and not path:
                yield (key,), None
            if key in ("version", "kind", "do"):
                continue
            if key in schema.get("required", []):
                yield (*path, key), None
            of_key = schema["properties"].get(key, {})
            yield from ((((*path, key), wrong)) for wrong in wrong_values(followed(of_key, root)))
            yield from falsifications(below, of_key, root, (*path, key))
    elif isinstance(value, list) and value and isinstance(value[0], (dict, float, int)):
        yield from falsifications(value[0], schema.get("items", {}), root, (*path, 0))


def put(table, path, wrong):
    table = copy.deepcopy(table)
    place = table
    for step in path[:-1]:
        place = place[step]
    if wrong is None:
        del place[path[-1]]
    else:
        place[path[-1]] = wrong
    return table


def main(armcal):
    validators = {kind: Draft7Validator(schema) for kind, schema in SCHEMAS.items()}
    for schema in SCHEMAS.values():
        Draft7Validator.check_schema(schema)
    files = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.toml")):
            table = tomllib.loads(path.read_text())
            files[path.relative_to(ROOT)] = table
            problems = [f"{'.'.join(map(str, error.absolute_path))}: {error.message}" for error in validators[table["kind"]].iter_errors(table)]
            assert not problems, (path, problems)
    rows, both, seen = [], 0, set()
    with tempfile.TemporaryDirectory() as temp:
        for folder in FOLDERS:
            shutil.copytree(ROOT / folder, Path(temp) / folder)
        for kind, n_files in FALSIFIED.items():
            for name, table in [(name, table) for name, table in files.items() if table["kind"] == kind][:n_files]:
                root, n = SCHEMAS[kind], 0
                for path, wrong in falsifications(table, root, root):
                    at = ".".join("0" if isinstance(step, int) else step for step in path)
                    if n >= PER_FILE or (kind, at, wrong is None) in seen:
                        continue
                    falsified = put(table, path, wrong)
                    if validators[kind].is_valid(falsified):
                        continue
                    seen.add((kind, at, wrong is None))
                    file = Path(temp) / name
                    kept = file.read_text()
                    file.write_text(text_of(falsified))
                    checked = file.parent if kind == "robot" else file
                    code = subprocess.run([armcal, "check", str(checked)], capture_output=True, check=False).returncode
                    file.write_text(kept)
                    n += 1
                    both += code == 2
                    if code != 2:
                        print(f"{name}: {at} = {wrong!r}: check says {code}")
                    rows.append([str(name), at, "" if wrong is None else toml_of(wrong)])
    with GOLDEN.open("w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["file", "key", "value"])
        writer.writerows(rows)
    print(f"{len(files)} files are valid; of {len(rows)} falsified ones the validator refuses all and armcal check {both}")


if __name__ == "__main__":
    main(sys.argv[1])

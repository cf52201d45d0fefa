"""How often `armcal regress` cries wolf: each block of a stratum against the next one, the last against the first -> Markdown on stdout.

    alarms.py ARMCAL FOLDER [STRATUM ROUTINE]      (quickstart and its routine)

Blocks of one program differ by nothing but luck, with everything drawn anew: worlds, sensors, noise. Seeds are paired in their order.
More can change by chance here than after any change of the program, which keeps each seed's world.
"""

import csv
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path


def paired_with(block, seeds, out):
    """The block's rows under the seeds of another one."""
    with open(block) as file:
        reader = csv.DictReader(file)
        rows = sorted(reader, key=lambda row: int(row["seed"]))
    with open(out, "w", newline="") as file:
        writer = csv.DictWriter(file, reader.fieldnames, lineterminator="\n")
        writer.writeheader()
        writer.writerows(dict(row, seed=seed) for row, seed in zip(rows, seeds))


def seeds_of(block):
    with open(block) as file:
        return sorted(int(row["seed"]) for row in csv.DictReader(file))


def main(armcal, folder, stratum="quickstart", routine="routines/titan4-quickstart.toml"):
    blocks = [path for path in Path(folder).glob(f"{stratum}-*.csv") if not path.with_name(path.name + ".partial").exists()]
    blocks.sort(key=lambda path: int(path.stem.rsplit("-", 1)[1]))
    print("| block | against | verdict | what |\n|--:|--:|---|---|")
    alarms = 0
    for was, now in zip(blocks, blocks[1:] + blocks[:1]):
        with tempfile.TemporaryDirectory() as temp:
            for path in (was, was.with_name(was.stem + "-summary.json")):
                shutil.copy(path, temp)
            rows = Path(temp) / "rows.csv"
            paired_with(now, seeds_of(was), rows)
            words = [armcal, "regress", routine, "--baseline", Path(temp) / was.name, "--rows", rows, "--json"]
            comparison = json.loads(subprocess.run(words, capture_output=True, text=True, check=False).stdout)
        alarms += comparison["verdict"] == "worse"
        what = [f"{check['what']} {check['value']:.3g}" for check in comparison["checks"] if check["verdict"] != "not_worse"]
        print(f"| {now.stem} | {was.stem} | {comparison['verdict']} | {', '.join(what)} |")
    print(f"\n{alarms} of {len(blocks)} blocks are called worse.")


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Blocks out of the table of an earlier sitting, so that run.sh goes on behind them and summary.py counts them.

    unpack.py LOOPS.parquet FOLDER SHA256      (pip install duckdb==2.0.1)

SHA256: of the program that made them, as the page says; run.sh refuses another one. Blocks of fewer than 50 rows are left out, and what
is in FOLDER stays.
"""

import csv
import sys
from pathlib import Path

import duckdb

STRATA = Path(__file__).with_name("strata.txt")


def main(table, folder, sha256):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    program = folder / "program.sha256"
    if not program.exists():
        program.write_text(sha256 + "\n")
    firsts = {words[0]: int(words[1]) for words in map(str.split, STRATA.read_text().splitlines()) if words and words[0] != "#"}
    blocks = duckdb.execute("select * from read_parquet($1) order by stratum, seed", [table])
    names = [column[0] for column in blocks.description]
    by_block = {}
    for values in blocks.fetchall():
        row = dict(zip(names, values))
        stratum = row.pop("stratum")
        by_block.setdefault((stratum, (row["seed"] - firsts[stratum]) // 50 + 1), []).append(row)
    for (stratum, block), rows in by_block.items():
        out = folder / f"{stratum}-{block}.csv"
        if len(rows) < 50 or out.exists():
            continue
        keys = [key for key in rows[0] if any(row[key] is not None for row in rows)]
        with open(out, "w", newline="") as file:
            writer = csv.DictWriter(file, keys, extrasaction="ignore", lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        query = "copy (select * exclude (stratum) from read_parquet($1) where stratum = $2 and seed between $3 and $4) " \
                f"to '{out.with_suffix('.parquet')}' (format parquet, compression zstd)"
        first = firsts[stratum] + 50 * (block - 1)
        duckdb.execute(query, [table, stratum, first, first + 49])


if __name__ == "__main__":
    main(*sys.argv[1:])

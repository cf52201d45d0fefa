"""Runs docs/guide/clusters/queries.sql on Parquet files of campaigns, and holds its first answer against their CSVs.

Usage: python query_campaigns.py FILE.parquet ...   (each with its .csv beside it)
"""

import csv
import statistics
import sys
from pathlib import Path

import duckdb

QUERIES = Path(__file__).parents[2] / "docs/guide/clusters/queries.sql"


def from_csv(path):
    with open(path.with_suffix(".csv")) as file:
        rows = list(csv.DictReader(file))
    after = [1e3 * float(row["tool_error_after_median_m"]) for row in rows if row["tool_error_after_median_m"]]
    contacts = sum(float(row["contacts"] or 0) > 0 for row in rows)
    return len(rows), sum(row["status"] == "accepted" for row in rows), contacts, statistics.median(after)


def main(paths):
    connection = duckdb.connect()
    connection.execute("set variable tables = $1", [[str(path) for path in paths]])
    statements = connection.extract_statements(QUERIES.read_text())
    connection.execute(statements[0])
    answers = [connection.execute(statement).fetchall() for statement in statements[1:]]
    found = {Path(row[0]): row for row in answers[0]}
    for path in paths:
        runs, accepted, contacts, tool_mm = from_csv(path)
        _, *figures, _ = found[path]
        assert figures[:3] == [runs, accepted, contacts], (path, figures)
        assert abs(figures[3] - tool_mm) < 0.006, (path, figures, tool_mm)
    for answer in answers:
        print(*answer, sep="\n", end="\n\n")


if __name__ == "__main__":
    main([Path(argument).resolve() for argument in sys.argv[1:]])

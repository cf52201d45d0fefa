"""All blocks of benches/loops/run.sh as one table, and what they come to -> Markdown on stdout.

    summary.py FOLDER [OUT.parquet]      (pip install duckdb==2.0.1 scipy==1.17.1)

Finished blocks and those under way (.csv.partial) count. Intervals of rates: Clopper and Pearson, 95 %. Whose error counts: the largest
over the task's targets. Bound: 3.29 sigma (99.9 % of a normal error; the largest share for any direction) of the error that the run
predicted, drawing and survey included, at 95 % of its targets: a little less than at the worst one, so that none is overlooked.
Refused: no stratum has a fault, so that every refusal is a false one.
"""

import csv
import sys
from pathlib import Path

import duckdb
from scipy.stats import beta

SIGMAS_99_9 = 3.29
STRATA = Path(__file__).with_name("strata.txt")


def strata():
    """Name: (runs wanted, tolerance in m of its routine)."""
    out = {}
    for line in STRATA.read_text().splitlines():
        if line and not line.startswith("#"):
            name, _, blocks, routine, *_ = line.split()
            text = (Path(__file__).parents[2] / routine).read_text()
            tolerance = next(row.split("=")[1].split("#")[0] for row in text.splitlines() if row.startswith("tolerance_m"))
            out[name] = (50 * int(blocks), float(tolerance))
    return out


def rows_of(folder):
    """Rows by stratum; a torn last line of a block under way is left out."""
    out = {}
    for path in sorted(folder.glob("*.csv")) + sorted(folder.glob("*.csv.partial")):
        partial = path.with_name(path.name + ".partial")
        if path.suffix == ".csv" and partial.exists():
            continue
        lines = path.read_text().splitlines(keepends=True)
        whole = [line for line in lines if line.endswith("\n") and not line.startswith("#")]
        out.setdefault(path.name.rsplit("-", 1)[0], []).extend(csv.DictReader(whole))
    return out


def interval(events, runs):
    low = beta.ppf(0.025, events, runs - events + 1) if events else 0.0
    high = beta.ppf(0.975, events + 1, runs - events) if events < runs else 1.0
    return low, high


def rate(events, runs):
    low, high = interval(events, runs)
    return f"{events} ({100 * low:.2f} .. {100 * high:.2f} %)"


def number(row, key):
    return float(row[key]) if row.get(key) else None


def counts(rows, tolerance):
    accepted = [row for row in rows if row["status"] in ("accepted", "missed")]
    pairs = [(number(row, "tool_error_after_max_m"), number(row, "predicted_tool_error_with_priors_p95_m")) for row in accepted]
    scored = [(error, SIGMAS_99_9 * sigma) for error, sigma in pairs if error is not None and sigma is not None]
    return {
        "runs": len(rows),
        "contacts": sum((number(row, "contacts") or 0) > 0 for row in rows),
        "refused": sum(row["status"] == "refused" for row in rows),
        "missed": sum(row["status"] == "missed" for row in rows),
        "failed": sum(row["status"] == "failed" for row in rows),
        "scored": len(scored),
        "beyond": sum(error > bound for error, bound in scored),
        "beyond_both": sum(error > max(bound, tolerance) for error, bound in scored),
    }


def percentiles(rows, key):
    values = sorted(value for row in rows if (value := number(row, key)) is not None)
    at = lambda share: f"{1e3 * values[min(len(values) - 1, int(share * len(values)))]:.2f}" if values else "-"
    return values, at


def line(name, rows, wanted, tolerance):
    c = counts(rows, tolerance)
    hits = [(int(number(row, "hits_after")), row) for row in rows if row.get("hits_after")]
    lost = sum(hit + int(number(row, "targets_skipped") or 0) < max(n for n, _ in hits) for hit, row in hits)
    _, error = percentiles(rows, "tool_error_after_max_m")
    clearances, clearance = percentiles(rows, "min_clearance_m")
    least = f"{1e3 * clearances[0]:.0f}" if clearances else "-"
    cells = [name, f"{c['runs']} of {wanted}", rate(c["contacts"], c["runs"]), rate(c["refused"], c["runs"]), str(c["missed"]), str(c["failed"]),
             f"{rate(c['beyond'], c['scored'])}" if c["scored"] else "-", str(c["beyond_both"]), str(lost), f"{error(0.5)}, {error(0.99)}",
             f"{least}, {clearance(0.5)}"]
    return "| " + " | ".join(cells) + " |"


def main(folder, parquet=None):
    folder = Path(folder)
    wanted, found = strata(), rows_of(Path(folder))
    print("| stratum | runs | with contacts | refused | missed a limit | failed | beyond its 99.9 % bound | and the tolerance | with a lost hit "
          "| largest error: median, 99 %, mm | clearance: least, median, mm |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
    for name, (n, tolerance) in wanted.items():
        if found.get(name):
            print(line(name, found[name], n, tolerance))
    every = [row for rows in found.values() for row in rows]
    total = {}
    for name, rows in found.items():
        for key, value in counts(rows, wanted[name][1]).items():
            total[key] = total.get(key, 0) + value
    runs = total["runs"]
    print(f"\nAll {runs} of {sum(n for n, _ in wanted.values())}: contacts {rate(total['contacts'], runs)}, refused "
          f"{rate(total['refused'], runs)}, failed {rate(total['failed'], runs)}; beyond the bound {rate(total['beyond'], total['scored'])} of "
          f"{total['scored']}, beyond the tolerance, too, {rate(total['beyond_both'], total['scored'])}.\n")
    for row in every:
        error, sigma = number(row, "tool_error_after_max_m"), number(row, "predicted_tool_error_with_priors_p95_m")
        is_beyond = row["status"] in ("accepted", "missed") and error and sigma and error > SIGMAS_99_9 * sigma
        if row["status"] != "accepted" or (number(row, "contacts") or 0) > 0 or is_beyond:
            print(f"- `{row['command']}`: {row['status']}{': ' + row['failure'] if row['failure'] else ''}"
                  f"{', beyond its bound' if is_beyond else ''}")
    if parquet:
        # Typed as the blocks are; a column that an arm lacks is null.
        files = [str(path) for path in sorted(folder.glob("*.parquet"))]
        query = "copy (select regexp_extract(filename, '([^/]*)-[0-9]+[.]parquet$', 1) as stratum, * exclude (filename) " \
                "from read_parquet($1, union_by_name = true, filename = true)) to '" + str(parquet) + "' (format parquet, compression zstd)"
        duckdb.execute(query, [files])


if __name__ == "__main__":
    main(*sys.argv[1:])

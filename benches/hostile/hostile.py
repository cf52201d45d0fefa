"""Files made to harm, and what a program spends on each -> a table.

    hostile.py ARMCAL OUT.csv [NAME ..]

Each attack is a process of its own under a limit of memory and of time. Budget: 100 MB and 20 times the file's bytes of memory, 10 s of
processor time and 10 s a MB more; neither a signal nor a panic. NAME: only attacks whose name has one of these in it.
"""

import csv
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

from attacks import ATTACKS

ADDRESS_BYTES = 4 << 30
LIMIT_S, WALL_LIMIT_S = 90, 300
BASE_BYTES, BYTES_PER_BYTE = 100_000_000, 20
BASE_S, S_PER_MB = 10.0, 10.0
PANIC = 101


def main(program, out, *names):
    program = str(Path(program).resolve())
    chosen = [one for one in ATTACKS if not names or any(name in one.__name__ for name in names)]
    beyond = 0
    with open(out, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["attack", "bytes", "peak_mb", "processor_s", "exit_code", "within", "said"])
        for one in chosen:
            row, is_within = measure(program, one)
            beyond += not is_within
            table.writerow(row)
            file.flush()
            print(*row, flush=True)
    print(f"{len(chosen)} attacks, {beyond} beyond the budget")
    return 1 if beyond else 0


def measure(program, one):
    folder = Path(tempfile.mkdtemp())
    try:
        arguments = made_apart(one, folder)
        # The copy of the robot is small.
        n_bytes = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        status, used, said = run([program, *arguments], folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    peak_bytes, processor_s = used.ru_maxrss * 1024, used.ru_utime + used.ru_stime
    code = os.waitstatus_to_exitcode(status)
    is_within = (
        0 <= code != PANIC
        and peak_bytes <= BASE_BYTES + BYTES_PER_BYTE * n_bytes
        and processor_s <= max(BASE_S, S_PER_MB * n_bytes / 1e6)
    )
    said = said.replace(str(folder), "")[:160]
    row = [one.__name__, n_bytes, round(peak_bytes / 1e6), round(processor_s, 1), code, "yes" if is_within else "NO", said]
    return row, is_within


def made_apart(one, folder):
    """The arguments of an attack. Its files are made by a child: what is run later would inherit the memory of this process as its peak."""
    child = os.fork()
    if child == 0:
        arguments = [str(argument) for argument in one(folder)]
        (folder / "arguments").write_text("\n".join(arguments))
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        raise SystemExit(f"{one.__name__}: cannot be made")
    return (folder / "arguments").read_text().split("\n")


def run(command, folder):
    """Exit status, usage and the error said, or the first line."""
    log = os.open(folder / "said", os.O_RDWR | os.O_CREAT)
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_BYTES, ADDRESS_BYTES))
        resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.dup2(log, 1)
        os.dup2(log, 2)
        os.chdir(folder)
        os.execv(command[0], command)
    end = time.monotonic() + WALL_LIMIT_S
    while True:
        found, status, used = os.wait4(child, os.WNOHANG)
        if found:
            break
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
            _, status, used = os.wait4(child, 0)
            break
        time.sleep(0.01)
    lines = [line for line in os.pread(log, 8192, 0).decode(errors="replace").splitlines() if line.strip()]
    os.close(log)
    errors = [line for line in lines if line.startswith("error:")]
    return status, used, (errors or lines or [""])[0]


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

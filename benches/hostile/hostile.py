"""Files made to harm, and what a program spends on each -> a table.

    hostile.py ARMCAL OUT.csv [NAME ..]

Each attack is a process of its own under a limit of memory and of time. Budget: 100 MB and 20 times the file's bytes of memory, 10 s of
processor time and 10 s a MB more; neither a signal nor a panic; no character that steers a terminal. NAME: only attacks whose name has one of
these in it.
"""

import os
import shutil
import sys
import tempfile
from pathlib import Path

import measured
from attacks import ATTACKS


def main(program, out, *names):
    program = str(Path(program).resolve())
    chosen = [one for one in ATTACKS if not names or any(name in one.__name__ for name in names)]
    with measured.Table(out, "attack", "bytes") as table:
        for one in chosen:
            table.add([one.__name__], *measure(program, one))
    return table.end()


def measure(program, one):
    folder = Path(tempfile.mkdtemp())
    try:
        arguments = made_apart(one, folder)
        # The copy of the robot is small.
        n_bytes = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        return n_bytes, measured.Child([program, *arguments], folder).wait()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


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


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

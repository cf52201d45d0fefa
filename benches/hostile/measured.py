"""A process under limits, what it spent, and the table of it. Shared by hostile.py, dds.py and rosbridge.py."""

import csv
import os
import resource
import signal
import time

ADDRESS_BYTES = 4 << 30
LIMIT_S, WALL_LIMIT_S = 90, 300
BASE_BYTES, BYTES_PER_BYTE = 100_000_000, 20
BASE_S, S_PER_MB = 10.0, 10.0
PANIC = 101
SHOWN = 160
# What is read of the output.
MOST_BYTES = 4 << 20
# Characters that change the direction of writing.
DIRECTIONS = {0x61C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A)}


class Spent:
    """How a process ended, and what it used."""

    def __init__(self, status, used, said):
        self.code = os.waitstatus_to_exitcode(status)
        self.peak_bytes, self.processor_s = used.ru_maxrss * 1024, used.ru_utime + used.ru_stime
        lines = [line for line in said.splitlines() if line.strip()]
        errors = [line for line in lines if line.startswith("error:")]
        # The last words are those of a program that did what it should.
        self.said = (errors or lines[-1:] or [""])[0]
        self.steers = any((ord(c) < 32 and c not in "\n\t") or 127 <= ord(c) < 160 or ord(c) in DIRECTIONS for c in said)

    def is_within(self, n_bytes):
        return (
            0 <= self.code != PANIC
            and not self.steers
            and self.peak_bytes <= BASE_BYTES + BYTES_PER_BYTE * n_bytes
            and self.processor_s <= max(BASE_S, S_PER_MB * n_bytes / 1e6)
        )


class Child:
    """A command in its folder."""

    def __init__(self, command, folder, address_bytes=ADDRESS_BYTES):
        self.log = os.open(folder / "said", os.O_RDWR | os.O_CREAT)
        self.folder, self.pid = str(folder), os.fork()
        if self.pid == 0:
            resource.setrlimit(resource.RLIMIT_AS, (address_bytes, address_bytes))
            resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            os.dup2(self.log, 1)
            os.dup2(self.log, 2)
            os.chdir(folder)
            os.execv(command[0], command)

    def stop(self):
        """As Ctrl-C does."""
        os.kill(self.pid, signal.SIGINT)
        return self.wait()

    def wait(self):
        end = time.monotonic() + WALL_LIMIT_S
        while True:
            found, status, used = os.wait4(self.pid, os.WNOHANG)
            if found:
                break
            if time.monotonic() > end:
                os.kill(self.pid, signal.SIGKILL)
                _, status, used = os.wait4(self.pid, 0)
                break
            time.sleep(0.01)
        said = os.pread(self.log, MOST_BYTES, 0).decode(errors="replace").replace(self.folder, "")
        os.close(self.log)
        return Spent(status, used, said)


def shortened(said):
    """The beginning, and the code at the end."""
    code = said[said.rfind("[") :] if said.endswith("]") else ""
    return said if len(said) <= SHOWN else f"{said[:SHOWN]} .. {code}"


def end(pid):
    """Ends a child that may have ended."""
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)


class Table:
    """Rows on paper and on the screen."""

    def __init__(self, out, *columns):
        self.file, self.n, self.beyond = open(out, "w", newline=""), 0, 0
        self.csv = csv.writer(self.file)
        self.csv.writerow([*columns, "peak_mb", "processor_s", "exit_code", "within", "said"])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.file.close()

    def add(self, names, n_bytes, spent):
        is_within = spent.is_within(n_bytes)
        said = "".join(c if c.isprintable() else "?" for c in shortened(spent.said))
        row = [*names, n_bytes, round(spent.peak_bytes / 1e6), round(spent.processor_s, 1), spent.code, "yes" if is_within else "NO", said]
        self.n, self.beyond = self.n + 1, self.beyond + (not is_within)
        self.csv.writerow(row)
        self.file.flush()
        print(*row, flush=True)

    def end(self):
        print(f"{self.n} attacks, {self.beyond} beyond the budget")
        return 1 if self.beyond else 0

"""The program islet as a user runs it, for the tests beside this file; its path is their first argument."""
import fcntl
import os
import pty
import signal
import struct
import subprocess
import sys
import termios
import time

ISLET = os.path.abspath(sys.argv.pop(1))


def start(arguments, **more):
    return subprocess.Popen([ISLET] + arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more)


def read(path):
    with open(path) as file:
        return file.read()


def wait_for(condition):
    """True within half a minute, or the test fails."""
    end = time.monotonic() + 30
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError("waited in vain")


def on_terminal(arguments, columns, environment=None, seconds=60):
    """What the program writes to a terminal of so many columns, and its exit status."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.environ.pop("COLUMNS", None)
        os.environ.update(environment or {})
        fcntl.ioctl(1, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        os.execv(ISLET, [ISLET] + arguments)
    text, end = b"", time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            piece = os.read(terminal, 65536)
        except OSError:  # its end on Linux
            break
        if not piece:
            break
        text += piece
    os.close(terminal)
    return text.decode(), os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def caught(pid):
    """Whether the process has a handler of its own for SIGINT."""
    with open(f"/proc/{pid}/status") as status:
        mask = next(line for line in status if line.startswith("SigCgt"))
    return int(mask.split()[1], 16) >> (signal.SIGINT - 1) & 1


def worked(pid):
    """[s] of a core that the process has used so far."""
    with open(f"/proc/{pid}/stat") as stat:
        return int(stat.read().rsplit(")", 1)[1].split()[11]) / os.sysconf("SC_CLK_TCK")

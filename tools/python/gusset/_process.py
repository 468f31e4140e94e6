"""Starts the program `gusset`, passes on what it writes to stderr, and passes Ctrl-C to it."""

from __future__ import annotations

import codecs
import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass

# A progress bar of the program: lines that are drawn over themselves.
DRAWING = re.compile(r"(\r\x1b\[\d+A)?\x1b\[\?7l.*?\x1b\[\?7h", re.DOTALL)
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
LINE_END = re.compile(r"[\n\r]|\x1b\[\?7h")
HALF_COLOUR = re.compile(r"\x1b(\[[0-9;]*m?)?")
# The error with which the program ends. Everything after it belongs to it.
ERROR = re.compile(r"(?:^|\r|(?<=\x1b\[\?7h))(?:\x1b\[[0-9;]*m)*error(?:\x1b\[[0-9;]*m)*:", re.MULTILINE)


@dataclass(frozen=True)
class Outcome:
    """How the program ended."""

    code: int
    """Its exit code; negative for a signal."""
    messages: str
    """Its text on stderr, without colours and progress."""
    is_interrupted: bool
    """True if Ctrl-C was pressed."""

    @property
    def error(self) -> str:
        """The error in `messages`, see `error_in`."""
        return error_in(self.messages)


def execute(arguments: list[str], *, quiet: bool, progress: bool = False) -> Outcome:
    """Runs the program to its end, and repeats its text on stderr, but not an error that the caller raises as an exception.

    The program has its own session, so Ctrl-C in a terminal reaches it once, through this function. With `progress`, it draws
    its progress where stderr is a terminal.
    """
    pieces: list[str] = []
    held: list[str] = []
    is_interrupted = False
    process: subprocess.Popen[bytes] | None = None
    reader: threading.Thread | None = None
    is_over = threading.Event()  # `Thread.join` would return at once after a Ctrl-C (before Python 3.13)
    ours, theirs = terminal() if progress and not quiet and is_terminal() else os.pipe()
    try:
        while True:
            try:
                if process is None:
                    process = started(arguments, theirs)
                if theirs >= 0:
                    given, theirs = theirs, -1
                    os.close(given)  # so that the stream ends with the program
                if reader is None:
                    thread = threading.Thread(target=forward, args=(ours, pieces, held, quiet, is_over), daemon=True)
                    thread.start()
                    reader = thread
                # The stream ends with the program. `wait` alone would delay the signal by 0.25 s.
                is_over.wait()
                code, messages = process.wait(), plain("".join(pieces))
                if code == 0 or is_interrupted:
                    show("".join(held))
                return Outcome(code, messages, is_interrupted)
            except KeyboardInterrupt:
                if process is None:
                    raise
                is_interrupted = True
                with contextlib.suppress(ProcessLookupError):
                    process.send_signal(signal.SIGINT)
            except BaseException:
                if process is not None:
                    process.terminate()
                raise
    finally:
        if theirs >= 0:
            os.close(theirs)
        if reader is None:
            os.close(ours)


def plain(text: str) -> str:
    """A text from a terminal without progress and colours."""
    return COLOUR.sub("", DRAWING.sub("", text))


def error_in(messages: str) -> str:
    """The error with which the program ended, or all messages without such an error."""
    found = ERROR.search(messages)
    return (messages[found.end() :] if found else messages).strip() or "no message"


def show(text: str) -> None:
    """Writes a text on stderr, if there is one."""
    if text and sys.stderr is not None:
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.write(text)
            sys.stderr.flush()


def started(arguments: list[str], stderr: int) -> subprocess.Popen[bytes]:
    """Starts the program."""
    return subprocess.Popen(arguments, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=stderr, start_new_session=True)


def is_terminal() -> bool:
    """True if `sys.stderr` is a terminal."""
    try:
        return sys.stderr is not None and sys.stderr.isatty()
    except (OSError, ValueError):
        return False


def terminal() -> tuple[int, int]:
    """A pseudo-terminal of the size of ours: the end to read, and the end of the program."""
    import fcntl
    import termios
    import tty

    ours, theirs = os.openpty()
    with contextlib.suppress(OSError, ValueError):
        tty.setraw(theirs)  # keeps line ends
        size = fcntl.ioctl(sys.stderr.fileno(), termios.TIOCGWINSZ, bytes(8))
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, size)
    return ours, theirs


def forward(descriptor: int, pieces: list[str], held: list[str], quiet: bool, is_over: threading.Event) -> None:
    """Keeps all text of a stream, and repeats it on stderr up to the error, which goes to `held`. Closes the stream at its end."""
    decoder = codecs.getincrementaldecoder("utf-8")("replace")
    text = ""  # that is not yet repeated
    try:
        data = b"?"
        while data:
            try:
                data = os.read(descriptor, 65536)
            except OSError:  # the end of a pseudo-terminal
                data = b""
            pieces.append(decoder.decode(data, not data))
            if quiet:
                continue
            text += pieces[-1]
            found = ERROR.search(text)
            # A last line that may become "error:" waits for its next piece.
            line = LINE_END.split(text)[-1]
            may_become = data and "error:".startswith(HALF_COLOUR.sub("", line))
            end = found.start() if found else len(text) - (len(line) if may_become else 0)
            show(text[:end])
            text = text[end:]
        held.append(text)
    finally:
        os.close(descriptor)
        is_over.set()

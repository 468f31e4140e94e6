#!/usr/bin/env python3
"""Serves a specimen in Python over the Gusset wire protocol (tools/PROTOCOL.md): TCP, without a key, complete in one file.

Derive your force law from `Specimen`, or from `Rig` if your program also measures displacements, and give it to `main`
(`gusset new NAME --template python` writes an example). Without arguments this program serves a spring:

    python3 specimen.py [PORT [STIFFNESS_N_PER_M]]

This file needs only the standard library. A specimen with several axes needs NumPy. Units are m, N, s, rad and N*m.
"""

from __future__ import annotations

import contextlib
import copy
import hashlib
import ipaddress
import os
import socket
import struct
import sys
import threading
import time
import traceback
import zlib
from math import isfinite
from typing import Any, Callable

COMMAND, MEASUREMENT, HEARTBEAT, HOLD, RETIRE, GOODBYE, CONTROL = 1, 2, 3, 4, 5, 6, 16
HELLO, WELCOME, REFUSE, ARM, BYE = 0, 1, 2, 3, 4
ORDERLY, TRIPPED, WATCHDOG = 0, 1, 3  # causes
HELLO_LIMIT_S, ARM_LIMIT_S, SEND_LIMIT_S, CONNECTION_LIMIT = 10, 60, 10, 16
TEXT_LIMIT, AXIS_LIMIT = 256, 64
FORCE_SLACK = 1.25  # the controller judges forces first; beyond this multiple of its limit the specimen holds by itself
FLAG_SPECIMEN, INTERLOCK, HOLDING, NONE = 2, 1, 2, 2**64 - 1
SIMULATED, USES_VELOCITY, KEEPS_STATE = 1, 8, 16  # capabilities
UNITS = ("m", "mm", "rad", "N", "kN", "N*m", "kN*m")
SI_UNITS = (("m", "N"), ("rad", "N*m"))
UNLIMITED = struct.pack("<dddd", -float("inf"), float("inf"), float("inf"), float("inf"))
HEADER = struct.Struct("<4sBBHIHHQQ")


class Broken(Exception):
    """A frame that fails a check: never move on it."""


class SpecimenError(RuntimeError):
    """The force law gave no usable force, or the specimen does not fit the test."""


class Specimen:
    """A force law in Python, served to a controller as a computed specimen.

    Override `respond`. Each test works on a copy of your object, so it starts in the state that the object has before the test.
    If you override `reset`, each test works on the object itself and calls `reset` first.

    Attributes:
        axes: Number of axes, 1 to 64.
        stiffness: Initial stiffness, N/m (N*m/rad for a rotation): a number, or n x n numbers for n axes. `gusset.run` enters
            it in the test if the test file has none.
        dt: Test time since the previous command, s. The server sets it before each call of `respond`; 0 during a hold.
    """

    axes: int = 1
    stiffness: Any = None
    dt: float = 0.0

    def respond(self, time: float, disp: Any, vel: Any) -> Any:
        """Returns the force at a new displacement. The server calls it once for each new command.

        Args:
            time: Test time of the displacement, s.
            disp: Displacement, m (rad). A float for one axis, else an array of shape (n,).
            vel: Velocity half a step before `time`, m/s (rad/s). The same shape as `disp`.

        Returns:
            Force, N (N*m), positive when it resists a positive displacement. The same shape as `disp`.
        """
        raise NotImplementedError(f"{type(self).__name__} has no method respond(self, time, disp, vel)")

    def reset(self) -> None:
        """Returns the specimen to its initial state. Override it to use one object, without copies, in every test."""


class Rig:
    """A rig with one axis that measures its displacement. It stays where the last test left it, also for the next controller.

    A subclass that only computes says `simulated = True`. Otherwise the controller takes it for a machine.
    """

    simulated = False

    def __init__(self, stiffness: float) -> None:
        self.stiffness, self.disp = stiffness, 0.0

    def measure(self) -> tuple[float, float]:
        """Measured displacement, m, and force, N, called once for each new command; `self.disp` is the command."""
        return self.disp, self.stiffness * self.disp


class _ServedSpecimen:
    """A `Specimen` as the session uses it."""

    name, capabilities = "specimen", SIMULATED | USES_VELOCITY

    def __init__(self, specimen: Specimen) -> None:
        self.given = self.active = specimen
        self.axes = specimen.axes
        if isinstance(self.axes, bool) or not isinstance(self.axes, int) or not 1 <= self.axes <= AXIS_LIMIT:
            raise SpecimenError(f"{type(specimen).__name__}.axes is {self.axes!r}; a whole number from 1 to {AXIS_LIMIT} is needed")
        self.stiffness = stiffness_matrix(specimen)
        self.position = (0.0,) * self.axes
        self.uses_copy = type(specimen).reset is Specimen.reset
        self.start()

    def start(self) -> None:
        """Puts the specimen into its initial state."""
        self.position = (0.0,) * self.axes
        if not self.uses_copy:
            self.given.reset()
            return
        try:
            self.active = copy.deepcopy(self.given)
        except Exception as reason:
            name = type(self.given).__name__
            raise SpecimenError(f"{name} cannot be copied for a test ({reason}). Give it a method reset(self)") from reason

    def mover(self) -> Callable[..., tuple[Any, Any]]:
        """The function that answers a command: (time, dt, disp, vel) to (measured displacement, force)."""
        specimen = self.active
        respond = specimen.respond
        if self.axes == 1:

            def move_one(time: float, dt: float, disp: float, vel: float) -> tuple[float, float]:
                specimen.dt = dt
                force = respond(time, disp, vel)
                if type(force) is not float:
                    force = one_number(specimen, force)
                if not isfinite(force):
                    raise SpecimenError(f"{type(specimen).__name__}.respond returned {force} N at {time:.6g} s")
                return disp, force

            return move_one

        import numpy

        def move(time: float, dt: float, disp: tuple[float, ...], vel: tuple[float, ...]) -> tuple[Any, Any]:
            specimen.dt = dt
            answer = respond(time, numpy.array(disp), numpy.array(vel))
            try:
                force = numpy.asarray(answer, dtype=float)
            except (TypeError, ValueError):
                force = numpy.empty(0)
            if force.shape != (self.axes,):
                kind = f"{type(specimen).__name__}.respond returned {answer!r}"
                raise SpecimenError(f"{kind}; {self.axes} forces in N are needed, one for each axis")
            if not numpy.isfinite(force).all():
                raise SpecimenError(f"{type(specimen).__name__}.respond returned {answer!r} at {time:.6g} s")
            return disp, force.tolist()

        return move


class _ServedRig:
    """A `Rig` as the session uses it."""

    name, axes = "spring", 1

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.stiffness = (float(rig.stiffness),)
        self.is_tested = False  # by a test of this process

    @property
    def position(self) -> tuple[float, ...]:
        return (self.rig.disp,)

    @property
    def capabilities(self) -> int:
        is_simulated = self.rig.simulated or type(self.rig) is Rig  # Rig itself is a computed spring
        return (SIMULATED if is_simulated else 0) | (KEEPS_STATE if self.is_tested else 0)

    def start(self) -> None:
        self.is_tested = True

    def mover(self) -> Callable[..., tuple[Any, Any]]:
        rig = self.rig

        def move(_time: float, _dt: float, disp: float, _vel: float) -> tuple[float, float]:
            rig.disp = disp
            return rig.measure()

        return move


def one_number(specimen: Specimen, force: Any) -> float:
    """The force of a specimen with one axis as a float: NumPy scalars and arrays of one element are numbers, too."""
    try:
        if isinstance(force, (str, bytes)):
            raise TypeError
        if getattr(force, "shape", ()) == (1,):
            force = force[0]
        return float(force)
    except (TypeError, ValueError):
        raise SpecimenError(f"{type(specimen).__name__}.respond returned {force!r}; one force in N is needed") from None


def stiffness_matrix(specimen: Specimen) -> tuple[float, ...]:
    """The initial stiffness, n x n numbers column by column; empty if the specimen gives none."""
    given, n = specimen.stiffness, specimen.axes
    if given is None:
        return ()
    try:
        rows = [[float(given)]] if n == 1 and not hasattr(given, "__len__") else [[float(x) for x in row] for row in given]
    except (TypeError, ValueError):
        rows = []
    if len(rows) != n or any(len(row) != n or not all(map(isfinite, row)) for row in rows):
        wanted = "a number in N/m" if n == 1 else f"{n} x {n} numbers in N/m"
        raise SpecimenError(f"{type(specimen).__name__}.stiffness is {given!r}; {wanted} is needed")
    return tuple(rows[i][j] for j in range(n) for i in range(n))


class Session:
    """One controller, from its hello to its end."""

    def __init__(self, connection: socket.socket, served: Any, taken: threading.Lock) -> None:
        self.connection, self.served, self.taken = connection, served, taken
        self.axes = n = served.axes
        self.session = self.sent = self.counter = 0
        self.status, self.missed, self.tripped = 0, 0, 0
        self.sequence: int | None = None  # the command in force
        self.expected = 0  # the lowest that may come next
        self.disp = served.position
        self.history = (NONE, *(0.0,) * n) * 4
        self.buffer = b""
        self.timeout = -1.0
        self.lengths = {COMMAND: 60 + 16 * n, HEARTBEAT: 60, HOLD: 52, RETIRE: 52, GOODBYE: 52}
        self.command_body = struct.Struct(f"<QQdd{2 * n}dI")  # from the counter of the header to the checksum
        self.answer_body = struct.Struct("<QQddII" + f"{2 * n}d" + f"Q{n}d" * 4)
        self.answer = bytearray(100 + 48 * n)
        self.answer_head = memoryview(self.answer)[:-4]
        self.inbox = bytearray(65536)
        self.inbox_view = memoryview(self.inbox)
        self.limits: list[tuple[float, float, float]] = []
        self.force_limits: list[float] = []

    def send(self, kind: int, body: bytes) -> None:
        self.sent += 1
        frame = HEADER.pack(b"GUST", 1, kind, FLAG_SPECIMEN, 36 + len(body), 0, 0, self.session, self.sent) + body
        self.connection.sendall(frame + struct.pack("<I", zlib.crc32(frame)))

    def wait_at_most(self, seconds: float) -> None:
        """Limits the time of each receive call, s. The system does it, which is faster than `settimeout`."""
        if seconds != self.timeout:
            self.timeout = seconds
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, timeval(seconds))

    def receive(self, until: float) -> tuple[int, bytes] | None:
        """The next frame as (kind, body), checked; None if it is not whole by then: half a frame gains no time."""
        while not (frame := self.whole()):
            self.wait_at_most(max(1e-6, until - time.monotonic()))
            try:
                more = self.connection.recv(65536)
            except BlockingIOError:
                return None
            if not more:
                raise ConnectionError("the controller closed the connection")
            self.buffer += more
        kind, flags, n, zero, session, counter = struct.unpack_from("<BHxxxxHHQQ", frame, 5)
        if zlib.crc32(frame[:-4]) != struct.unpack("<I", frame[-4:])[0]:
            raise Broken("checksum")
        if flags != 0 or zero != 0 or n != (self.axes if kind == COMMAND else 0):
            raise Broken("header")
        if session != self.session:
            raise Broken("session")
        if self.session:
            if counter <= self.counter:
                raise Broken("counter")
            self.counter = counter
        return kind, frame[32:-4]

    def whole(self) -> bytes | None:
        """Cuts one whole frame off the buffer; every length is checked before it is used."""
        if not b"GUST\x01".startswith(self.buffer[:5]) and self.buffer[:5] != b"GUST\x01":
            raise Broken("another protocol or version")
        if len(self.buffer) < 32:
            return None
        kind, length = self.buffer[5], struct.unpack_from("<I", self.buffer, 8)[0]
        right = 40 <= length <= 64036 if kind == CONTROL else length == self.lengths.get(kind)
        if not right:
            raise Broken("length")
        if len(self.buffer) < length:
            return None
        frame, self.buffer = self.buffer[:length], self.buffer[length:]
        return frame

    def refuse(self, code: int, text: str) -> None:
        data = cut(text)
        self.send(CONTROL, struct.pack("<IIHHQ", REFUSE, code, 1, 1, len(data)) + data)
        raise Broken(text)

    def announced(self, hello: bytes) -> None:
        """Takes the axes of the controller, and its limits: displacements, largest step between commands, largest force."""
        at = 133
        for _ in ("program", "test"):
            at += 8 + struct.unpack_from("<Q", hello, at)[0]
        (axes,), at = struct.unpack_from("<Q", hello, at), at + 8
        if axes != self.axes:
            self.refuse(1, f"the test has {axes} axes for this specimen, and the specimen has axes = {self.axes}")
        commands, seconds = struct.unpack_from("<QQ", hello, 105)
        if not commands or not seconds:
            self.refuse(12, "the rate of the commands must not be 0")
        self.period = seconds / commands
        layout, self.axes_text = f"gusset frames 1 axes {axes} history 4\n", b""
        self.limits, self.force_limits = [], []
        for _ in range(axes):
            (size,) = struct.unpack_from("<Q", hello, at)
            name, at = hello[at + 8 : at + 8 + size], at + 8 + size
            disp_unit, force_unit, low, high, speed, force = struct.unpack_from("<IIdddd", hello, at)
            at += 40
            if max(disp_unit, force_unit) >= len(UNITS):
                self.refuse(12, "an axis has an unknown unit")
            units = UNITS[disp_unit], UNITS[force_unit]
            if units not in SI_UNITS:
                self.refuse(2, f"a specimen in Python has the units m and N, or rad and N*m, not {units[0]} and {units[1]}")
            if not (low < high and speed > 0 and force > 0):
                self.refuse(12, "an axis has limits that contradict each other")
            slack = 1e-9 * (high - low) if high - low < float("inf") else 0.0
            self.limits.append((low - slack, high + slack, speed * self.period * (1 + 1e-9)))
            self.force_limits.append(FORCE_SLACK * force)
            layout += f"{name.decode()}|{units[0]}|{units[1]}\n"
            self.axes_text += struct.pack("<Q", size) + name + struct.pack("<II", disp_unit, force_unit) + UNLIMITED
        if at != len(hello):
            self.refuse(12, "the Hello has another length than its contents")
        self.layout = hashlib.sha256(layout.encode()).digest()
        if hello[68:100] != self.layout:
            self.refuse(3, "the hash of the layout does not belong to the axes of the Hello")

    def greet(self) -> bytes:
        """Agrees on everything before anything moves; returns the Arm message."""
        kind, hello = self.receive(time.monotonic() + HELLO_LIMIT_S) or (None, b"")
        if kind != CONTROL or len(hello) < 149 or struct.unpack_from("<I", hello)[0] != HELLO:
            raise Broken("no Hello")
        if self.taken.locked():
            self.refuse(8, "another controller is connected")
        lowest, highest, keyed = struct.unpack_from("<HH?", hello, 100)
        self.watchdog, sampling = struct.unpack_from("<dI", hello, 121)
        if not lowest <= 1 <= highest:
            self.refuse(0, "only version 1 is supported")
        if keyed:
            self.refuse(9, "no key is configured")
        if sampling != 0:
            self.refuse(7, "this specimen measures when the command comes, not later")
        if not 0 < self.watchdog <= 3600:
            self.refuse(6, "the watchdog time must be at most 3600 s")
        self.announced(hello)
        session = int.from_bytes(os.urandom(8), "little") or 1
        served, program, n = self.served, b"specimen.py 2", self.axes
        name = cut(served.name)
        welcome = struct.pack("<I32s32s32sQH?", WELCOME, bytes(32), os.urandom(32), self.layout, session, 1, False)
        welcome += struct.pack("<IdI", served.capabilities, self.watchdog, 0)
        welcome += struct.pack(f"<Q{len(served.stiffness)}d", len(served.stiffness), *served.stiffness)
        welcome += struct.pack(f"<Q{n}d", n, *served.position)
        welcome += struct.pack("<Q", len(program)) + program + struct.pack("<Q", len(name)) + name
        welcome += struct.pack("<Q", n) + self.axes_text
        self.send(CONTROL, welcome)
        self.session, self.sent = session, 0
        # Everything in a command before its counter is constant.
        self.command_head = HEADER.pack(b"GUST", 1, COMMAND, 0, self.lengths[COMMAND], n, 0, session, 0)[:24]
        HEADER.pack_into(self.answer, 0, b"GUST", 1, MEASUREMENT, FLAG_SPECIMEN, len(self.answer), n, 0, session, 0)
        kind, arm = self.receive(time.monotonic() + ARM_LIMIT_S) or (None, b"")
        if kind == CONTROL and struct.unpack_from("<I", arm)[0] == BYE:
            raise ConnectionError("the controller said goodbye before arming")
        if kind != CONTROL or struct.unpack_from("<I", arm)[0] != ARM:
            raise Broken("no Arm message")
        return arm

    def arm(self, message: bytes) -> None:
        """Arms the session: at the beginning, and again after the wiring check."""
        if len(message) != 28 + 8 * self.axes:
            self.refuse(12, f"the Arm message is not for {self.axes} axes")
        _, session, first, axes, *start = struct.unpack(f"<IQQQ{self.axes}d", message)
        if session != self.session or axes != self.axes or not self.expected <= first < NONE:
            self.refuse(12, "the Arm message belongs to another session, or its first command is an earlier one")
        position = self.served.position if self.sequence is None else self.disp
        if not all(abs(x - p) <= 1e-9 * abs(p) for x, p in zip(start, position)):
            self.refuse(11, "the first command is not at the position of the specimen")
        self.served.start()
        self.move = self.served.mover()
        self.disp = tuple(start)
        self.sequence, self.expected, self.moved = None, first, time.monotonic()
        self.send(CONTROL, message)

    def command(self, came: float, fields: tuple[Any, ...]) -> None:
        """Answers one command. `fields` are those of `command_body`."""
        n = self.axes
        sequence, test_time, dt = fields[1:4]
        for number in fields[2:-1]:
            if not isfinite(number):
                raise Broken("a number that is not finite")
        if sequence != self.sequence:
            if sequence == NONE:
                raise Broken("no command has this number")
            if sequence < self.expected:
                return  # older than the command in force, or than the Arm message
            gap = sequence - self.expected
            # Lost commands give this one more time, but no more than has really passed.
            steps = min(gap + 1, (came - self.moved) / self.period + 1) if gap else 1
            disp = fields[4 : 4 + n]
            for target, last, (low, high, step) in zip(disp, self.disp, self.limits):
                if not low <= target <= high or abs(target - last) > step * steps:
                    self.tripped = INTERLOCK  # beyond the announced limits: a fault; hold until the next controller
            if self.tripped:
                disp = self.disp
            else:
                self.disp = disp
            self.missed = min(self.missed + gap, 2**32 - 1)
            self.expected, self.sequence, self.status = sequence + 1, sequence, self.tripped
            self.moved = came
            if n == 1:
                measured, force = self.move(test_time, dt, disp[0], fields[5] if not self.tripped else 0.0)
                self.values = (measured, force)
                entry = (sequence, force)
                is_beyond = not abs(force) <= self.force_limits[0]
            else:
                measured, force = self.move(test_time, dt, disp, fields[4 + n : 4 + 2 * n] if not self.tripped else (0.0,) * n)
                self.values = (*measured, *force)
                entry = (sequence, *force)
                is_beyond = not all(abs(one) <= most for one, most in zip(force, self.force_limits))
            if is_beyond:
                self.tripped = self.status = INTERLOCK  # the next command finds the specimen holding
            self.tail = self.values + self.history
            self.history = entry + self.history[: 3 * (n + 1)]
        self.sent += 1
        waited = time.monotonic() - came
        self.answer_body.pack_into(self.answer, 24, self.sent, self.sequence, came, waited, self.status, self.missed, *self.tail)
        CRC.pack_into(self.answer, len(self.answer) - 4, zlib.crc32(self.answer_head))
        self.connection.sendall(self.answer)

    def answer_commands(self, received: float) -> float:
        """Answers commands until the watchdog time is over or another frame comes, and returns when the last command came.

        It is the fast path: most frames are single whole commands. Bytes that it does not understand stay in the buffer.
        """
        self.wait_at_most(self.watchdog)
        receive, now, command = self.connection.recv_into, time.monotonic, self.command
        inbox, head, length, checksum = self.inbox, self.command_head, self.lengths[COMMAND], zlib.crc32
        unpack, checked = self.command_body.unpack_from, self.inbox_view[: self.lengths[COMMAND] - 4]
        while True:
            try:
                count = receive(inbox)
            except BlockingIOError:
                return received
            came = now()
            if count == length and inbox.startswith(head):
                fields = unpack(inbox, 24)
                if fields[0] > self.counter and fields[-1] == checksum(checked):
                    self.counter = fields[0]
                    received = came
                    command(came, fields)
                    continue
            if not count:
                raise ConnectionError("the controller closed the connection")
            self.buffer = bytes(self.inbox_view[:count])
            return received

    def serve(self) -> str:
        """Serves the controller to its end, and returns how the session ended."""
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, timeval(SEND_LIMIT_S))
        arm = self.greet()
        if not self.taken.acquire(blocking=False):
            self.refuse(8, "another controller has armed")
        try:
            self.arm(arm)
            ended, cause = self.test()
        finally:
            self.taken.release()
        if cause is not None:
            self.send(GOODBYE, struct.pack("<QII", self.sequence or 0, cause, 0))
        return ended

    def fail(self, reason: BaseException) -> None:
        """Tells the controller why the specimen ends the session."""
        place = traceback.extract_tb(reason.__traceback__)[-1]
        text = f"{type(reason).__name__}: {reason} (line {place.lineno} of {os.path.basename(place.filename)})"
        data = cut(text)
        self.send(CONTROL, struct.pack("<IIQ", BYE, TRIPPED, len(data)) + data)
        self.send(GOODBYE, struct.pack("<QII", self.sequence or 0, TRIPPED, 0))

    def test(self) -> tuple[str, int | None]:
        """Runs from the arming to the end. Returns how it ended, and the cause of the goodbye to send, if any."""
        paused = False
        received_at = reported_at = time.monotonic()
        gone = max(30, 10 * self.watchdog)
        while True:
            if not paused and not self.buffer and not self.status & HOLDING:
                received_at = self.answer_commands(received_at)
            frame = self.receive(received_at + gone if paused else max(received_at, reported_at) + self.watchdog)
            if frame is None:
                reported_at = time.monotonic()
                if reported_at >= received_at + gone:
                    return "the controller is silent", WATCHDOG
                if not paused:
                    self.status = self.tripped | HOLDING  # stop the rig here
                    self.send(HEARTBEAT, struct.pack("<QdII", self.sequence or 0, reported_at, self.status, 0))
                continue
            received_at = time.monotonic()
            kind, body = frame
            if kind == COMMAND:
                paused = False
                self.command(received_at, (self.counter, *struct.unpack(f"<Qdd{2 * self.axes}d", body), 0))
            elif kind == HOLD:
                paused = True
            elif kind == RETIRE:
                return "retired", ORDERLY
            elif kind == CONTROL and struct.unpack_from("<I", body)[0] == ARM:
                paused = False
                self.arm(body)
            elif kind in (GOODBYE, CONTROL):
                return "the controller said goodbye", None


CRC = struct.Struct("<I")


def timeval(seconds: float) -> bytes:
    """A time of the socket options, s."""
    whole = int(seconds)
    return struct.pack("@ll", whole, max(int((seconds - whole) * 1e6), 0 if whole else 1))


def cut(text: str) -> bytes:
    """A text of a control message: no control characters, not longer than allowed."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    return plain.encode("utf-8", "replace")[:TEXT_LIMIT].decode("utf-8", "ignore").encode()


class Server:
    """Serves one specimen to controllers on this machine, one test after another.

    Args:
        specimen: A `Specimen` or a `Rig`.
        address: "HOST:PORT" on the loopback; port 0 takes a free one.
        name: Name of the specimen in the messages of the controller.
        log: Receives one line for each session.

    Attributes:
        address: The address in use, "HOST:PORT".
        error: The first exception that the specimen raised, or None.
    """

    def __init__(
        self,
        specimen: Specimen | Rig,
        address: str = "127.0.0.1:4823",
        name: str | None = None,
        log: Callable[[str], None] | None = None,
    ) -> None:
        self.served: Any
        if isinstance(specimen, Specimen):
            self.served = _ServedSpecimen(specimen)
        elif isinstance(specimen, Rig):
            self.served = _ServedRig(specimen)
        else:
            raise TypeError(f"{specimen!r} is not a Specimen: derive its class from gusset.Specimen and create an object of it")
        if name is not None:
            self.served.name = name
        host, port = host_and_port(address)
        self.log = log or (lambda _line: None)
        self.error: BaseException | None = None
        self.taken = threading.Lock()  # by the test that runs
        self.connections: set[socket.socket] = set()
        self.is_closed = False
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self.listener = socket.create_server((host, port), family=family)
        shown = f"[{host}]" if ":" in host else host
        self.address = f"{shown}:{self.listener.getsockname()[1]}"

    def start(self) -> Server:
        """Serves in a thread, until `close`."""
        threading.Thread(target=self.serve_forever, name=f"gusset specimen {self.served.name}", daemon=True).start()
        return self

    def serve_forever(self) -> None:
        """Serves in this thread, until `close` or Ctrl-C."""
        while not self.is_closed:
            try:
                connection, peer = self.listener.accept()
            except OSError:
                if self.is_closed:
                    return
                raise
            if len(self.connections) >= CONNECTION_LIMIT:
                connection.close()
                continue
            self.connections.add(connection)
            # One thread for each connection, so that a second controller is refused at once.
            threading.Thread(target=self.attend, args=(connection, peer), daemon=True).start()

    def attend(self, connection: socket.socket, peer: Any) -> None:
        """Serves one connection to its end."""
        session = Session(connection, self.served, self.taken)
        try:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.log(f"{peer[0]}:{peer[1]} {session.serve()}")
        except (Broken, OSError, OverflowError, struct.error, UnicodeDecodeError) as reason:
            if is_from_the_specimen(reason):
                self.failed(session, reason, peer)
            else:
                self.log(f"{peer[0]}:{peer[1]} ended: {reason}")
        except BaseException as reason:
            self.failed(session, reason, peer)
        finally:
            self.connections.discard(connection)
            connection.close()

    def failed(self, session: Session, reason: BaseException, peer: Any) -> None:
        """Keeps the exception of the specimen, and ends the session."""
        if self.error is None:
            self.error = reason
        text = "".join(traceback.format_exception(type(reason), reason, reason.__traceback__))
        self.log(f"{peer[0]}:{peer[1]} ended: the specimen raised an exception\n{text.rstrip()}")
        with contextlib.suppress(OSError, struct.error):
            session.fail(reason)

    def close(self) -> None:
        """Ends the server and its connections."""
        self.is_closed = True
        with contextlib.suppress(OSError):
            self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        for connection in list(self.connections):
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)

    def __enter__(self) -> Server:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.close()


def is_from_the_specimen(reason: BaseException) -> bool:
    """True if the exception was raised in code of the specimen, not in this file."""
    frames = traceback.extract_tb(reason.__traceback__)
    return any(frame.name in ("move_one", "move", "start", "mover") for frame in frames)


def host_and_port(address: str) -> tuple[str, int]:
    """Splits "HOST:PORT". Only the loopback is allowed, because this server has no key."""
    host, _, port = address.rpartition(":")
    host = host.strip("[]")
    if not host or not port.isdecimal() or int(port) > 65535:
        raise ValueError(f'address {address!r}: write "HOST:PORT", for example "127.0.0.1:4823"')
    try:
        is_local = host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        is_local = False
    if not is_local:
        raise ValueError(
            f"address {address!r}: a specimen in Python listens on this machine alone, because it has no key. "
            "For another machine, put a gateway before it: gusset guide network"
        )
    return ("127.0.0.1" if host == "localhost" else host), int(port)


def serve(specimen: Specimen | Rig, address: str = "127.0.0.1:4823") -> None:
    """Serves `specimen` to any controller on this machine, until Ctrl-C. Prints the address, and a line for each session."""
    server = Server(specimen, address, log=lambda line: print(line, file=sys.stderr, flush=True))
    print("listening on", server.address, flush=True)
    try:
        server.serve_forever()
    finally:
        server.close()


def main(specimen: Specimen | Rig | None = None) -> None:
    """Serves `specimen`, or the spring of the command line, until the program is ended."""
    port = int(sys.argv[1]) if len(sys.argv) > 1 else 4823
    serve(specimen or Rig(float(sys.argv[2]) if len(sys.argv) > 2 else 4e5), f"127.0.0.1:{port}")


if __name__ == "__main__":
    main()

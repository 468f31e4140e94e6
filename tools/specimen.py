#!/usr/bin/env python3
"""A specimen that speaks the Gusset wire protocol (tools/PROTOCOL.md) over TCP, complete, in one file.

It is a spring: derive your specimen from the class `Rig` and give it to `main` (`gusset new NAME --template python` writes an
example). One axis, metres and newtons, no key.

    python3 specimen.py [PORT [STIFFNESS_N_PER_M]]
"""

import hashlib
import os
import select
import socket
import struct
import sys
import threading
import time
import zlib

COMMAND, MEASUREMENT, HEARTBEAT, HOLD, RETIRE, GOODBYE, CONTROL = 1, 2, 3, 4, 5, 6, 16
HELLO, WELCOME, REFUSE, ARM, BYE = 0, 1, 2, 3, 4
ORDERLY, WATCHDOG = 0, 3
HELLO_LIMIT, ARM_LIMIT, SEND_LIMIT, MOST = 10, 60, 10, 16  # seconds; connections at the same time
FLAG_SPECIMEN, INTERLOCK, HOLDING, NONE = 2, 1, 2, 2**64 - 1
SIMULATED, KEEPS_STATE = 1, 16  # capabilities
LENGTHS = {COMMAND: 76, HEARTBEAT: 60, HOLD: 52, RETIRE: 52, GOODBYE: 52}
LAYOUT = hashlib.sha256(b"gusset frames 1 axes 1 history 4\naxis 1|m|N\n").digest()
AXIS = struct.pack("<Q6sIIdddd", 6, b"axis 1", 0, 3, -float("inf"), float("inf"), float("inf"), float("inf"))


class Broken(Exception):
    """A frame that fails a check: never move on it."""


class Rig:
    """Your rig. It stays where the last test left it, also for the next controller."""

    def __init__(self, stiffness):
        self.stiffness, self.disp = stiffness, 0.0
        self.taken = threading.Lock()  # by the test that runs
        self.tested = False  # by a test of this process

    def measure(self):
        """Measured displacement and force, called once for each new command; `self.disp` is the command."""
        return self.disp, self.stiffness * self.disp


class Session:
    """One controller, from its hello to its end."""

    def __init__(self, connection, rig):
        self.connection, self.rig = connection, rig
        self.session = self.sent = self.counter = 0
        self.status, self.missed, self.tripped = 0, 0, 0
        self.sequence, self.expected = None, 0  # the command in force, the lowest that may come next
        self.history, self.answer = [], b""
        self.buffer = b""

    def send(self, kind, body):
        self.sent += 1
        length = 32 + len(body) + 4
        n = 1 if kind == MEASUREMENT else 0
        frame = struct.pack("<4sBBHIHHQQ", b"GUST", 1, kind, FLAG_SPECIMEN, length, n, 0, self.session, self.sent) + body
        self.connection.sendall(frame + struct.pack("<I", zlib.crc32(frame)))

    def receive(self, until):
        """The next frame as (kind, body), checked; None if it is not whole by then: half a frame gains no time."""
        while not (frame := self.whole()):
            left = max(0.0, until - time.monotonic())
            if not select.select([self.connection], [], [], left)[0]:
                return None
            more = self.connection.recv(65536)
            if not more:
                raise ConnectionError("the controller closed the connection")
            self.buffer += more
        kind, flags, n, zero, session, counter = struct.unpack_from("<BHxxxxHHQQ", frame, 5)
        if zlib.crc32(frame[:-4]) != struct.unpack("<I", frame[-4:])[0]:
            raise Broken("checksum")
        if flags != 0 or zero != 0 or n != (1 if kind == COMMAND else 0):
            raise Broken("header")
        if session != self.session:
            raise Broken("session")
        if self.session:
            if counter <= self.counter:
                raise Broken("counter")
            self.counter = counter
        return kind, frame[32:-4]

    def whole(self):
        """Cuts one whole frame off the buffer; every length is checked before it is used."""
        if not b"GUST\x01".startswith(self.buffer[:5]) and self.buffer[:5] != b"GUST\x01":
            raise Broken("another protocol or version")
        if len(self.buffer) < 32:
            return None
        kind, length = self.buffer[5], struct.unpack_from("<I", self.buffer, 8)[0]
        right = 40 <= length <= 64036 if kind == CONTROL else length == LENGTHS.get(kind)
        if not right:
            raise Broken("length")
        if len(self.buffer) < length:
            return None
        frame, self.buffer = self.buffer[:length], self.buffer[length:]
        return frame

    def refuse(self, code, text):
        text = text.encode()
        self.send(CONTROL, struct.pack("<IIHHQ", REFUSE, code, 1, 1, len(text)) + text)
        raise Broken(text.decode())

    def announced(self, hello):
        """Takes the limits of the controller: smallest and largest displacement, largest step between two commands."""
        at = 133
        for _ in ("program", "test"):
            at += 8 + struct.unpack_from("<Q", hello, at)[0]
        axes, name = struct.unpack_from("<QQ", hello, at)
        low, high, speed, force = struct.unpack_from("<dddd", hello, at + 16 + name + 8)
        if axes != 1 or at + 16 + name + 8 + 32 != len(hello) or not (low < high and speed > 0 and force > 0):
            self.refuse(12, "one axis with limits that make sense is wanted")
        commands, seconds = struct.unpack_from("<QQ", hello, 105)
        if not commands or not seconds:
            self.refuse(12, "a rate that makes sense is wanted")
        slack = 1e-9 * (high - low) if high - low < float("inf") else 0.0
        self.period = seconds / commands
        self.limits = low - slack, high + slack, speed * self.period * (1 + 1e-9)

    def greet(self):
        """Agrees on everything before anything moves; returns the Arm message."""
        kind, hello = self.receive(time.monotonic() + HELLO_LIMIT) or (None, b"")
        if kind != CONTROL or len(hello) < 149 or struct.unpack_from("<I", hello)[0] != HELLO:
            raise Broken("no hello")
        if self.rig.taken.locked():
            self.refuse(8, "another controller is connected")
        lowest, highest, keyed = struct.unpack_from("<HH?", hello, 100)
        self.watchdog, sampling = struct.unpack_from("<dI", hello, 121)
        if not lowest <= 1 <= highest:
            self.refuse(0, "version 1 is spoken here")
        if keyed:
            self.refuse(9, "no key is configured here")
        if hello[68:100] != LAYOUT:
            self.refuse(3, "one axis called 'axis 1' in m and N is wanted")
        if sampling != 0:
            self.refuse(7, "sampled when the command comes, not later")
        if not 0 < self.watchdog <= 60:
            self.refuse(6, "a watchdog time up to 60 s is wanted")
        self.announced(hello)
        session = int.from_bytes(os.urandom(8), "little") or 1
        name, program = b"spring", b"specimen.py 1"
        welcome = struct.pack("<I32s32s32sQH?IdI", WELCOME, bytes(32), os.urandom(32), LAYOUT, session, 1, False, SIMULATED + (KEEPS_STATE if self.rig.tested else 0), self.watchdog, 0)
        welcome += struct.pack("<QdQd", 1, self.rig.stiffness, 1, self.rig.disp)
        welcome += struct.pack("<Q", len(program)) + program + struct.pack("<Q", len(name)) + name
        welcome += struct.pack("<Q", 1) + AXIS
        self.send(CONTROL, welcome)
        self.session, self.sent = session, 0
        kind, arm = self.receive(time.monotonic() + ARM_LIMIT) or (None, b"")
        if kind == CONTROL and struct.unpack_from("<I", arm)[0] == BYE:
            raise ConnectionError("the controller said goodbye before arming")
        if kind != CONTROL or struct.unpack_from("<I", arm)[0] != ARM:
            raise Broken("no arm message")
        return arm

    def arm(self, message):
        """Arms the session: at the beginning, and again after the wiring check."""
        if len(message) != 36:
            self.refuse(12, "an arm message that is not for one axis")
        _, session, first, axes, start = struct.unpack("<IQQQd", message)
        if session != self.session or axes != 1 or not self.expected <= first < NONE:
            self.refuse(12, "an arm message of another session, or of before")
        if not abs(start - self.rig.disp) <= 1e-9 * abs(self.rig.disp):
            self.refuse(11, "the first command is not where the specimen stands")
        self.sequence, self.expected, self.moved = None, first, time.monotonic()
        self.send(CONTROL, message)

    def command(self, body):
        came = time.monotonic()
        sequence, _time, _dt, disp, vel = struct.unpack("<Qdddd", body)
        if not all(abs(x) < float("inf") for x in (_time, _dt, disp, vel)):
            raise Broken("a number that is not finite")
        if sequence == NONE:
            raise Broken("no command has this number")
        if sequence != self.sequence:
            if sequence < self.expected:
                return  # older than the command in force, or than the Arm message
            gap = sequence - self.expected
            low, high, step = self.limits
            # Lost commands give this one more time, but no more than has really passed.
            steps = min(gap + 1, (came - self.moved) / self.period + 1)
            if not low <= disp <= high or abs(disp - self.rig.disp) > step * steps:
                self.tripped = INTERLOCK  # beyond the announced limits: a fault; hold until the next controller
            if not self.tripped:
                self.rig.disp = disp
            self.missed = min(self.missed + gap, 2**32 - 1)
            self.expected, self.sequence, self.status = sequence + 1, sequence, self.tripped
            self.moved = came
            measured, force = self.rig.measure()
            earlier = (self.history + [(NONE, 0.0)] * 4)[:4]
            self.answer = struct.pack("<dd", measured, force) + b"".join(struct.pack("<Qd", *e) for e in earlier)
            self.history = [(sequence, force)] + self.history[:3]
        head = struct.pack("<QddII", self.sequence, came, time.monotonic() - came, self.status, self.missed)
        self.send(MEASUREMENT, head + self.answer)

    def serve(self):
        self.connection.settimeout(SEND_LIMIT)
        arm = self.greet()
        if not self.rig.taken.acquire(blocking=False):
            self.refuse(8, "another controller has armed")
        try:
            self.arm(arm)
            self.rig.tested = True
            ended, cause = self.test()
        finally:
            self.rig.taken.release()
        if cause is not None:
            self.send(GOODBYE, struct.pack("<QII", self.sequence or 0, cause, 0))
        return ended

    def test(self):
        """Runs from the arming to the end. Returns how it ended, and the cause of the goodbye to send, if any."""
        paused = False
        received_at = reported_at = time.monotonic()
        gone = max(30, 10 * self.watchdog)
        while True:
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
                self.command(body)
            elif kind == HOLD:
                paused = True
            elif kind == RETIRE:
                return "retired", ORDERLY
            elif kind == CONTROL and struct.unpack_from("<I", body)[0] == ARM:
                paused = False
                self.arm(body)
            elif kind in (GOODBYE, CONTROL):
                return "the controller said goodbye", None


def attend(connection, peer, rig):
    with connection:
        try:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            print(peer, Session(connection, rig).serve(), file=sys.stderr)
        except (Broken, OSError, OverflowError, struct.error) as reason:
            print(peer, "ended:", reason, file=sys.stderr)


def main(rig=None):
    """Serves `rig`, or the spring of the command line, until the program is ended."""
    port = int(sys.argv[1]) if len(sys.argv) > 1 else 4823
    rig = rig or Rig(float(sys.argv[2]) if len(sys.argv) > 2 else 4e5)
    listener = socket.create_server(("127.0.0.1", port))
    print("listening on 127.0.0.1:%d" % listener.getsockname()[1], flush=True)
    while True:
        connection, peer = listener.accept()
        if threading.active_count() > MOST:
            connection.close()
            continue
        # One thread for each connection, so that a second controller is refused at once.
        threading.Thread(target=attend, args=(connection, peer, rig), daemon=True).start()


if __name__ == "__main__":
    main()

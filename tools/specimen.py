#!/usr/bin/env python3
"""A specimen that speaks the Gusset wire protocol (tools/PROTOCOL.md) over TCP, complete, in one file.

It is a spring: replace `measure` by your rig. One axis, metres and newtons, no key.

    python3 specimen.py PORT [STIFFNESS_N_PER_M]
"""

import hashlib
import os
import socket
import struct
import sys
import time
import zlib

COMMAND, MEASUREMENT, HEARTBEAT, HOLD, RETIRE, GOODBYE, CONTROL = 1, 2, 3, 4, 5, 6, 16
HELLO, WELCOME, REFUSE, ARM, BYE = 0, 1, 2, 3, 4
FLAG_SPECIMEN, INTERLOCK, HOLDING, NONE = 2, 1, 2, 2**64 - 1
LENGTHS = {COMMAND: 76, HEARTBEAT: 60, HOLD: 52, RETIRE: 52, GOODBYE: 52}
LAYOUT = hashlib.sha256(b"gusset frames 1 axes 1 history 4\naxis 1|m|N\n").digest()
AXIS = struct.pack("<Q6sIIdddd", 6, b"axis 1", 0, 3, -float("inf"), float("inf"), float("inf"), float("inf"))


class Broken(Exception):
    """A frame that fails a check: never move on it."""


class Specimen:
    def __init__(self, connection, stiffness):
        self.connection, self.stiffness = connection, stiffness
        self.session = self.sent = self.heard = 0
        self.disp, self.status, self.missed, self.tripped = 0.0, 0, 0, 0
        self.sequence, self.history, self.answer = None, [], b""
        self.buffer = b""

    def measure(self):
        """Your rig: returns measured displacement and force."""
        return self.disp, self.stiffness * self.disp

    def send(self, kind, body):
        self.sent += 1
        length = 32 + len(body) + 4
        n = 1 if kind == MEASUREMENT else 0
        frame = struct.pack("<4sBBHIHHQQ", b"GUST", 1, kind, FLAG_SPECIMEN, length, n, 0, self.session, self.sent) + body
        self.connection.sendall(frame + struct.pack("<I", zlib.crc32(frame)))

    def receive(self):
        """The next frame as (kind, body), checked; None when the time limit of the socket has passed."""
        while True:
            frame = self.whole()
            if frame:
                break
            try:
                more = self.connection.recv(65536)
            except TimeoutError:
                return None
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
            if counter <= self.heard:
                raise Broken("counter")
            self.heard = counter
        return kind, frame[32:-4]

    def whole(self):
        """Cuts one whole frame off the buffer; every length is checked before it is used."""
        if not b"GUST\x01".startswith(self.buffer[:5]) and self.buffer[:5] != b"GUST\x01":
            raise Broken("another protocol or version")
        if len(self.buffer) < 32:
            return None
        kind, length = self.buffer[5], struct.unpack_from("<I", self.buffer, 8)[0]
        right = 36 < length <= 64036 if kind == CONTROL else length == LENGTHS.get(kind)
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
        """What the controller keeps: smallest and largest displacement, largest step from one command to the next."""
        at = 133
        for _ in ("program", "test"):
            at += 8 + struct.unpack_from("<Q", hello, at)[0]
        axes, name = struct.unpack_from("<QQ", hello, at)
        low, high, speed, _force = struct.unpack_from("<dddd", hello, at + 16 + name + 8)
        if axes != 1 or not (low < high and speed > 0):
            self.refuse(12, "limits that make no sense")
        commands, seconds = struct.unpack_from("<QQ", hello, 105)
        slack = 1e-9 * (high - low) if high - low < float("inf") else 0.0
        return low - slack, high + slack, speed * seconds / commands * (1 + 1e-9)

    def greet(self):
        """Agrees on everything before anything moves."""
        kind, hello = self.receive() or (None, b"")
        if kind != CONTROL or len(hello) < 149 or struct.unpack_from("<I", hello)[0] != HELLO:
            raise Broken("no hello")
        lowest, highest, keyed = struct.unpack_from("<HH?", hello, 100)
        watchdog, sampling = struct.unpack_from("<dI", hello, 121)
        if not lowest <= 1 <= highest:
            self.refuse(0, "version 1 is spoken here")
        if keyed:
            self.refuse(9, "no key is configured here")
        if hello[68:100] != LAYOUT:
            self.refuse(3, "one axis called 'axis 1' in m and N is wanted")
        if sampling != 0:
            self.refuse(7, "sampled when the command comes, not later")
        if not 0 < watchdog <= 60:
            self.refuse(6, "a watchdog time up to 60 s is wanted")
        self.limits = self.announced(hello)
        session = int.from_bytes(os.urandom(8), "little") or 1
        name, program = b"spring", b"specimen.py 1"
        welcome = struct.pack("<I32s32s32sQH?IdI", WELCOME, bytes(32), os.urandom(32), LAYOUT, session, 1, False, 1, watchdog, 0)
        welcome += struct.pack("<QdQd", 1, self.stiffness, 1, self.disp)
        welcome += struct.pack("<Q", len(program)) + program + struct.pack("<Q", len(name)) + name
        welcome += struct.pack("<Q", 1) + AXIS
        self.send(CONTROL, welcome)
        self.session, self.sent, self.watchdog = session, 0, watchdog
        kind, arm = self.receive() or (None, b"")
        if kind == CONTROL and struct.unpack_from("<I", arm)[0] == BYE:
            raise ConnectionError("the controller said goodbye before arming")
        if kind != CONTROL or len(arm) != 36 or struct.unpack_from("<I", arm)[0] != ARM:
            raise Broken("no arm message")
        _, session, self.expected, axes, start = struct.unpack("<IQQQd", arm)
        if session != self.session or axes != 1:
            self.refuse(12, "an arm message of another session")
        if start != self.disp:
            self.refuse(11, "the first command is not where the specimen stands")
        self.send(CONTROL, arm)

    def command(self, body):
        came = time.monotonic()
        sequence, _time, _dt, disp, vel = struct.unpack("<Qdddd", body)
        if not all(abs(x) < float("inf") for x in (_time, _dt, disp, vel)):
            raise Broken("a number that is none")
        if self.sequence is not None and sequence < self.sequence:
            return
        if sequence != self.sequence:
            gap = max(0, sequence - self.expected)
            low, high, step = self.limits
            if not low <= disp <= high or abs(disp - self.disp) > step * (gap + 1):
                self.tripped = INTERLOCK  # beyond what was announced: a fault; stay, until the next controller
            if not self.tripped:
                self.disp = disp
            self.missed += gap
            self.expected, self.sequence, self.status = sequence + 1, sequence, self.tripped
            measured, force = self.measure()
            earlier = (self.history + [(NONE, 0.0)] * 4)[:4]
            self.answer = struct.pack("<dd", measured, force) + b"".join(struct.pack("<Qd", *e) for e in earlier)
            self.history = [(sequence, force)] + self.history[:3]
        head = struct.pack("<QddII", self.sequence, came, time.monotonic() - came, self.status, self.missed)
        self.send(MEASUREMENT, head + self.answer)

    def serve(self):
        self.connection.settimeout(10)
        self.greet()
        self.connection.settimeout(self.watchdog)
        paused = False
        while True:
            frame = self.receive()
            if frame is None:
                if not paused:
                    self.status = self.tripped | HOLDING  # stop the rig here
                    self.send(HEARTBEAT, struct.pack("<QdII", self.sequence or 0, time.monotonic(), self.status, 0))
                continue
            kind, body = frame
            if kind == COMMAND:
                paused = False
                self.command(body)
            elif kind == HOLD:
                paused = True
            elif kind == RETIRE:
                self.send(GOODBYE, struct.pack("<QII", self.sequence or 0, 0, 0))
                return "retired"
            elif kind == CONTROL and struct.unpack_from("<I", body)[0] == ARM:
                self.send(CONTROL, body)  # after commands that only tried which way round we are wired; a rig stays
            elif kind in (GOODBYE, CONTROL):
                return "the controller said goodbye"


def main():
    port, stiffness = int(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 4e5
    listener = socket.create_server(("127.0.0.1", port))
    print("listening on 127.0.0.1:%d" % listener.getsockname()[1], flush=True)
    while True:
        connection, peer = listener.accept()
        with connection:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                print(peer, Specimen(connection, stiffness).serve(), file=sys.stderr)
            except (Broken, OSError) as reason:
                print(peer, "ended:", reason, file=sys.stderr)


if __name__ == "__main__":
    main()

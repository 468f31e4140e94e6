"""The server of a specimen in Python, frame by frame, as tools/PROTOCOL.md describes it."""

import hashlib
import math
import socket
import struct
import subprocess
import sys
import threading
import time
import zlib

import pytest

import gusset
from conftest import ROOT, Spring

COMMAND, MEASUREMENT, HEARTBEAT, HOLD, RETIRE, GOODBYE, CONTROL = 1, 2, 3, 4, 5, 6, 16
STIFFNESS = 1000.0
EMPTY = 2**64 - 1


class Counting(Spring):
    """Counts its calls: it is used itself, because it has `reset`."""

    def reset(self):
        self.calls = 0

    def respond(self, time, disp, vel):
        self.calls += 1
        return super().respond(time, disp, vel)


class Controller:
    """A controller that writes frames by hand."""

    def __init__(self, address, axes=1, watchdog=5.0, limits=(-math.inf, math.inf, math.inf, math.inf), units=(0, 3)):
        host, port = address.split(":")
        self.socket = socket.create_connection((host, int(port)))
        self.socket.settimeout(10)
        self.session = self.counter = 0
        self.axes, self.watchdog, self.limits, self.units = axes, watchdog, limits, units

    def frame(self, kind, body, n=0):
        self.counter += 1
        head = struct.pack("<4sBBHIHHQQ", b"GUST", 1, kind, 0, 36 + len(body), n, 0, self.session, self.counter)
        return head + body + struct.pack("<I", zlib.crc32(head + body))

    def send(self, kind, body, n=0):
        self.socket.sendall(self.frame(kind, body, n))

    def receive(self):
        """The next frame as (kind, body)."""
        head = self.exactly(32)
        kind, length, n = head[5], struct.unpack_from("<I", head, 8)[0], struct.unpack_from("<H", head, 12)[0]
        rest = self.exactly(length - 32)
        assert struct.unpack("<I", rest[-4:])[0] == zlib.crc32(head + rest[:-4])
        assert struct.unpack_from("<H", head, 6)[0] == 2, "written by the specimen"
        assert n == (self.axes if kind == MEASUREMENT else 0)
        return kind, rest[:-4]

    def exactly(self, count):
        data = b""
        while len(data) < count:
            more = self.socket.recv(count - len(data))
            if not more:
                raise EOFError
            data += more
        return data

    def hello(self):
        names = ["m", "mm", "rad", "N", "kN", "N*m", "kN*m"]
        units = f"{names[self.units[0]]}|{names[self.units[1]]}"
        layout = f"gusset frames 1 axes {self.axes} history 4\n" + "".join(f"a{i}|{units}\n" for i in range(self.axes))
        body = struct.pack("<I32s32s32sHH?", 0, bytes(32), bytes(32), hashlib.sha256(layout.encode()).digest(), 1, 1, False)
        body += struct.pack("<QQdI", 100, 1, self.watchdog, 0) + text("test") + text("hand") + struct.pack("<Q", self.axes)
        for axis in range(self.axes):
            body += text(f"a{axis}") + struct.pack("<IIdddd", *self.units, *self.limits)
        self.send(CONTROL, body)
        kind, answer = self.receive()
        assert kind == CONTROL
        if struct.unpack_from("<I", answer)[0] == 2:
            code, _, _, size = struct.unpack_from("<IHHQ", answer, 4)
            raise PermissionError(code, answer[20 : 20 + size].decode())
        self.session, self.counter = struct.unpack_from("<Q", answer, 100)[0], 0
        return answer

    def arm(self, first=0, start=0.0):
        message = struct.pack(f"<IQQQ{self.axes}d", 3, self.session, first, self.axes, *[start] * self.axes)
        self.send(CONTROL, message)
        return self.receive() == (CONTROL, message)

    def command(self, sequence, disp, vel=0.0, time=0.0):
        values = [disp] * self.axes + [vel] * self.axes
        return self.frame(COMMAND, struct.pack(f"<Qdd{2 * self.axes}d", sequence, time, 0.01, *values), self.axes)

    def measurement(self):
        """The next measurement: (sequence, status, missed, displacement, force, history)."""
        kind, body = self.receive()
        assert kind == MEASUREMENT
        sequence, _, _, status, missed, disp, force = struct.unpack_from("<QddIIdd", body)
        return sequence, status, missed, disp, force, list(struct.iter_unpack("<Qd", body[48:]))


def text(value):
    return struct.pack("<Q", len(value)) + value.encode()


@pytest.fixture
def specimen():
    return Counting(STIFFNESS)


@pytest.fixture
def server(specimen):
    with gusset.Server(specimen, "127.0.0.1:0", "hand") as server:
        yield server


@pytest.fixture
def controller(server):
    one = Controller(server.address)
    one.hello()
    assert one.arm()
    yield one
    one.socket.close()


def test_measurement_has_force_and_history(controller):
    for sequence in range(6):
        controller.socket.sendall(controller.command(sequence, 0.1 * sequence))
        answer = controller.measurement()
    history = [(number, STIFFNESS * (0.1 * number)) for number in (4, 3, 2, 1)]
    assert answer == (5, 0, 0, 0.5, STIFFNESS * 0.5, history)


def test_first_measurement_has_an_empty_history(controller):
    controller.socket.sendall(controller.command(0, 0.25))
    assert controller.measurement() == (0, 0, 0, 0.25, 250.0, [(EMPTY, 0.0)] * 4)


def test_repeated_command_is_answered_without_motion(controller, specimen):
    controller.socket.sendall(controller.command(0, 0.1))
    first = controller.measurement()
    controller.socket.sendall(controller.command(0, 0.3))
    assert controller.measurement() == first
    assert specimen.calls == 1


def test_overtaken_command_is_ignored_and_gaps_are_counted(controller, specimen):
    controller.socket.sendall(controller.command(4, 0.1) + controller.command(2, 0.9) + controller.command(5, 0.2))
    assert controller.measurement()[:4] == (4, 0, 4, 0.1)
    assert controller.measurement()[:4] == (5, 0, 4, 0.2)
    assert specimen.calls == 2


@pytest.mark.parametrize("size", [1, 7, 33, 75])
def test_frames_arrive_in_pieces(controller, size):
    data = controller.command(0, 0.1) + controller.command(1, 0.2)
    for place in range(0, len(data), size):
        controller.socket.sendall(data[place : place + size])
        time.sleep(0.001)
    assert controller.measurement()[0] == 0
    assert controller.measurement()[0] == 1
    controller.socket.sendall(controller.command(2, 0.3))
    assert controller.measurement()[:4] == (2, 0, 0, 0.3)


@pytest.mark.parametrize("is_alone", [True, False])
@pytest.mark.parametrize("place", range(0, 76, 5))
def test_damaged_command_closes_the_connection(controller, specimen, place, is_alone):
    frame = bytearray(controller.command(0, 0.1))
    frame[place] ^= 0x10
    controller.socket.sendall(frame if is_alone else frame + controller.command(1, 0.2))
    controller.socket.shutdown(socket.SHUT_WR)
    with pytest.raises((EOFError, ConnectionError)):
        controller.receive()
    assert specimen.calls == 0


@pytest.mark.parametrize("disp", [math.nan, math.inf, -math.inf])
def test_command_that_is_no_number_closes_the_connection(controller, specimen, disp):
    controller.socket.sendall(controller.command(0, disp))
    with pytest.raises((EOFError, ConnectionError)):
        controller.receive()
    assert specimen.calls == 0


def test_old_counter_closes_the_connection(controller, specimen):
    frame = controller.command(0, 0.1)
    controller.socket.sendall(frame)
    controller.measurement()
    controller.socket.sendall(frame)
    with pytest.raises((EOFError, ConnectionError)):
        controller.receive()


def test_command_beyond_the_announced_limits_stops_the_specimen(server, specimen):
    one = Controller(server.address, limits=(-0.1, 0.1, 1.0, 1e3))
    one.hello()
    assert one.arm()
    one.socket.sendall(one.command(0, 0.005))
    assert one.measurement()[:4] == (0, 0, 0, 0.005)
    one.socket.sendall(one.command(1, 0.05))  # 45 mm in 10 ms, allowed are 1 m/s
    assert one.measurement()[:4] == (1, 1, 0, 0.005)
    one.socket.sendall(one.command(2, 0.006))
    assert one.measurement()[:4] == (2, 1, 0, 0.005)
    one.socket.close()


def test_silence_is_reported_and_ends(server):
    one = Controller(server.address, watchdog=0.05)
    one.hello()
    assert one.arm()
    one.socket.sendall(one.command(0, 0.1))
    assert one.measurement()[1] == 0
    kind, body = one.receive()
    assert kind == HEARTBEAT and struct.unpack_from("<QdI", body)[::2] == (0, 2)
    one.socket.sendall(one.command(1, 0.2))
    assert one.measurement()[:2] == (1, 0)
    one.socket.close()


def test_hold_has_no_watchdog(server):
    one = Controller(server.address, watchdog=0.05)
    one.hello()
    assert one.arm()
    one.socket.sendall(one.command(0, 0.1))
    one.measurement()
    one.send(HOLD, struct.pack("<QII", 0, 2, 0))
    time.sleep(0.2)
    one.socket.sendall(one.command(1, 0.1))
    assert one.measurement()[0] == 1
    one.socket.close()


def test_retire_is_answered_with_goodbye(controller):
    controller.socket.sendall(controller.command(3, 0.1))
    controller.measurement()
    controller.send(RETIRE, struct.pack("<QII", 3, 0, 0))
    assert controller.receive() == (GOODBYE, struct.pack("<QII", 3, 0, 0))
    with pytest.raises((EOFError, ConnectionError)):
        controller.receive()


def test_second_controller_is_refused_while_a_test_runs(controller, server):
    with pytest.raises(PermissionError) as refused:
        Controller(server.address).hello()
    assert refused.value.errno == 8
    controller.socket.close()
    deadline = time.monotonic() + 10
    while time.monotonic() < deadline:
        try:
            third = Controller(server.address)
            third.hello()
            break
        except PermissionError:
            time.sleep(0.02)
    assert third.arm()


@pytest.mark.parametrize(("keys", "code", "words"), [({"axes": 2}, 1, "2 axes"), ({"units": (1, 4)}, 2, "not mm and kN")])
def test_wrong_axes_and_units_are_refused(server, keys, code, words):
    with pytest.raises(PermissionError, match=words) as refused:
        Controller(server.address, **keys).hello()
    assert refused.value.errno == code


def test_arm_elsewhere_is_refused(server):
    one = Controller(server.address)
    one.hello()
    message = struct.pack("<IQQQd", 3, one.session, 0, 1, 0.5)
    one.send(CONTROL, message)
    kind, body = one.receive()
    assert kind == CONTROL and struct.unpack_from("<II", body) == (2, 11)


def test_welcome_has_stiffness_and_capabilities(server):
    welcome = Controller(server.address).hello()
    assert struct.unpack_from("<I", welcome, 111)[0] == 1 + 8
    assert struct.unpack_from("<QdQd", welcome, 127) == (1, STIFFNESS, 1, 0.0)


def test_exception_ends_the_session_with_its_reason(place):
    class Failing(gusset.Specimen):
        def respond(self, time, disp, vel):
            raise ConnectionResetError("the valve is closed\nat once")

    with gusset.Server(Failing(), "127.0.0.1:0") as server:
        one = Controller(server.address)
        one.hello()
        assert one.arm()
        one.socket.sendall(one.command(0, 0.1))
        kind, body = one.receive()
        assert kind == CONTROL and struct.unpack_from("<II", body) == (4, 1)
        assert b"ConnectionResetError: the valve is closed at once (line " in body
        assert one.receive()[0] == GOODBYE
        assert isinstance(server.error, ConnectionResetError)


def test_single_file_runs_without_installation_and_keeps_its_position(place):
    file = ROOT / "tools" / "specimen.py"
    # -I and -S: no installed packages, so no NumPy.
    process = subprocess.Popen(
        [sys.executable, "-I", "-S", file, "0", "2500"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        address = process.stdout.readline().split()[-1]
        one = Controller(address)
        welcome = one.hello()
        assert struct.unpack_from("<I", welcome, 111)[0] == 1
        assert one.arm()
        one.socket.sendall(one.command(0, 0.1))
        assert one.measurement()[3:5] == (0.1, 250.0)
        one.send(RETIRE, struct.pack("<QII", 0, 0, 0))
        assert one.receive()[0] == GOODBYE
        two = Controller(address)
        welcome = two.hello()
        assert struct.unpack_from("<I", welcome, 111)[0] == 1 + 16, "keeps its state"
        assert struct.unpack_from("<QdQd", welcome, 127) == (1, 2500.0, 1, 0.1)
    finally:
        process.terminate()
        process.communicate()


def test_close_ends_the_sessions(specimen):
    before = threading.active_count()
    with gusset.Server(specimen, "127.0.0.1:0") as server:
        one = Controller(server.address)
        one.hello()
        assert one.arm()
    with pytest.raises((EOFError, ConnectionError)):
        one.receive()
    deadline = time.monotonic() + 10
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert threading.active_count() <= before

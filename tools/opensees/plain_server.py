#!/usr/bin/env python3
"""A force server as one would write it at first: plain sockets, acknowledgements as the kernel likes them.

It is here to be compared with `gusset serve` (see compare); a linear spring of 8000.
"""
import argparse
import socket
import struct


def take(stream, count):
    data = b""
    while len(data) < count:
        part = stream.recv(count - len(data))
        if not part:
            raise SystemExit(0)
        data += part
    return data


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--stiffness", type=float, default=8000.0)
    a = p.parse_args()
    listener = socket.create_server(("127.0.0.1", 0))
    print(listener.getsockname()[1], flush=True)
    stream, _ = listener.accept()
    n = struct.unpack("<11i", take(stream, 44))[10]
    disp = 0.0
    while True:
        vector = struct.unpack("<%dd" % n, take(stream, 8 * n))
        action = int(vector[0])
        if action == 3:
            disp = vector[1]
        elif action == 99:
            return
        elif 6 <= action <= 15:
            answer = {10: a.stiffness * disp, 12: a.stiffness, 13: a.stiffness}.get(action, 0.0)
            stream.sendall(struct.pack("<%dd" % n, answer, *[0.0] * (n - 1)))


if __name__ == "__main__":
    main()

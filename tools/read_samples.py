#!/usr/bin/env python3
"""Reads samples.bin of a run folder: as a NumPy array, or, without NumPy, as plain lists.

    read_samples.py RUN_DIR [COLUMN ...]      prints the columns (all by default), one line per sound row
"""
import json
import os
import struct
import sys
import zlib
from typing import Any

try:
    import numpy
except ImportError:
    numpy = None  # type: ignore[assignment, unused-ignore]


def read(run_dir: str) -> "dict[str, Any]":
    """Returns {column name: values}, up to the last complete row with a correct checksum."""
    with open(os.path.join(run_dir, "samples.json"), encoding="utf-8") as file:
        layout = json.load(file)
    path, stride, names = os.path.join(run_dir, "samples.bin"), layout["stride"], [c["name"] for c in layout["columns"]]
    with open(path, "rb") as file:
        data = memoryview(file.read())
    count = 0
    while (count + 1) * stride <= len(data):
        record = data[count * stride : (count + 1) * stride]
        if struct.unpack_from("<I4s", record, stride - 8) != (zlib.crc32(record[: stride - 8]), b"ROW\n"):
            break
        count += 1
    if numpy and count:
        rows = numpy.memmap(path, numpy.dtype(layout["numpy_dtype"]), "r", shape=(count,))
        return {name: rows[name] for name in ["sequence"] + names}
    found = list(struct.iter_unpack(f"<Q{len(names)}dI4s", data[: count * stride]))
    return {name: [row[place] for row in found] for place, name in enumerate(["sequence"] + names)}


if __name__ == "__main__":
    columns = read(sys.argv[1])
    wanted = sys.argv[2:] or list(columns)
    print("\t".join(wanted))
    for row in zip(*(columns[name] for name in wanted)):
        print("\t".join(repr(value.item() if numpy and hasattr(value, "item") else value) for value in row))

"""Writes files of programs that could not be run here, by the documentation of their formats.

The particles are those of `make.py`. `pip install numpy blosc`, then `python make_by_documentation.py`.
"""

import gzip
import json
import struct
import zlib

import blosc
import numpy

COUNT = 120
i = numpy.arange(COUNT)
positions = (numpy.stack([i % 4, i // 4 % 5, i // 20], axis=1) / 10.0).astype("<f4")
velocities = (numpy.stack([i, 0 * i, -i], axis=1) / 8.0).astype("<f4")
radii = numpy.full(COUNT, 0.05, "<f4")
ids = (1000 + i).astype("<i4")


# Houdini. Pages of 32 particles; the radius, the fourth number of P, and all of `age` are stored once a page.
PAGE = 32


class Tokens:
    """Binary JSON; names are defined at their first use."""

    TYPES = {"<i1": 0x11, "<i4": 0x13, "<f2": 0x18, "<f4": 0x19}

    def __init__(self):
        self.out = bytearray(b"\x7fNSJb")
        self.names = {}

    def length(self, n):
        self.out += bytes([n]) if n < 0xF1 else b"\xf2" + struct.pack("<H", n)

    def write(self, value):
        if isinstance(value, str):
            if value not in self.names:
                self.names[value] = len(self.names)
                self.out += b"+"
                self.length(self.names[value])
                self.length(len(value))
                self.out += value.encode()
            self.out += b"&"
            self.length(self.names[value])
        elif isinstance(value, bool):
            self.out += b"1" if value else b"0"
        elif isinstance(value, int):
            self.out += b"\x13" + struct.pack("<i", value)
        elif isinstance(value, numpy.ndarray) and value.dtype == bool:
            self.out += b"@\x10"
            self.length(len(value))
            bits = numpy.packbits(value, bitorder="little").tobytes()
            self.out += bits + bytes(-len(bits) % 4)
        elif isinstance(value, numpy.ndarray):
            self.out += bytes([0x40, self.TYPES[value.dtype.str.replace("|", "<")]])
            self.length(len(value))
            self.out += value.tobytes()
        elif isinstance(value, dict):
            self.out += b"{"
            for name, item in value.items():
                self.out += b"\x27" + bytes([len(name)]) + name.encode()
                self.write(item)
            self.out += b"}"
        else:
            self.out += b"["
            for item in value:
                self.write(item)
            self.out += b"]"


def definition(name, kind="numeric"):
    return ["scope", "public", "type", kind, "name", name, "options", {}]


def paged(name, storage, values, packing, constant=()):
    """An attribute in pages, whose parts numbered in `constant` are stored once a page."""
    values = values.reshape(COUNT, -1)
    raw, size = [], values.shape[1]
    for start in range(0, COUNT, PAGE):
        offset = 0
        for part, width in enumerate(packing):
            rows = values[start : start + (1 if part in constant else PAGE), offset : offset + width]
            raw.append(rows.ravel())
            offset += width
    pages = -(-COUNT // PAGE)
    flags = [numpy.full(pages if part in constant else 0, True) for part in range(len(packing))]
    data = ["size", size, "storage", storage, "pagesize", PAGE, "packing", numpy.array(packing, "<i1")]
    if constant:
        data += ["constantpageflags", flags]
    data += ["rawpagedata", numpy.concatenate(raw)]
    return [definition(name), ["size", size, "storage", storage, "values", data]]


def geometry(attributes):
    return [
        "fileversion", "20.5.332", "hasindex", False, "pointcount", COUNT, "vertexcount", 0, "primitivecount", 0,
        "info", {"software": "make_by_documentation.py"},
        "topology", ["pointref", ["indices", numpy.zeros(0, "<i4")]],
        "attributes", ["pointattributes", attributes],
    ]  # fmt: skip


four = numpy.concatenate([positions, numpy.ones((COUNT, 1), "<f4")], axis=1)
name = [definition("name", "string"), ["size", 1, "storage", "int32", "strings", ["water"]]]
tokens = Tokens()
tokens.write(
    geometry(
        [
            paged("P", "fpreal32", four, [3, 1], {1}),
            paged("v", "fpreal16", velocities.astype("<f2"), [3]),
            paged("pscale", "fpreal32", radii, [1], {0}),
            paged("id", "int32", ids, [1]),
            name,
        ]
    )
)
open("houdini.bgeo", "wb").write(tokens.out)


def listed(name, storage, size, key, values):
    values = ["size", size, "storage", storage, key, values.tolist()]
    return [definition(name), ["size", size, "storage", storage, "values", values]]


text = geometry(
    [
        listed("P", "fpreal64", 3, "tuples", positions.astype(float).round(1)),
        listed("v", "fpreal32", 3, "arrays", velocities.T),
        listed("pscale", "fpreal32", 1, "arrays", radii.astype(float).round(2)[None]),
        listed("id", "int32", 1, "tuples", ids[:, None]),
        name,
    ]
)
text[text.index("topology") + 1] = []
open("houdini.geo", "w").write(json.dumps(text))

# Chunks of all compressors that are read, with and without shuffles, and one that is stored.
chunks, offsets, size = [], [], 1024
for start in range(0, len(tokens.out), size):
    codec, shuffle, level = [
        ("blosclz", blosc.SHUFFLE, 9),
        ("lz4", blosc.SHUFFLE, 9),
        ("zlib", blosc.NOSHUFFLE, 9),
        ("blosclz", blosc.NOSHUFFLE, 0),
    ][len(chunks) % 4]
    offsets.append(sum(map(len, chunks)))
    part = bytes(tokens.out[start : start + size])
    chunks.append(blosc.compress(part, typesize=4, clevel=level, shuffle=shuffle, cname=codec))
last = len(tokens.out) - size * (len(chunks) - 1)
index = b"".join(struct.pack(">Q", n) for n in offsets[1:] + [size, last])
packed = b"".join(chunks)
open("houdini.bgeo.sc", "wb").write(b"scf1" + bytes(8) + packed + index + struct.pack(">Q", len(index)) + b"1fcs")


# DualSPHysics: ten particles of a tank among the fluid.
def string(text):
    return struct.pack("<I", len(text)) + text.encode()


def sized(head):
    return struct.pack("<I", len(head)) + head


def item(name, values, arrays=(), items=()):
    body = string("\nVALUES") + struct.pack("<I", len(values))
    for key, (kind, form, value) in values.items():
        body += string(key) + struct.pack("<i", kind)
        body += string(value) if kind == 1 else struct.pack(form, *numpy.atleast_1d(value).tolist())
    head = string("\nITEM\n") + string(name) + bytes(8) + string("%.7E") + string("%.15E")
    head += struct.pack("<III", len(arrays), len(items), len(body))
    return sized(head) + body + b"".join(arrays) + b"".join(items)


def array(name, kind, values):
    data = values.tobytes()
    head = string("\nARRAY") + string(name) + bytes(4) + struct.pack("<iII", kind, len(values), len(data))
    return sized(head) + data


tank = numpy.arange(10)
order = numpy.argsort(numpy.concatenate([i, tank * 13]), kind="stable")
part = item(
    "PART_0005",
    {"Cpart": (8, "<I", 5), "TimeStep": (12, "<d", 0.25), "Npok": (8, "<I", COUNT + 10)},
    [
        array("Idp", 8, numpy.concatenate([ids, tank]).astype("<u4")[order]),
        array("Posd", 23, numpy.concatenate([positions, 9 + tank[:, None] * [1, 1, 1]]).astype("<f8")[order]),
        array("Vel", 22, numpy.concatenate([velocities, numpy.zeros((10, 3))]).astype("<f4")[order]),
        array("Rhop", 11, numpy.full(COUNT + 10, 1000, "<f4")),
    ],
)
case = item(
    "JPartDataBi4",
    {
        "Piece": (8, "<I", 0),
        "CaseName": (1, "", "CaseTank"),
        "Data2d": (2, "<i", 0),
        "CaseNp": (10, "<Q", 1000 + COUNT),
        "CaseNfixed": (10, "<Q", 1000),
        "CaseNmoving": (10, "<Q", 0),
        "CaseNfloat": (10, "<Q", 0),
        "CaseNfluid": (10, "<Q", COUNT),
        "CasePosMin": (23, "<3d", [0, 0, 0]),
        "Dp": (12, "<d", 0.1),
    },
    items=[part],
)
title = b"#FileJBD JPartDataBi4".ljust(58) + b"\n\0"
open("Part_0005.bi4", "wb").write(title + bytes(4) + case)

# Krakatoa: version 1.1, which has metadata after the header.
channels = [("Position", 4, positions), ("Velocity", 3, velocities.astype("<f2")), ("ID", 2, ids.astype("<i8"))]
channels += [("Density", 4, radii)]
columns = [values.reshape(COUNT, -1) for _, _, values in channels]
meta = b"Meta" + struct.pack("<i", 12) + b"unknown data"
head = b"\xc0PRT\r\n\x1a\n" + struct.pack("<i", 56 + len(meta)) + b"Extensible Particle Format".ljust(32, b"\0")
head += struct.pack("<iq", 2, COUNT) + meta + struct.pack("<iii", 4, len(channels), 44)
offset = 0
for (name, kind, _), values in zip(channels, columns):
    head += struct.pack("<32siii", name.encode(), kind, values.shape[1], offset)
    offset += values.shape[1] * values.itemsize
rows = b"".join(values[row].tobytes() for row in range(COUNT) for values in columns)
open("krakatoa.prt", "wb").write(head + zlib.compress(rows))

# mantaflow: one particle more, which is to be deleted.
head = b"PB02" + struct.pack("<6i256sQ", COUNT + 1, 64, 64, 64, 0, 16, b"mantaflow", 0)
rows = b"".join(positions[row].tobytes() + struct.pack("<i", 1) for row in range(COUNT))
rows += struct.pack("<3fi", 9, 9, 9, 1 << 10)
open("mantaflow.uni", "wb").write(gzip.compress(head + rows, mtime=0))

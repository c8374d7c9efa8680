"""World files changed at random or made hostile, whatever their format, each drawn from a generator."""

from __future__ import annotations

import io
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from functools import cache

import numpy as np

from benchmarks.proofs.saved_files import doubled, flipped, overwritten, truncated
from benchmarks.proofs.world_samples import Sample, glb_of_json

_SIZES = (b"0", b"-1", b"65536", b"2147483647", b"4294967295", b"99999999999999999999", b"1e308", b"nan")


def absurd_text(data: bytes, rng: np.random.Generator) -> bytes:
    """Replace a number in the text by an absurd one."""
    numbers = list(re.finditer(rb"-?\d+(\.\d+)?", data[:2048]))
    if not numbers:
        return flipped(data, rng)
    one = numbers[int(rng.integers(len(numbers)))]
    return data[: one.start()] + _SIZES[int(rng.integers(len(_SIZES)))] + data[one.end() :]


def absurd_binary(data: bytes, rng: np.random.Generator) -> bytes:
    """Replace four bytes by a large number in either byte order, or a float that is NaN or infinite."""
    values = (0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 1 << 24, 1 << 16, 0x7FC00000, 0x7F000000, 0)
    start = int(rng.integers(max(1, min(len(data), 4096) - 4)))
    word = struct.pack(("<I", ">I")[int(rng.integers(2))], values[int(rng.integers(len(values)))])
    return data[:start] + word + data[start + 4 :]


def _archive(members: dict[str, bytes]) -> bytes:
    """Return a compressed archive, the same at any time."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _array(kind: str, shape: tuple[int, int], content: bytes) -> bytes:
    """Return a NumPy file whose header states this type and shape, whatever its content."""
    head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117).encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + content


def nested(data: bytes, rng: np.random.Generator) -> bytes:
    """Return an archive with the file in it, in an archive, in an archive."""
    for _ in range(int(rng.integers(1, 4))):
        data = _archive({"elevation.npy" if rng.random() < 0.5 else "../../elevation.npy": data})
    return data


_MOST_EDGE, _USUAL_EDGE, _ONE_IN = 5000, 500, 16
"""Pixels of a side of a PNG that is a bomb, seldom and usually: to read the largest ones takes long."""


@cache
def packed_zeros(count: int) -> bytes:
    """Return this many zeros, compressed: a bomb."""
    return zlib.compress(bytes(count), 9)


def repaired_png(data: bytes, rng: np.random.Generator) -> bytes:
    """Change chunks of a PNG under right checksums, give it a header of absurd size, or a bomb of zeros."""
    if not data.startswith(b"\x89PNG"):
        return flipped(data, rng)
    chunks, at = [], 8
    while at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        chunks.append([data[at + 4 : at + 8], data[at + 8 : at + 8 + length]])
        at += 12 + length
    which = int(rng.integers(4))
    if which == 0:
        edges = [int(2 ** rng.uniform(0, 31)) for _ in range(2)]
        chunks[0][1] = struct.pack(">II", *edges) + chunks[0][1][8:]
    elif which == 1:
        edge = _MOST_EDGE if rng.integers(_ONE_IN) == 0 else _USUAL_EDGE
        chunks[0][1] = struct.pack(">II", edge, edge) + chunks[0][1][8:]
        chunks[1][1] = packed_zeros((edge + 1) * edge)
    elif which == 2:
        chunks.insert(1, [b"zTXt", b"a\0\0" + packed_zeros(1 << 26)])
    else:
        chunk = chunks[int(rng.integers(len(chunks)))]
        chunk[1] = flipped(chunk[1], rng) if chunk[1] else chunk[1]
    body = [struct.pack(">I", len(c)) + k + c + struct.pack(">I", zlib.crc32(k + c)) for k, c in chunks]
    return data[:8] + b"".join(body)


def repaired_zip(data: bytes, rng: np.random.Generator) -> bytes:
    """Return changed arrays in a sound archive; a bomb of zeros; a pickle that would write a file."""
    if not data.startswith(b"PK"):
        return overwritten(data, rng)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    which, name = int(rng.integers(4)), list(members)[int(rng.integers(len(members)))]
    if which == 0:
        shape = int(2 ** rng.uniform(0, 40)), int(2 ** rng.uniform(0, 40))
        members[name] = _array("<f8", shape, bytes(64))
    elif which == 1:
        return _archive_of_zeros(data, name)
    elif which == 2:
        buffer = io.BytesIO()
        np.save(buffer, np.array(_Pickled(), dtype=object), allow_pickle=True)
        members[name] = buffer.getvalue()
    else:
        members[name] = flipped(members[name], rng)
    return _archive(members)


@cache
def _archive_of_zeros(data: bytes, name: str) -> bytes:
    """Return an archive in which one array claims to be far larger than its content, which is zeros."""
    edge = 20_000
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {each: archive.read(each) for each in archive.namelist()}
    return _archive({**members, name: _array("|u1", (edge, edge), bytes(edge * edge // 16))})


class _Pickled:
    """Unpickled, it would leave a file beside the map."""

    def __reduce__(self) -> tuple:
        return (exec, ("open('executed', 'w').close()",))


def hostile_yaml(data: bytes, rng: np.random.Generator) -> bytes:
    """Insert tags that would run code, growing aliases, images that lie elsewhere, or deep nesting."""
    if b"image:" not in data[:4096]:
        return absurd_text(data, rng)
    bomb = b"a: &a [x, x, x, x, x, x, x, x, x]\n"
    for one, next_one in zip(b"abcdefghi", b"bcdefghij", strict=True):
        bomb += (
            bytes([next_one]) + b": &" + bytes([next_one]) + b" [" + b", ".join([b"*%c" % one] * 9) + b"]\n"
        )
    texts = (
        re.sub(rb"image: .*", b"image: !!python/object/apply:os.system ['touch executed']", data),
        re.sub(rb"image: .*", b"image: !!python/object/new:os.system [touch executed]", data),
        b"!!python/name:os.system\n" + data,
        bomb + data,
        bomb + re.sub(rb"resolution: .*", b"resolution: *j", data),
        b"<<: [{a: 1}, {b: 2}]\n" + data,
        re.sub(rb"image: .*", b"image: ../outside.pgm", data),
        re.sub(rb"image: .*", b"image: sub/../../outside.pgm", data),
        re.sub(rb"image: .*", b"image: link.pgm", data),
        re.sub(rb"image: .*", b"image: linked/outside.pgm", data),
        re.sub(rb"image: .*", b"image: /etc/passwd", data),
        re.sub(rb"image: .*", b"image: /dev/zero", data),
        re.sub(rb"image: .*", b"image: map.yaml", data),
        re.sub(rb"image: .*", b"image: .", data),
        re.sub(rb"image: .*", b'image: "plan.pgm\\0.png"', data),
        re.sub(rb"origin: .*", b"origin: " + b"[" * 3000, data),
        re.sub(rb"resolution: .*", b"resolution: " + b"9" * 5000, data),
        re.sub(rb"resolution: .*", b"resolution: 1e-300", data),
        re.sub(rb"mode: .*", (b"mode: raw", b"mode: scale", b"mode: [1]")[int(rng.integers(3))], data),
    )
    return texts[int(rng.integers(len(texts)))]


def hostile_glb(data: bytes, rng: np.random.Generator) -> bytes:
    """Return references to files elsewhere, meshes repeated without end, accessors of absurd size."""
    if not data.startswith(b"glTF"):
        return absurd_binary(data, rng)
    which = int(rng.integers(3))
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": 36}]
    part = {"attributes": {"POSITION": 0}, "mode": 4}
    count = (3, 1 << 31, 1 << 40)[which]
    about = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 36, **({"uri": "../outside.pgm"} if rng.random() < 0.5 else {})}],
        "bufferViews": views,
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}],
        "meshes": [{"primitives": [part]}],
        "nodes": [{"children": [i + 1] * 8, "mesh": 0} for i in range(12)] + [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    return glb_of_json(about, np.random.default_rng(0).random(9).astype("<f4").tobytes())


def drawn_octree(data: bytes, rng: np.random.Generator) -> bytes:
    """Return an OctoMap tree of drawn nodes under the same head, some too deep, its size seldom wrong."""
    head, found, _ = data.partition(b"\ndata\n")
    if not (found and head.startswith(b"# Octomap OcTree")):
        return absurd_binary(data, rng)
    binary = head.startswith(b"# Octomap OcTree binary")
    narrow, deepest = int(rng.integers(8, 16)), (16, 16, 15, 18)[int(rng.integers(4))] - binary
    nodes, stored, waiting = 0, bytearray(), [0]  # the levels of the nodes to come
    while waiting:
        level = waiting.pop()
        inner = (rng.random(8) < 0.2) & (narrow <= level < deepest) & (len(stored) < 4000)
        leaves = (rng.random(8) < 0.3) & ~inner & (narrow <= level)
        inner[int(rng.integers(8))] |= level < deepest and not waiting
        if binary:
            pairs = np.where(inner, 3, np.where(leaves, rng.integers(1, 3, 8), 0))
            stored += int((pairs << np.arange(0, 16, 2)).sum()).to_bytes(2, "little")
            nodes += int((leaves & ~inner).sum())
        else:
            leaves &= level < deepest
            stored += struct.pack("<fB", rng.normal(), int(((inner | leaves) << np.arange(8)).sum()))
            waiting += [deepest] * int((leaves & ~inner).sum())
        nodes += 1
        waiting += [level + 1] * int(inner.sum())
    size = nodes + int(rng.integers(-1, 2)) * int(rng.random() < 0.2)
    return re.sub(rb"\nsize .*", b"\nsize %d" % size, head) + b"\ndata\n" + bytes(stored)


MUTATORS: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    truncated,
    flipped,
    overwritten,
    absurd_text,
    absurd_binary,
    doubled,
    nested,
    repaired_png,
    repaired_zip,
    hostile_yaml,
    hostile_glb,
    drawn_octree,
)


def mutant(sources: list[Sample], number: int, rng: np.random.Generator) -> tuple[str, dict[str, bytes]]:
    """Return one of the samples, by its number, with a drawn change, and the name of the change."""
    files, mutate = sources[number % len(sources)].files, MUTATORS[int(rng.integers(len(MUTATORS)))]
    target, *others = files
    if others and mutate is not hostile_yaml and rng.random() < 0.5:
        target = others[0]
    changed = mutate(files[target], rng)
    if changed and rng.random() < 0.2:
        changed = flipped(changed, rng)
    return mutate.__name__, {**files, target: changed}

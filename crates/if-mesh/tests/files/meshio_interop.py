#!/usr/bin/env python3
"""Checks with meshio that what if-mesh writes can be read by others, and the reverse.

    meshio_interop.py ROUNDTRIP [FOLDER]

ROUNDTRIP is the built example `ply_roundtrip` (cargo build -p if-mesh --example ply_roundtrip). meshio writes meshes of every kind, ROUNDTRIP reads and
writes them, meshio reads the result: points, cells and point data must be the same. Files that meshio cannot read (big endian, other types and
orders, unknown elements, CRLF) go through ROUNDTRIP, and then meshio reads them. With FOLDER, all .ply files below it go the same way.
Also measures displacement and strain of two meshes as the project's referee does, and prints them for the Rust test: meshio_interop.py --cost BEFORE AFTER.
Exit status 0 where all agree. Needs: pip install numpy meshio==5.3.5
"""
import pathlib, subprocess, sys, tempfile
import numpy as np
import meshio


def read_with_meshio(path):
    m = meshio.read(path, file_format="ply")
    return m.points, [(c.type, np.asarray(c.data)) for c in m.cells], m.point_data


def same(a, b, what):
    (pa, ca, da), (pb, cb, db) = a, b
    assert pa.dtype.newbyteorder("=") == pb.dtype.newbyteorder("="), f"{what}: points are {pa.dtype}, then {pb.dtype}"
    assert pa.astype(pa.dtype.newbyteorder("=")).tobytes() == pb.astype(pb.dtype.newbyteorder("=")).tobytes(), f"{what}: points differ"
    assert [t for t, _ in ca] == [t for t, _ in cb], f"{what}: cells are {[t for t, _ in ca]}, then {[t for t, _ in cb]}"
    for (_, x), (_, y) in zip(ca, cb):
        assert (x == y).all(), f"{what}: cells differ"
    assert list(da) == list(db), f"{what}: point data {list(da)}, then {list(db)}"
    for name in da:
        x, y = np.asarray(da[name]), np.asarray(db[name])
        if x.dtype == np.int8:  # meshio reads `uchar` as signed
            x, y = x.view(np.uint8), y.astype(np.uint8)
        assert x.shape == y.shape and (x == y).all(), f"{what}: point data {name} differs"


def roundtrip(program, path, out, *flags):
    subprocess.run([program, str(path), str(out), *flags], check=True)


def made(folder):
    """Meshes of every kind that meshio can write, as (name, path)."""
    rng = np.random.default_rng(1)
    n = 40
    tri, quad = rng.permuted(np.tile(np.arange(n), (30, 1)), axis=1)[:, :3], rng.permuted(np.tile(np.arange(n), (20, 1)), axis=1)[:, :4]
    penta = rng.permuted(np.tile(np.arange(n), (10, 1)), axis=1)[:, :5]
    kinds = {"triangles": [("triangle", tri)], "quads": [("quad", quad)], "mixed": [("triangle", tri), ("quad", quad), ("triangle", tri[:5])], "polygons": [("polygon", penta)]}
    for real in (np.float32, np.float64):
        points = rng.normal(size=(n, 3)).astype(real)
        for kind, cells in kinds.items():
            for binary in (True, False):
                data = {f"p{k}": (rng.integers(0, 100, n)).astype(t) for k, t in enumerate(["int8", "uint8", "uint16", "int32", "uint32", "float32", "float64"])}
                if kind == "polygons" and not binary:
                    data = {}
                if not binary:  # meshio prints numpy scalars; keep what it can read back itself
                    data = {k: v for k, v in data.items()}
                path = folder / f"{kind}_{np.dtype(real).name}_{'binary' if binary else 'ascii'}.ply"
                cells32 = [(t, c.astype(np.int32)) for t, c in cells]
                meshio.ply.write(path, meshio.Mesh(points, cells32, point_data=data), binary=binary)
                yield path


def odd(folder):
    """Files that our reader takes and meshio does not, as (path, points, cells): by hand, as no writer makes them."""
    header = lambda form, v, f, extra="": f"ply\nformat {form} 1.0\n{v}{f}{extra}end_header\n".encode()
    xyz = "element vertex 4\nproperty {0} x\nproperty {0} y\nproperty {0} z\n"
    face = "element face 2\nproperty list {0} {1} {2}\n"
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    faces = [[0, 1, 2], [3, 2, 1]]

    def binary(order, real, count, index):
        rows = b"".join(np.array([len(f)], order + count).tobytes() + np.array(f, order + index).tobytes() for f in faces)
        return points.astype(order + real).tobytes() + rows

    ascii_rows = "".join(" ".join(f"{x:g}" for x in p) + "\n" for p in points)
    ascii_faces = "".join(f"3 {' '.join(map(str, f))}\n" for f in faces)
    names = {"f4": ["float", "float32"], "f8": ["double", "float64"], "u1": ["uchar", "uint8"], "i1": ["char", "int8"], "i2": ["short", "int16"],
             "u2": ["ushort", "uint16"], "i4": ["int", "int32"], "u4": ["uint", "uint32"], "i8": ["int64"], "u8": ["uint64"]}
    files = {}
    for order, form in (("<", "binary_little_endian"), (">", "binary_big_endian")):
        for real in ("f4", "f8"):
            for count in ("u1", "i1", "u2", "i4", "u4"):
                for index in ("i2", "u2", "i4", "u4", "i8", "u8"):
                    for k in range(max(len(names[t]) for t in (real, count, index))):
                        a, b, c = (names[t][k % len(names[t])] for t in (real, count, index))
                        word = ("vertex_index", "vertex_indices")[k]
                        files[f"{form} {a} {b} {c} {word}"] = header(form, xyz.format(a), face.format(b, c, word)) + binary(order, real, count, index)
    f4 = header("ascii", xyz.format("float"), face.format("uchar", "int", "vertex_index"))
    files["ascii"] = f4 + (ascii_rows + ascii_faces).encode()
    files["ascii, CRLF"] = (f4 + (ascii_rows + ascii_faces).encode()).replace(b"\n", b"\r\n")
    files["faces first"] = header("ascii", face.format("uchar", "int", "vertex_index"), xyz.format("float")) + (ascii_faces + ascii_rows).encode()
    other = "element camera 2\nproperty int64 id\nproperty list uchar double pose\n"
    files["unknown element"] = header("ascii", xyz.format("double"), other, face.format("uint", "uint", "vertex_indices")) + (ascii_rows + "7 2 0.5 1\n8 0\n" + ascii_faces).encode()
    files["nan and inf beside"] = header("ascii", xyz.format("float") + "property float quality\n", face.format("uchar", "int", "vertex_indices")) + (
        "".join(line + q + "\n" for line, q in zip(ascii_rows.splitlines(), (" nan", " inf", " -inf", " 1"))) + ascii_faces).encode()
    for name, data in files.items():
        path = folder / "odd.ply"
        path.write_bytes(data)
        yield name, path, points, faces


def cost(before, after):
    """as referee.py"""
    b, a = meshio.read(before), meshio.read(after)
    V0, V1 = np.asarray(b.points, float), np.asarray(a.points, float)
    F = np.concatenate([c.data for c in b.cells if c.type == "triangle"]).astype(np.int64)
    d = np.linalg.norm(V1 - V0, axis=1) * 1e3
    E = np.unique(np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), 1), axis=0)
    l0, l1 = (np.linalg.norm(V[E[:, 0]] - V[E[:, 1]], axis=1) for V in (V0, V1))
    s = np.abs(l1 / np.maximum(l0, 1e-12) - 1) * 100
    print(*map(repr, map(float, (d.mean(), np.percentile(d, 95), d.max(), np.sqrt((s**2).mean()), np.percentile(s, 99), s.max()))))


def main():
    if sys.argv[1] == "--cost":
        return cost(*sys.argv[2:4])
    program, count = sys.argv[1], 0
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        files = list(made(folder)) + (sorted(pathlib.Path(sys.argv[2]).rglob("*.ply")) if len(sys.argv) > 2 else [])
        for path in files:
            out = folder / "out.ply"
            first = read_with_meshio(path)
            roundtrip(program, path, out)
            same(first, read_with_meshio(out), path.name)
            roundtrip(program, out, folder / "again.ply", "portable")
            assert out.read_bytes() == (folder / "again.ply").read_bytes(), f"{path.name}: portable differs although all of it is"
            roundtrip(program, out, folder / "wide.ply", "double")
            assert (read_with_meshio(folder / "wide.ply")[0] == first[0].astype(float)).all(), f"{path.name}: double differs"
            count += 1
        for name, path, points, faces in odd(folder):
            out = folder / "out.ply"
            roundtrip(program, path, out, "portable")
            p, cells, data = read_with_meshio(out)
            assert (p == points).all() and [t for t, _ in cells] == ["triangle"], f"{name}: {p} {cells}"
            assert (cells[0][1] == faces).all(), f"{name}: {cells}"
            if "nan" in name:
                assert np.array_equal(np.asarray(data["quality"]), np.array([np.nan, np.inf, -np.inf, 1], np.float32), equal_nan=True), name
            count += 1
    print(f"{count} files survive if-mesh and meshio {meshio.__version__}")


main()

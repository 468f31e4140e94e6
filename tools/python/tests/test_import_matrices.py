"""Matrices of other programs: formats, units, names, and what is refused. Libraries write the files, if there are any."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import scipy.io
import scipy.sparse

import gusset
from gusset.importer.__main__ import main

# Cantilever of two nodes with x, y and rz: mass in t, stiffness in kN and m, damping.
M = np.diag([2.0, 2.0, 0.5, 1.0, 1.0, 0.25])
K = np.array(
    [
        [900.0, 0.0, 0.0, -450.0, 0.0, 0.0],
        [0.0, 96.0, 0.0, 0.0, -48.0, 72.0],
        [0.0, 0.0, 288.0, 0.0, -72.0, 72.0],
        [-450.0, 0.0, 0.0, 450.0, 0.0, 0.0],
        [0.0, -48.0, -72.0, 0.0, 48.0, -72.0],
        [0.0, 72.0, 72.0, 0.0, -72.0, 144.0 + 1.0 / 3.0],
    ]
)
C = 0.01 * K + 0.1 * M
PLANE = ["x", "y", "rz"]
ABAQUS = {"x": 1, "y": 2, "z": 3, "rx": 4, "ry": 5, "rz": 6}


def convert(files, out="model", **more):
    """Runs the importer in this process. Returns its exit code."""
    options = {"source": "matrices", "files": [str(file) for file in files], "units": "kN,m,s", "direction": "x", "out": out}
    options.update(dict.fromkeys(("mass", "stiffness", "damping", "dofs")), **more)
    return main(json.dumps(options))


def written(name, out="model"):
    matrix = scipy.io.mmread(f"{out}/{name}.mtx")
    return np.asarray(matrix.todense() if scipy.sparse.issparse(matrix) else matrix)


def names(out="model"):
    return [line.split(",") for line in open(f"{out}/dofs.csv").read().split()[1:]]


def lower(matrix):
    """Entries of the lower triangle, from 1."""
    return [(i + 1, j + 1, matrix[i, j]) for i in range(len(matrix)) for j in range(i + 1) if matrix[i, j] != 0]


def labelled(path, matrix, nodes=(7, 12), part=np.tril):
    """A file of Abaqus, FORMAT=MATRIX INPUT."""
    ends = [(node, ABAQUS[direction]) for node in nodes for direction in PLANE]
    rows, columns = np.nonzero(part(matrix))
    lines = [f"{ends[i][0]},{ends[i][1]}, {ends[j][0]},{ends[j][1]}, {matrix[i, j]:.17e}" for i, j in zip(rows, columns)]
    path.write_text("\n".join(lines) + "\n")


def harwell_boeing(path, matrix, rhs=False, touching=False, title=""):
    """A file of ANSYS: symmetric, one number in a line, Fortran's D for the exponent. Or three numbers in a line that may touch."""
    columns = [[(i, matrix[i, j]) for i in range(j, len(matrix)) if matrix[i, j] != 0] for j in range(len(matrix))]
    pointers = np.cumsum([1] + [len(column) for column in columns])
    count = int(pointers[-1] - 1)
    values = [f"{value:22.15E}".replace("E", "D") for column in columns for _, value in column]
    if touching:
        values = ["".join(values[at : at + 3]) for at in range(0, count, 3)]
    extra = len(matrix) if rhs else 0
    head = [
        f"{title:80s}",
        "".join(
            f"{number:14d}" for number in (len(pointers) + count + len(values) + extra, len(pointers), count, len(values), extra)
        ),
        "RSA" + " " * 11 + "".join(f"{number:14d}" for number in (len(matrix), len(matrix), count, 0)),
        f"(1I14)          (1I14)          (1P,{3 if touching else 1}D22.15)        (1D22.15)",
    ]
    if rhs:
        head.append("F" + " " * 13 + f"{1:14d}{0:14d}")
    lines = [f"{number:14d}" for number in pointers]
    lines += [f"{i + 1:14d}" for column in columns for i, _ in column]
    lines += values + [f"{0.5:22.15E}".replace("E", "D")] * extra
    path.write_text("\n".join(head + lines) + "\n")


def sap(path, matrix):
    path.write_text("Row\tColumn\tValue\n" + "".join(f"{i}\t{j}\t{value:.17g}\n" for i, j, value in lower(matrix)))


@pytest.fixture(
    params=[
        "array",
        "coordinate",
        "mat",
        "mat 7.3",
        "abaqus",
        "abaqus both",
        "abaqus upper",
        "coordinates",
        "hb",
        "hb rhs",
        "hb touching",
        "hb scipy",
        "sap",
    ]
)
def files(request, place):
    """The three matrices in one format, and whether that has names."""
    kind = request.param
    roles = {"mass": M, "stiffness": K, "damping": C}
    if kind == "mat":
        scipy.io.savemat(
            "model.mat", {"M": scipy.sparse.csc_array(M), "K": K, "C": C, "m": 3.0, "title": "a bridge", "coordinates": K[:, :3]}
        )
        return ["model.mat"], False
    if kind == "mat 7.3":
        h5py = pytest.importorskip("h5py")
        with h5py.File("model.mat", "w", userblock_size=512) as file:
            file["K"] = K.T
            file["title"] = np.array([[97], [98]], dtype=np.uint16)
            for name, matrix in (("M", M), ("C", C)):
                sparse = scipy.sparse.csc_array(matrix)
                group = file.create_group(name)
                group.attrs["MATLAB_sparse"] = np.uint64(6)
                group["data"], group["ir"], group["jc"] = sparse.data, sparse.indices.astype("u8"), sparse.indptr.astype("u8")
        return ["model.mat"], False
    for role, matrix in roles.items():
        path = place / f"{role}.dat"
        if kind == "array":
            scipy.io.mmwrite("matrix.mtx", matrix, symmetry="general", precision=17)
            os.rename("matrix.mtx", path)
        elif kind == "coordinate":
            scipy.io.mmwrite("matrix.mtx", scipy.sparse.coo_array(matrix), symmetry="symmetric", precision=17)
            os.rename("matrix.mtx", path)
        elif kind.startswith("abaqus"):
            labelled(path, matrix, part={"abaqus": np.tril, "abaqus upper": np.triu, "abaqus both": np.array}[kind])
        elif kind == "coordinates":
            path.write_text("".join(f"{i + 1} {j + 1}  {matrix[i, j]:.17e}\n" for i, j in zip(*np.nonzero(matrix))))
        elif kind == "hb scipy":
            scipy.io.hb_write(path, scipy.sparse.csc_array(matrix))
        elif kind == "sap":
            sap(path, matrix)
        else:
            harwell_boeing(path, matrix, kind == "hb rhs", kind == "hb touching")
    return [place / f"{role}.dat" for role in roles], kind.startswith("abaqus")


def test_every_format_gives_the_same_numbers(files):
    paths, has_names = files
    assert convert(paths, units="N,m,s", dofs=None if has_names else "x,y,rz") == 0
    for name, matrix in (("mass", M), ("stiffness", K), ("damping", C)):
        assert np.allclose(written(name), matrix, rtol=1e-14, atol=0), name
    assert [direction for _, _, direction in names()] == 2 * PLANE
    assert [node for _, node, _ in names()] == (["7"] * 3 + ["12"] * 3 if has_names else ["1"] * 3 + ["2"] * 3)


def test_files_have_17_digits_and_one_triangle(place):
    scipy.io.savemat("model.mat", {"M": M, "K": K})
    assert convert(["model.mat"], units="N,m,s", dofs="x,y,rz") == 0
    assert open("model/stiffness.mtx").readline().split()[-2:] == ["real", "symmetric"]
    assert np.array_equal(written("stiffness"), K)
    assert len(open("model/stiffness.mtx").read().split("\n")) == 3 + len(lower(K)) + 1


def test_units_scale_each_direction(place):
    """A spring of 1 kip/in, 1 kip·in/rad, and 1 kip/rad between them; the mass is 1 kip·s²/in."""
    labelled(place / "k_stif.mtx", np.kron(np.eye(2), [[2.0, 0, 1], [0, 1, 0], [1, 0, 2]]))
    labelled(place / "m_mass.mtx", np.eye(6))
    labelled(place / "c_dmpv.mtx", np.eye(6))
    given = ["k_stif.mtx", "m_mass.mtx", "c_dmpv.mtx"]
    assert convert(given, units="kip,in,ms") == 0
    kip, inch = 4448.2216152605, 0.0254
    expected = np.array([[2 * kip / inch, 0, kip], [0, kip / inch, 0], [kip, 0, 2 * kip * inch]])
    assert np.allclose(written("stiffness"), np.kron(np.eye(2), expected), rtol=1e-14)
    mass = np.tile([kip / inch, kip / inch, kip * inch], 2)
    assert np.allclose(np.diag(written("mass")), 1e-6 * mass, rtol=1e-14)
    assert np.allclose(np.diag(written("damping")), 1e-3 * mass, rtol=1e-14)


def toml(out="model"):
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib
    with open(f"{out}/model.toml", "rb") as file:
        return tomllib.load(file)


def test_many_dofs_keep_their_numbers(place):
    size = 100_000
    save(M=scipy.sparse.eye(size, format="csc"), K=scipy.sparse.eye(size, format="csc"))
    assert convert(["model.mat"], units="N,m,s", dofs="x,rz") == 0
    structure = toml()["structure"]
    assert structure["rotations"] == list(range(2, size + 1, 2))
    assert structure["matrices"]["influence"] == [1, 0] * (size // 2)


def test_c_of_a_state_space_is_no_damping(place):
    save(M=M, K=K, C=K[:2])
    assert convert(["model.mat"], dofs="x,y,rz") == 0
    assert not (place / "model/damping.mtx").exists()


def test_influence_follows_the_direction(place):
    scipy.io.savemat("model.mat", {"M": M, "K": K})
    for direction, influence in (("x", [1, 0, 0, 1, 0, 0]), ("y", [0, 1, 0, 0, 1, 0])):
        assert convert(["model.mat"], out=direction, dofs="x,y,rz", direction=direction) == 0
        structure = toml(direction)["structure"]
        assert structure["matrices"]["influence"] == influence
        assert structure["rotations"] == [3, 6]
        assert "damping_file" not in structure["matrices"]


def test_mapping_of_ansys_names_the_rows(place):
    for name, title, matrix in (("1", "Mass", M), ("2", "Stiffness", K)):
        harwell_boeing(
            place / f"{name}.matrix", matrix, title=f"{title} matrix from ANSYS FULL file dumped into Harwell-Boeing format"
        )
    labels = ["UX", "UY", "ROTZ"]
    rows = [f"{3 * node + at + 1:10d}{node + 5:10d}   {label}" for node in range(2) for at, label in enumerate(labels)]
    (place / "1.mapping").write_text("    Matrix Eqn          Node    DOF     \n" + "\n".join(rows) + "\n")
    assert convert(["1.matrix", "2.matrix", "1.mapping"]) == 0
    assert names() == [[str(3 * n + i + 1), str(n + 5), PLANE[i]] for n in range(2) for i in range(3)]
    assert np.allclose(written("stiffness"), 1e3 * K, rtol=1e-14)


def test_joints_of_sap2000_name_the_rows(place):
    sap(place / "frame.TXK", K)
    massless = M.copy()
    massless[5, 5] = 0  # the file of the mass then ends with equation 5
    sap(place / "frame.TXM", massless)
    head = "Joint\tU1\tU2\tU3\tR1\tR2\tR3\n"
    joints = "1\t0\t0\t0\t0\t0\t\n0\nA 2\t4\t5\t-1\t0\t0\t\n6\n~3\t1\t2\t0\t0\t0\t3\n"
    (place / "frame.TXE").write_text(head + joints + "CDIAPH1\t4\t5\t0\t0\t0\t6\n")
    assert convert(["frame.TXE", "frame.TXK", "frame.TXM"]) == 0
    assert np.allclose(written("mass"), 1e3 * massless)
    lines = open("model/dofs.csv").read().splitlines()[1:]
    assert lines == ["1,~3,x", "2,~3,y", "3,~3,rz", "4,A 2,x", "5,A 2,y", "6,A 2,rz"]


def test_names_cannot_end_a_comment(place):
    path = place / "k\nb = 1.mtx"
    labelled(path, K)
    labelled(place / "m.mtx", M)
    assert convert([path, "m.mtx"], stiffness=path.name) == 0
    assert list(toml()) == ["title", "time", "structure", "excitation"]


def test_supports_of_abaqus_are_left_out(place, capsys):
    """Abaqus writes 1e36 for a support, and no rows of zeros."""
    stiffness, mass = K.copy(), M.copy()
    stiffness[1, 1] = 1e36
    mass[4, 4] = 0
    labelled(place / "k.mtx", stiffness)
    labelled(place / "m.mtx", mass)
    assert convert(["k.mtx", "m.mtx"]) == 0
    kept = [0, 2, 3, 4, 5]
    assert np.allclose(written("stiffness"), 1e3 * stiffness[np.ix_(kept, kept)])
    assert np.allclose(written("mass"), 1e3 * mass[np.ix_(kept, kept)])
    assert [name[1:] for name in names()] == [["7", "x"], ["7", "rz"], ["12", "x"], ["12", "y"], ["12", "rz"]]
    assert "7.y" in capsys.readouterr().out
    assert "7.y" in open("model/model.toml").read()


def test_rows_of_zeros_are_left_out(place, capsys):
    wider = np.zeros((9, 9))
    wider[:6, :6] = K
    save(K=wider, M=np.pad(M, (0, 3)), C=np.pad(C, (0, 3)))
    assert convert(["model.mat"], dofs="x,y,rz") == 0
    assert written("stiffness").shape == written("mass").shape == written("damping").shape == (6, 6)
    assert "3.x, 3.y, 3.rz" in capsys.readouterr().out


def save(**matrices):
    scipy.io.savemat("model.mat", matrices)


def changed(matrix, *entries):
    new = matrix.copy()
    for row, column, value in entries:
        new[row, column] = value
    return new


@pytest.mark.parametrize(
    ("matrices", "words"),
    [
        ({"M": M}, ["stiffness", "--stiffness"]),
        ({"M": M, "K": K, "mass": M}, ["2", "M, mass", "--mass"]),
        ({"M": M, "K": K[:5, :5]}, ["6", "5"]),
        ({"M": M, "K": K[:5]}, ["K", "5 rows", "6 columns"]),
        ({"M": M, "K": changed(K, (3, 0, -450.1))}, ["row 1 (1.x)", "column 4 (2.x)", "-450.1"]),
        ({"M": M, "K": changed(K, (1, 4, np.nan))}, ["(2, 5)", "nan"]),
        ({"M": changed(M, (3, 3, -1.0)), "K": K}, ["4 (2.x)", "-1000"]),
        ({"M": changed(M, (0, 3, 1.5), (3, 0, 1.5)), "K": K}, ["1 (1.x)", "4 (2.x)"]),
        ({"M": M, "K": K + 1j}, ["K", "complex"]),
        ({"M": M, "K": np.diag([1e36] * 6)}, ["1e30"]),
    ],
)
def test_wrong_matrices_are_refused(place, capsys, matrices, words):
    save(**matrices)
    assert convert(["model.mat"], dofs="x,y,rz") == 2
    told = capsys.readouterr()
    assert told.err.startswith("error: ") and told.out == ""
    for word in words:
        assert word in told.err, told.err
    assert not (place / "model").exists()


def test_small_asymmetry_is_averaged(place):
    save(M=M, K=changed(K, (3, 0, -450.0 + 1e-7)))
    assert convert(["model.mat"], units="N,m,s", dofs="x,y,rz") == 0
    assert written("stiffness")[3, 0] == pytest.approx(-450.0 + 0.5e-7, abs=1e-12)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"dofs": None}, ["6 degrees", "--dofs"]),
        ({"dofs": "x,y,z,rz"}, ["4 directions", "6"]),
        ({"dofs": "x,y,phi"}, ["'phi'", "rx"]),
        ({"units": "kN,m"}, ["2 units"]),
        ({"units": "kN,yd,s"}, ["'yd'", "length", "mm"]),
        ({"direction": "z"}, ["z", "2 in x, 2 in y, 2 in rz"]),
        ({"direction": "rz"}, ["x, y or z"]),
        ({"mass": "Q"}, ["--mass Q", "M, K"]),
        ({"mass": "K"}, ["K", "two matrices"]),
        ({"files": ["model.mat", "k.mtx"], "stiffness": "k.mtx"}, ["k.mtx", "--dofs"]),
        ({"files": ["model.mat", "k.mtx"], "stiffness": "k.mtx", "dofs": None}, ["k.mtx"]),
        ({"files": ["none.mat"]}, ["none.mat"]),
        ({"out": "."}, ["--out .", "empty"]),
    ],
)
def test_wrong_options_are_refused(place, capsys, options, words):
    save(M=M, K=K)
    labelled(place / "k.mtx", K)
    assert convert(**{"files": ["model.mat"], "dofs": "x,y,rz", **options}) == 2
    told = capsys.readouterr().err
    for word in words:
        assert word in told, told


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", ["no numbers"]),
        (b"\x00\x01\x02 binary", ["format"]),
        (b"MATLAB 5.0 MAT-file" + b"\xff" * 300, ["cannot be read"]),
        (b"\x89HDF\r\n\x1a\n" + b"\x07" * 600, ["cannot be read"]),
        (b"%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1 0\n", ["complex"]),
        (b"%%MatrixMarket matrix coordinate real general\n999999999 999999999 1\n1 1 1\n", ["999999999", "100000"]),
        (b"%%MatrixMarket matrix array real general\n2 2\n1\n2\n", ["cannot be read"]),
        (b"a girder bridge of three spans\n", ["line 1", "Abaqus"]),
        (b"1 1 5.0\n1 two 5.0\n", ["line 2", "'1 two 5.0'"]),
        (b"0 1 5.0\n", ["0", "1"]),
        (b"1 1 5.0\n1 1 6.0\n", ["twice"]),
        (b"1 1 5.0\n2000000 1 6.0\n", ["2000000"]),
        (b"-1,1, -1,1, 5.0\n", ["-1", "internal"]),
        (b"** Abaqus\n4,11, 4,11, 5.0\n", ["freedom 11 of node 4"]),
        (b"1,1, 1,1, five\n", ["line 1"]),
        (b"title\n 1 1 1 1 0\nPSA 1 1 1 0\n(I8) (I8) (D8.1)\n", ["PSA"]),
        (b"title\n 3 2 1 1 0\nRSA 1 1 1 0\n(I8) (I8) (D8.1)\n1\n2\n1\n", ["0 numbers"]),
        (b"Row\tColumn\tValue\n", ["no entries"]),
    ],
)
def test_bytes_that_are_no_matrix_are_refused(place, capsys, content, words):
    (place / "k.dat").write_bytes(content)
    save(M=M)
    assert convert(["model.mat", "k.dat"], dofs="x,y,rz") == 2
    told = capsys.readouterr().err
    assert "k.dat" in told and "Traceback" not in told
    for word in words:
        assert word in told, told


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.TXE", "Joint U1 U2 U3 R1 R2 R3\n7 1 2 3 4 5 six\n", ["joint 7", "six"]),
        ("a.TXE", "Joint U1 U2 U3 R1 R2 R3\n7 1 2 3\n", ["joint 7", "1 2 3"]),
        ("a.TXE", "Joint U1 U2 U3 R1 R2 R3\n1 1 1 0 0 0 0\n", ["equation 1", "y of joint 1"]),
        ("a.TXE", "Joint U1 U2 U3 R1 R2 R3\n1 1 3 0 0 0 0\n", ["equation 2"]),
        ("a.TXE", "Joint U1 U2 U3 R1 R2 R3\n1 1 2 0 0 0 3\n", ["6 rows", "3"]),
        ("a.mapping", "1 5 UX\n2 5 TEMP\n", ["line 2", "TEMP"]),
    ],
)
def test_wrong_names_are_refused(place, capsys, name, text, words):
    save(M=M, K=K)
    (place / name).write_text(text)
    assert convert(["model.mat", name]) == 2
    told = capsys.readouterr().err
    for word in words:
        assert word in told, told


def test_damage_never_gives_a_traceback(place, capsys):
    """Every format, cut at many places and with single bytes replaced."""
    rng = np.random.default_rng(54)
    labelled(place / "k.labelled", K)
    harwell_boeing(place / "k.hb", K)
    sap(place / "k.txk", K)
    scipy.io.mmwrite(place / "k.mtx", scipy.sparse.coo_array(K))
    scipy.io.savemat("k.mat", {"K": scipy.sparse.csc_array(K)})
    save(M=M)
    h5py = pytest.importorskip("h5py")
    with h5py.File("k.h5", "w") as file:
        file["K"] = K
    for name in ("k.labelled", "k.hb", "k.txk", "k.mtx", "k.mat", "k.h5"):
        whole = bytearray((place / name).read_bytes())
        for attempt in range(40):
            content = bytearray(whole)
            for at in rng.integers(0, len(content), 3):
                content[at] = rng.integers(0, 256)
            if attempt % 2:
                content = content[: rng.integers(1, len(content))]
            (place / "stiffness.dat").write_bytes(content)
            assert convert(["model.mat", "stiffness.dat"], out=f"{name}-{attempt}", dofs="x,y,rz") in (0, 2)
    assert "Traceback" not in capsys.readouterr().err


def test_missing_package_is_named(place, capsys, monkeypatch):
    for module in [name for name in sys.modules if name.startswith("gusset.importer.matrices")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "scipy", None)
    assert convert(["model.mat"]) == 2
    assert "scipy" in capsys.readouterr().err


def test_command_writes_a_test_that_runs(place):
    """Through the program: its options are those of the importer, and its check and its run accept what that writes."""
    save(M=M, K=K, C=C)
    arguments = ["import", "matrices", "model.mat", "--units", "kN,m,s", "--dofs", "x,y,rz", "--out", "frame"]
    environment = {**os.environ, "GUSSET_PYTHON": sys.executable}
    done = subprocess.run([gusset.binary(), *arguments], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    assert gusset.check("frame/model.toml").is_allowed
    run = gusset.run("frame/model.toml", set={"time.duration_s": 1}, out="run")
    assert run["disp"].shape[1] == 6
    assert abs(run["disp", 4]).max() > 0
    refused = subprocess.run([gusset.binary(), *arguments], env=environment, capture_output=True, text=True)
    assert refused.returncode == 2 and "frame" in refused.stderr

# SPDX-License-Identifier: MIT
"""gonio model: the reference tables through the program, identities, what is refused and how it is said."""
import csv
import json
import math
import random
import subprocess
import time

import pytest

from conftest import BUILD, ROOT, gonio

GOLDEN = ROOT / "tests" / "golden"
ELEMENTS = [f"f{j}{k}" for j in range(4) for k in range(4)]
PAINT = ("--n", "1.5", "--k", "0.02", "--sigma", "0.15", "--ks", "0.9", "--kd", "0.05")


def table(text):
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


def model(path, *options):
    r = gonio("model", path, *options)
    assert r.returncode == 0 and r.stderr == "", r
    return table(r.stdout)


def write(path, text):
    path.write_bytes(text.encode())
    return path


def diffuse_per_sr(row):
    return float(row.get("kd", 0)) / math.cos(math.radians(float(row["theta_i_deg"])))


@pytest.mark.parametrize("name", ["golden_mueller.csv", "golden_edge.csv", "golden_inplane.csv"])
def test_reference_tables(name):
    want = table((GOLDEN / name).read_text())
    got = model(GOLDEN / name)
    assert len(got) == len(want)
    worst = 0
    for w, g in zip(want, got):
        f00, kd = float(w["f00"]), diffuse_per_sr(w)
        for element in ELEMENTS:
            if element in w:
                error = abs(float(g[element]) - float(w[element])) - 4e-16 * f00  # the table's rounding
                assert error <= 1e-10 * (f00 - kd)
                worst = max(worst, error / f00)
        for column in ("id", "theta_i_deg", "theta_r_deg", "theta_r_signed_deg", "dphi_deg"):
            assert g.get(column) == w.get(column)
    print(f"{name}: worst {worst:.2g} f00")


def test_terms_and_traps_as_options_and_columns():
    for row in table((GOLDEN / "golden_terms.csv").read_text())[:3]:
        assert row["n"] and row["sigma"]
    got = model(GOLDEN / "golden_terms.csv", "--ks", "1", "--kd", "0")
    for w, g in zip(table((GOLDEN / "golden_terms.csv").read_text()), got):
        s = {k: complex(float(w[f"S{k}_re"]), float(w[f"S{k}_im"])) for k in ("ss", "pp", "ps", "sp")}
        f00 = float(w["pre"]) * sum(abs(x) ** 2 for x in s.values()) / 2
        assert math.isclose(float(g["f00"]), f00, rel_tol=1e-10)
    traps = table((GOLDEN / "golden_traps.csv").read_text())
    for w, g in zip(traps, model(GOLDEN / "golden_traps.csv", "--ks=1", "--kd=0")):
        assert math.isclose(float(g["f00"]), float(w["f00_correct"]), rel_tol=1e-10)


def test_identities(tmp_path):
    rng = random.Random(3)
    print("seed 3")
    rows = [(rng.uniform(0, 89.9), rng.uniform(0, 89.9), rng.uniform(-180, 180)) for _ in range(2000)]

    def run(name, angles):
        lines = ["theta_i_deg,theta_r_deg,dphi_deg"] + [",".join(map(repr, a)) for a in angles]
        out = model(write(tmp_path / name, "\n".join(lines)), "--n", "1.3", "--k", "7.5", "--sigma", "0.3",
                    "--ks", "1", "--kd", "0")
        return [[[float(r[f"f{j}{k}"]) for k in range(4)] for j in range(4)] for r in out]

    f = run("there.csv", rows)
    mirror = run("mirror.csv", [(i, r, -d) for i, r, d in rows])
    back = run("back.csv", [(r, i, -d) for i, r, d in rows])
    p, q = (1, 1, -1, -1), (1, 1, -1, 1)
    for a, m, b in zip(f, mirror, back):
        unit = a[0][0]
        if unit < 1e-290:
            continue  # the exponential has underflown
        assert abs(sum((x / unit) ** 2 for row in a for x in row) / 4 - 1) <= 2e-14
        for j in range(4):
            for k in range(4):
                assert abs(a[j][k] - p[j] * p[k] * m[j][k]) <= 2e-14 * unit
                assert abs(a[j][k] - q[j] * q[k] * b[k][j]) <= 2e-14 * unit


def test_output_is_csv_in_the_order_of_the_input(tmp_path):
    path = write(tmp_path / "a.csv", "note,theta_r_deg,id,dphi_deg,theta_i_deg\nx,20.10,b 7,180,+30\n"
                 '"y, z",45,"a,1",-3e1,45.0\n')
    r = gonio("model", path, *PAINT)
    assert r.returncode == 0
    lines = r.stdout.splitlines()
    assert lines[0] == "id,theta_i_deg,theta_r_deg,dphi_deg," + ",".join(ELEMENTS)
    assert lines[1].startswith("b 7,+30,20.10,180,0.") and lines[2].startswith('"a,1",45.0,45,-3e1,0.')
    assert len(lines) == 3 and all(len(row) == 20 for row in csv.reader(lines))
    value = lines[1].split(",")[4]
    assert repr(float(value)) == value or len(value.strip("0.")) >= 16  # 17 digits


def test_signed_angles_are_their_half_planes(tmp_path):
    signed = model(write(tmp_path / "s.csv", "theta_i_deg,theta_r_signed_deg\n30,40\n30,-40\n30,0\n"), *PAINT)
    plain = model(write(tmp_path / "p.csv", "theta_i_deg,theta_r_deg,dphi_deg\n30,40,180\n30,40,0\n30,0,180\n"),
                  *PAINT)
    turned = model(write(tmp_path / "t.csv", "theta_i_deg,theta_r_deg,dphi_deg\n30,40,-540\n30,40,7200\n30,0,180\n"),
                   *PAINT)
    for a, b, c in zip(signed, plain, turned):
        assert [a[e] for e in ELEMENTS] == [b[e] for e in ELEMENTS] == [c[e] for e in ELEMENTS]
        assert all(a[e] == "0" for e in ("f02", "f03", "f12", "f13", "f20", "f21", "f30", "f31"))
    assert "dphi_deg" not in signed[0] and signed[1]["theta_r_signed_deg"] == "-40"


def test_an_option_goes_before_a_column(tmp_path):
    path = write(tmp_path / "a.csv", "theta_i_deg,theta_r_signed_deg,n,k,sigma,ks,kd\n30,60,1.5,0,0.1,1,0.2\n")
    own = float(model(path)[0]["f00"])
    none = float(model(path, "--kd", "0")[0]["f00"])
    assert math.isclose(own - none, 0.2 / math.cos(math.radians(30)), rel_tol=1e-12)
    lambert = float(model(path, "--diffuse", "lambert")[0]["f00"])
    assert math.isclose(lambert - none, 0.2 / math.pi, rel_tol=1e-12)


def test_crlf_bom_comments_and_blank_lines(tmp_path):
    plain = "theta_i_deg,theta_r_signed_deg\n10,20\n30,-5\n"
    dressed = "\ufeff# made by hand\r\ntheta_i_deg, theta_r_signed_deg\r\n\r\n10,20\r\n# half way\r\n30 , -5"
    assert model(write(tmp_path / "a.csv", plain), *PAINT) == model(write(tmp_path / "b.csv", dressed), *PAINT)


def test_standard_input():
    text = "theta_i_deg,theta_r_signed_deg\n10,20\n"
    r = gonio("model", "-", *PAINT, stdin=text)
    assert r.returncode == 0 and r.stdout.startswith("theta_i_deg,theta_r_signed_deg,f00")
    r = gonio("model", "-", stdin=text)
    assert r.returncode == 2 and "standard input:1: no column 'n'" in r.stderr
    readings = (GOLDEN / "golden_fit_a.csv").read_text()
    assert gonio("fit", "-", "--seed", "1", stdin=readings).returncode == 0


def test_json_has_the_same_numbers(tmp_path):
    path = write(tmp_path / "a.csv", 'id,theta_i_deg,theta_r_deg,dphi_deg\n"q\\""",.5,+20,-30\n7,0,0,0\n')
    rows = model(path, *PAINT)
    r = gonio("model", path, *PAINT, "--json", "--diffuse", "lambert")
    assert r.returncode == 0
    assert json.loads(r.stdout)["diffuse"] == "lambert"
    o = json.loads(gonio("model", path, *PAINT, "--json").stdout)
    assert o["diffuse"] == "paper" and len(o["rows"]) == 2
    for want, got in zip(rows, o["rows"]):
        assert set(got) == set(want)
        assert all(got[c] == float(want[c]) for c in want if c != "id")
    assert o["rows"][1]["id"] == "7"
    empty = write(tmp_path / "e.csv", "theta_i_deg,theta_r_signed_deg\n")
    assert json.loads(gonio("model", empty, *PAINT, "--json").stdout)["rows"] == []
    assert model(empty, *PAINT) == []


HEAD = "theta_i_deg,theta_r_deg,dphi_deg,n,k,sigma,ks,kd\n"
GOOD = "30,30,180,1.5,0,0.1,1,0\n"


@pytest.mark.parametrize("text, options, says", [
    (GOOD.replace("30,30", "30,90", 1), (), ":3: theta_r_deg = 90: out of range; allowed 0..90 (90 excluded) deg"),
    (GOOD.replace("30,", "-1,", 1), (), ":3: theta_i_deg = -1: out of range"),
    (GOOD.replace("180", "inf"), (), ":3: dphi_deg = inf: not a number"),
    (GOOD.replace("180", ""), (), ":3: dphi_deg = : an empty field"),
    (GOOD.replace("1.5", "0"), (), ":3: n = 0: out of range; allowed 0..1e50 (0 excluded)"),
    (GOOD.replace("1.5", "-2"), (), ":3: n = -2: out of range"),
    (GOOD.replace("1.5", "1,5"), (), ":3: 9 fields where the header names 8 (a decimal comma?"),
    (GOOD.replace("1.5,0", "1.5,-0.1"), (), ":3: k = -0.1: out of range; allowed 0..1e50"),
    (GOOD.replace("0.1", "0"), (), ":3: sigma = 0: out of range; allowed 1e-50..1e50"),
    (GOOD.replace("0.1", "nan"), (), ":3: sigma = nan: not a number"),
    (GOOD.replace("0.1", "0x1"), (), ":3: sigma = 0x1: not a number"),
    (GOOD.replace("0.1,1", "0.1,-1"), (), ":3: ks = -1: out of range; allowed 0..1e50"),
    (GOOD.replace("1,0\n", "1,-1\n"), (), ":3: kd = -1: out of range"),
    (GOOD.replace("1,0\n", "1,1e999\n"), (), ":3: kd = 1e999: too large"),
    (GOOD.replace(",0\n", "\n"), (), ":3: 7 fields where the header names 8"),
    (GOOD, ("--sigma", "0"), "--sigma 0 is out of range; allowed 1e-50..1e50"),
    (GOOD, ("--n", "x"), "--n 'x' is not a number"),
    (GOOD, ("--diffuse", "lamberd"), "--diffuse 'lamberd': did you mean 'lambert'? allowed: paper, lambert"),
    (GOOD, ("--sgima", "1"), "did you mean '--sigma'?"),
])
def test_a_mistake_is_said_and_nothing_is_printed(tmp_path, text, options, says):
    path = write(tmp_path / "a.csv", HEAD + GOOD + text)
    r = gonio("model", path, *options)
    assert r.returncode == 2 and r.stdout == "" and says in r.stderr, r
    if says.startswith(":3"):
        assert f"{path}{says}" in r.stderr


@pytest.mark.parametrize("header, says", [
    ("# a comment\ntheta_i_deg,theta_r_deg,dphi_deg,n,k,ks,kd\n", ":2: no column 'sigma'"),
    ("theta_i_deg,theta_r_deg,dphi_deg,n,k,sgima,ks,kd\n", ":1: no column 'sigma'; rename 'sgima' to it; or give --sigma"),
    ("theta_i_deg,theta_r_deg,n,k,sigma,ks,kd\n", ":1: no column 'dphi_deg'"),
    ("theta_i_deg,n,k,sigma,ks,kd\n", ":1: no column 'theta_r_signed_deg'"),
    ("theta_r_deg,dphi_deg,n,k,sigma,ks,kd\n", ":1: no column 'theta_i_deg'"),
    (HEAD.replace("k,", "n,"), ":1: column 'n' is there twice"),
    ("", ":1: empty; the first line must name the columns"),
    (HEAD.replace(",", ";"), ":1: fields are separated by ';' or tabs"),
])
def test_a_wrong_header_is_said(tmp_path, header, says):
    path = write(tmp_path / "a.csv", header)
    r = gonio("model", path)
    assert r.returncode == 2 and r.stdout == "" and f"{path}{says}" in r.stderr, r


def test_files_that_are_not_there(tmp_path):
    for args in ([tmp_path / "no.csv"], [tmp_path], [], ["a", "b"]):
        r = gonio("model", *args)
        assert r.returncode == 2 and r.stdout == "" and r.stderr


def test_many_rows(tmp_path):
    rng = random.Random(5)
    rows = "".join(f"{rng.uniform(0, 89):.3f},{rng.uniform(0, 89):.3f},{rng.uniform(-180, 180):.3f}\n"
                   for _ in range(200_000))
    path = write(tmp_path / "big.csv", "theta_i_deg,theta_r_deg,dphi_deg\n" + rows)
    start = time.monotonic()
    with open(tmp_path / "out.csv", "wb") as out:
        r = subprocess.run([BUILD / "gonio", "model", path, *PAINT], stdout=out, timeout=60)
    elapsed = time.monotonic() - start
    print(f"200000 rows in {elapsed:.2f} s")
    assert r.returncode == 0 and elapsed < 10  # 0.5 s alone; the rest is for a loaded machine
    with open(tmp_path / "out.csv") as out:
        assert sum(1 for _ in out) == 200_001

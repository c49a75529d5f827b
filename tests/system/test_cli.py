# SPDX-License-Identifier: MIT
"""The verbs that need no daemon: help, check, plan, fit, list, and what a wrong command line gets."""
import csv
import io
import json
import math
import re
import subprocess

import pytest

from conftest import BUILD, ROOT, SMALL, gonio

GOLDEN = ROOT / "tests" / "golden"


def write(path, text):
    path.write_text(text)
    return path


def test_help_names_every_verb():
    r = gonio("help")
    assert r.returncode == 0 and r.stderr == ""
    verbs = [line.split()[0] for line in r.stdout.splitlines() if line.startswith("  ")]
    assert verbs == ["plan", "run", "watch", "status", "devices", "stop", "laser", "pause", "resume", "ack", "queue",
                     "control", "list", "show", "exclude", "restore", "remeasure", "verify", "backup", "fit", "model",
                     "check", "doctor", "profile"]
    for verb in verbs:
        r = gonio("help", verb)
        assert r.returncode == 0 and f"usage: gonio {verb}" in r.stdout
        assert gonio(verb, "--help").stdout == r.stdout


def test_version():
    assert gonio("--version").stdout.startswith("gonio 0.")


@pytest.mark.parametrize("args, says", [
    ([], "usage: gonio VERB"),
    (["plna"], "did you mean 'plan'?"),
    (["frobnicate"], "no verb 'frobnicate'; gonio help lists all"),
    (["plan"], "needs CAMPAIGN.cfg; see: gonio help plan"),
    (["plan", "a.cfg", "b.cfg"], "'b.cfg' is one argument too many"),
    (["fit", "--sed", "1"], "did you mean '--seed'?"),
    (["fit", "x.csv", "--threads", "0"], "--threads 0 is out of range; allowed 1..64"),
    (["fit", "x.csv", "--seed", "-1"], "--seed -1 is out of range; allowed 0..4294967295"),
    (["fit", ""], "fit: DATA is an empty word"),
    (["resume", ""], "is an empty word; see: gonio help resume"),
    (["help", "statsu"], "did you mean 'status'?"),
])
def test_wrong_command_lines_say_what_was_meant(args, says):
    r = gonio(*args)
    assert r.returncode == 2 and says in r.stderr and r.stdout == ""


def test_plan_of_the_paper():
    r = gonio("plan", ROOT / "configs" / "paper.cfg", "--json")
    assert r.returncode == 0, r.stderr
    plan = json.loads(r.stdout)
    assert plan["sample_points"] == 850 and plan["sweep_count"] == 10
    assert [s["theta_i_deg"] for s in plan["sweeps"]] == [0, 5, 10, 20, 30, 40, 45, 50, 55, 60]
    dense = [p["theta_r_deg"] for p in plan["order"] if p["sweep"] == 10 and p["dense"]]
    assert len(dense) == 21 and min(dense) == 55 and max(dense) == 65
    assert plan["duration_s"] is None
    kinds = [p["kind"] for p in plan["order"]]
    assert kinds[:2] == ["dark", "beam"] and kinds[-2:] == ["beam", "dark"]


def test_plan_shows_the_states_and_what_the_bench_has_not(tmp_path):
    text = SMALL.replace("theta_i_deg", 'pol_in = ("s", "p"); pol_out = ("u", "s"); theta_i_deg')
    config = write(tmp_path / "states.cfg", text)
    r = gonio("plan", config, "--bench", ROOT / "configs" / "goniod.cfg")
    assert "each sweep in 4 states of polarisation, one after the other: s, s>s, p, p>s" in r.stderr
    assert 'pol_in = "p", but the bench says that its laser is' in r.stderr
    plan = json.loads(gonio("plan", config, "--json").stdout)
    assert plan["states"] == [{"pol_in": i, "pol_out": o} for i in "sp" for o in "us"]
    assert [(p["kind"], p["pol_in"]) for p in plan["order"][:3]] == [("dark", "s"), ("beam", "s"), ("beam", "p")]
    first = [p["pol_in"] + p["pol_out"] for p in plan["order"] if p["sweep"] == 1]
    assert first == sorted(first, key=["su", "ss", "pu", "ps"].index)  # all of one state before the next


def test_plan_is_a_table_in_a_pipe():
    r = gonio("plan", ROOT / "configs" / "paper.cfg")
    assert r.returncode == 0
    rows = [line.split("\t") for line in r.stdout.splitlines()]
    assert rows[0][:4] == ["sweep", "theta_i_deg", "points", "dense"] and len(rows) == 11
    assert sum(int(row[2]) for row in rows[1:]) == 850
    assert "850 points" in r.stderr and "gonio run" in r.stderr
    assert "\033" not in r.stdout + r.stderr


def test_plan_counts_what_is_skipped_by_reason(tmp_path):
    bench = (ROOT / "configs" / "goniod.cfg").read_text()
    assert bench.count("min = -90.0") == 1
    narrow = write(tmp_path / "goniod.cfg", bench.replace("min = -90.0", "min = -60.0"))
    text = (ROOT / "configs" / "paper.cfg").read_text().replace("readings:", "blind_half_deg = 4; readings:")
    args = ["plan", write(tmp_path / "shadow.cfg", text), "--bench", narrow]
    plan = json.loads(gonio(*args, "--json").stdout)
    rows = [line.split("\t") for line in gonio(*args).stdout.splitlines()[1:]]
    mixed = 0
    for row, sweep in zip(rows, plan["sweeps"], strict=True):
        reasons = [s["reason"] for s in plan["skipped"] if s["sweep"] == sweep["sweep"]]
        counts = {r: reasons.count(r) for r in ("in the detector's shadow", "beyond an axis's limits")}
        assert row[4] == f"{len(reasons)}" and sum(counts.values()) == len(reasons) == sweep["skipped"]
        assert row[5] == ", ".join(f"{n} {r}" for r, n in counts.items() if n), row
        mixed += all(counts.values())
    assert mixed


BAD = """\
campaign: {
  name = "bad";
  theta_r: { from_deg = -85; to_deg = 85; stpe_deg = 2.5; };
  theta_i_deg = [ 0.0, 5.0, 95.0 ];
};
"""


def test_mistakes_name_file_and_line(tmp_path):
    bad = write(tmp_path / "bad.cfg", BAD)
    for verb in ("plan", "check", "run"):
        r = gonio(verb, bad)
        assert r.returncode == 2 and r.stdout == ""
        assert f"{bad}:3: unknown setting 'stpe_deg'" in r.stderr and "did you mean 'step_deg'?" in r.stderr
        assert f"{bad}:4: campaign.theta_i_deg[2] = 95" in r.stderr
        assert "errors, " in r.stderr
    r = gonio("check", bad, "--json")
    report = json.loads(r.stdout)
    assert r.returncode == 2 and len(report["errors"]) >= 2


def test_files_that_are_not_there(tmp_path):
    for args in (["plan", tmp_path / "no.cfg"], ["check", tmp_path], ["fit", tmp_path / "no.csv"],
                 ["show", tmp_path / "no.gonio"], ["show", "77"], ["check", "/dev/null"]):
        r = gonio(*args, env={"GONIO_DIR": str(tmp_path)})
        assert r.returncode == 2 and r.stderr.strip(), (args, r)


def test_check_knows_campaign_and_bench(tmp_path):
    good = write(tmp_path / "small.cfg", SMALL)
    r = gonio("check", good)
    assert r.returncode == 0 and "a good campaign file" in r.stderr
    assert json.loads(gonio("check", good, "--json").stdout) == {"file": str(good), "kind": "campaign", "errors": []}
    bench = write(tmp_path / "b.cfg", "bench: { name = 1; };\n")
    r = gonio("check", bench)
    assert r.returncode == 2 and "b.cfg:1" in r.stderr
    for kind in ("campaign", "bench"):
        r = gonio("check", "--settings", kind)
        assert r.returncode == 0 and len(r.stdout) > 500
    assert gonio("check", "--settings", "x").returncode == 2


def test_a_file_of_another_kind_is_called_so():
    bench, paper, sim = (ROOT / "configs" / f"{name}.cfg" for name in ("goniod", "paper", "sim"))
    for args, says in ((["run", bench], "a bench file, not a campaign file; its use: goniod --config"),
                       (["plan", bench], "a bench file, not a campaign file"),
                       (["plan", paper, "--bench", paper], "a campaign file, not a bench file; its use: gonio run"),
                       (["run", sim], "a simulator file, not a campaign file; its use: goniosim"),
                       (["check", sim], "a simulator file, which goniosim checks when it starts")):
        r = gonio(*args)
        assert r.returncode == 2 and says in r.stderr and len(r.stderr.splitlines()) == 1, r.stderr
    r = gonio("check", ROOT / "configs" / "sim-glossy.cfg", "--json")
    report = json.loads(r.stdout)
    assert r.returncode == 2 and report["kind"] == "simulator" and len(report["errors"]) == 1


def test_check_reads_the_links(tmp_path):
    text = (ROOT / "configs" / "goniod.cfg").read_text()
    changed = text.replace("baud=115200\"", "baud=-1\"").replace("baud=19200", "baut=1").replace("parity=E", "parity=X")
    r = gonio("check", write(tmp_path / "b.cfg", changed))
    lines = r.stderr.splitlines()
    assert r.returncode == 2 and len(lines) == 4, r.stderr
    for line, number, wrong in ((lines[0], 36, "baud=-1"), (lines[1], 16, "parity=X"), (lines[2], 44, "baut=1")):
        assert f"b.cfg:{number}:" in line and f"'{wrong}'" in line, line
    assert gonio("check", write(tmp_path / "b.cfg", text)).returncode == 0


def fit_json(*args):
    r = gonio("fit", *args, "--json")
    assert r.returncode == 0, r.stderr
    return json.loads(r.stdout)


def optimum(name, weighting):
    text = "".join(l for l in open(GOLDEN / "golden_fit_optima.csv") if not l.startswith("#"))
    for row in csv.DictReader(io.StringIO(text)):
        if row["file"] == name and row["weighting"] == weighting:
            return {k: float(v) for k, v in row.items() if k.startswith(("best", "delta", "true"))}
    raise KeyError(name)


def test_fit_finds_the_reference_optimum():
    best = optimum("golden_fit_a.csv", "g1")
    f = fit_json(GOLDEN / "golden_fit_a.csv", "--seed", "3", "--weights", "uniform")
    assert f["points"] == 841 and f["weights"] == "uniform" and f["method"] == "memetic" and f["seed"] == 3
    assert f["delta"] <= best["delta_best"] * 1.001
    assert math.isclose(f["params"]["sigma"]["value"], best["best_sigma"], rel_tol=1e-3)
    assert math.isclose(f["params"]["kd"]["value"], best["best_kd"], rel_tol=1e-2)
    assert set(f) >= {"method", "weights", "points", "seed", "delta", "params", "derived", "correlation",
                      "chi2_per_dof", "evaluations", "elapsed_ms", "elapsed_total_ms", "warnings"}
    for name in ("n", "k", "sigma", "ks", "kd"):
        assert set(f["params"][name]) == {"value", "u", "lo95", "hi95", "identified", "at_bound"}
    assert set(f["derived"]) == {"ks_r0", "ks_r45", "dhr_0", "dhr_45", "dhr_60"}
    assert len(f["correlation"]) == 5 and all(len(row) == 5 for row in f["correlation"])
    assert f["params"]["sigma"]["identified"] and not f["params"]["k"]["identified"]
    assert any("n" in w for w in f["warnings"])
    assert fit_json(GOLDEN / "golden_fit_a.csv", "--seed", "3")["params"] == f["params"]


def test_default_bounds_are_documented():
    text = " ".join(gonio("fit", "--help").stdout.split())
    assert "(n=0.2:8,k=0:10,sigma=0.01:0.6,ks=0:1.5,kd=0:0.5)" in text
    data = GOLDEN / "golden_fit_a.csv"
    told = fit_json(data, "--bounds", "n=0.2:8,k=0:10,sigma=0.01:0.6,ks=0:1.5,kd=0:0.5")
    assert told["params"] == fit_json(data)["params"]
    for page in ("doc/gonio.1.scd", "doc/manual.md"):
        text = " ".join((GOLDEN.parent.parent / page).read_text().split())
        assert "n is sought from 0.2 to 8, k from 0 to 10, sigma from 0.01 to 0.6, ks from 0 to 1.5" in text


def test_fit_speaks_to_people():
    r = gonio("fit", GOLDEN / "golden_fit_a.csv")
    assert r.returncode == 0
    rows = {row[0]: row for row in (line.split("\t") for line in r.stdout.splitlines())}
    assert set(rows) >= {"parameter", "n", "k", "sigma", "ks", "kd", "ks*R(0)", "ks*R(45)", "DHR(0)", "Delta"}
    assert "not identified" in rows["k"][5] and rows["sigma"][5] == ""
    assert abs(float(rows["sigma"][1]) - 0.15) < 0.001 and float(rows["sigma"][2]) > 0
    assert "841 points, uniform weights, memetic, seed 1, " in r.stderr and "warning: " in r.stderr
    r = gonio("fit", GOLDEN / "golden_fit_a.csv", "--weights", "dense:3.5", "--diffuse", "lambert")
    assert "841 points, dense:3.5 weights, lambert diffuse, memetic, seed 1, " in r.stderr


def test_advice_of_no_gain_is_not_given():
    data = (GOLDEN / "golden_fit_a.csv", "--bounds", "n=1.5:1.5,k=0:0,ks=0.9:0.9,sigma=0.15:0.15,kd=0.05:0.05")
    assert fit_json(*data)["advice"][0]["gain"] == 0
    assert "helps most" not in gonio("fit", *data).stdout
    assert "helps most" in gonio("fit", GOLDEN / "golden_fit_a.csv").stdout


def test_held_out_sweeps_are_told_in_plain_percent():
    r = gonio("fit", GOLDEN / "golden_fit_a.csv", "--bounds", "ks=0:0.01,kd=0:0.01", "--hold-out", "30")
    row = next(line for line in r.stdout.splitlines() if line.startswith("held out"))
    assert re.search(r"rms of residual/model \d{3,} %", row), row


def test_fit_options_change_the_fit(tmp_path):
    data = GOLDEN / "golden_fit_a.csv"
    best = optimum("golden_fit_a.csv", "g3")
    assert fit_json(data, "--weights", "dense:3")["delta"] <= best["delta_best"] * 1.001
    few = fit_json(data, "--theta-i-max", "30")
    assert few["points"] < 841
    assert fit_json(data, "--theta-i", "0,10,30")["points"] < few["points"]
    assert fit_json(data, "--theta-i", "0,10,30,45", "--hold-out", "45")["hold_out"]["theta_i_deg"] == [45]
    tight = fit_json(data, "--bounds", "sigma=0.2:0.3")
    assert tight["params"]["sigma"]["at_bound"] and tight["params"]["sigma"]["value"] == 0.2
    held = fit_json(data, "--bounds", "k=0:0,n=1.5:1.5")
    for name, value in (("k", 0), ("n", 1.5)):
        p = held["params"][name]
        assert p["value"] == p["lo95"] == p["hi95"] == value and p["u"] == 0
    r = gonio("fit", data, "--bounds", "k=0:0,n=1.5:1.5")
    assert r.stdout.count("\theld by its bounds\n") == 2 and "separate" not in r.stderr
    trace = tmp_path / "trace.csv"
    fit_json(data, "--trace", trace, "--theta-i-max", "10")
    lines = trace.read_text().splitlines()
    assert lines[0] == "generation,best_delta,mean_delta" and len(lines) > 2
    lambert = fit_json(data, "--diffuse", "lambert", "--theta-i-max", "20")
    assert lambert["params"]["kd"]["value"] > 0.1  # kd/pi instead of kd/cos


@pytest.mark.parametrize("text, says", [
    ("theta_i_deg,theta_r_signed_deg,f_r\n0,1,0\n0,2,0\n", "zero"),
    ("theta_i_deg,theta_r_signed_deg,f_r\n0,1,0.1\n0,2,nan\n", ":3"),
    ("theta_i_deg,theta_r_signed_deg,f_r\n0,1,0.1\n0,2\n", ":3"),
    ("theta_i_deg,theta_r_signed_deg,f_r\n0,1,\n", ":2"),
    ("theta_i_deg,theta_r_signed_deg,f_r\n0,95,1\n", ":2"),
    ("theta_i_deg,theta_r_signed,f_r\n0,5,1\n", "theta_r"),
    ("theta_i_deg,theta_r_signed_deg,f_r\n0,5,1\n0,6,1\n", "points"),
    ("theta_i,theta_r_signed_deg,f_r\n0,5,1\n", ":1: no column 'theta_i_deg'; rename 'theta_i' to it"),
    ("campaign: {\n", ":1: this is no table but looks like a configuration"),
    ("", ""),
])
def test_fit_refuses_what_is_not_data(tmp_path, text, says):
    path = write(tmp_path / "d.csv", text)
    r = gonio("fit", path)
    assert r.returncode == 2 and "d.csv" in r.stderr and says in r.stderr, r.stderr
    assert r.stdout == ""


def test_fit_warns_of_columns_and_angles_that_look_wrong(tmp_path):
    lines = [l for l in open(GOLDEN / "golden_fit_a.csv") if not l.startswith("#")]
    path = write(tmp_path / "d.csv", lines[0].strip() + ",polin\n" + "".join(l.strip() + ",s\n" for l in lines[1:]))
    warning = "Column 'polin' is ignored; did you mean 'pol_in'?"
    assert f"warning: {warning}\n" in gonio("fit", path).stderr
    assert warning in fit_json(path)["warnings"]
    rows = "".join(f"{ti},{tr},{0.1 + 0.01 * tr * ti}\n" for ti in (0, 0.5, 1) for tr in (-1.4, -0.7, 0, 0.6, 1.2))
    path = write(tmp_path / "r.csv", "theta_i_deg,theta_r_signed_deg,f_r\n" + rows)
    assert "are these radians?" in gonio("fit", path).stderr


@pytest.mark.parametrize("args, says", [
    (["--weights", "unifrom"], "did you mean 'uniform'"),
    (["--method", "magic"], "allowed: memetic, paper"),
    (["--bounds", "n=3:1"], "is empty"),
    (["--weights", "variance"], "has no uncertainty for every value (column u_f_r)"),
    (["--bounds", "k=-5:-1"], "--bounds k: -5:-1 is out of range; allowed 0..1000000"),
    (["--column", "nothing"], "nothing"),
    (["--theta-i", "91"], "0..90"),
    (["--theta-i", "1"], ""),
    (["--theta-i", "0,11,30,77"], "--theta-i 11: "),
    (["--theta-i", "0,11,30,77"], "golden_fit_a.csv has no sweep at that theta_i"),
    (["--theta-i", "0,30,45", "--theta-i-max", "40"], "--theta-i 45 is above the largest theta_i, 40 deg"),
    (["--theta-i", "0,30,45", "--hold-out", "45,46"], "--hold-out 46: "),
    (["--bootstrap", "1"], "--bootstrap 1 is out of range; allowed 0, or 40..100000"),
])
def test_fit_refuses_wrong_options(args, says):
    r = gonio("fit", GOLDEN / "golden_fit_a.csv", *args)
    assert r.returncode == 2 and says in r.stderr and r.stdout == "", r


def test_no_daemon_is_status_3_and_says_how_to_start_one(tmp_path):
    env = {"GONIO_SOCKET": str(tmp_path / "none.sock")}
    good = write(tmp_path / "small.cfg", SMALL)
    for args in (["status"], ["stop"], ["pause"], ["resume"], ["resume", "3"], ["watch"], ["run", good]):
        r = gonio(*args, env=env)
        assert r.returncode == 3 and "goniod --sim" in r.stderr and str(tmp_path) in r.stderr, (args, r)
        assert r.stdout == ""


def test_list_of_an_empty_folder(tmp_path):
    r = gonio("list", "--dir", tmp_path)
    assert r.returncode == 0 and r.stdout == "" and "no campaigns" in r.stderr
    assert json.loads(gonio("list", "--dir", tmp_path, "--json").stdout) == []


@pytest.mark.parametrize("args", [
    ("fit", GOLDEN / "golden_fit_a.csv", "--theta-i-max", "10"),
    ("fit", GOLDEN / "golden_fit_a.csv", "--theta-i-max", "10", "--json"),
    ("plan", ROOT / "configs" / "paper.cfg"),
    ("plan", ROOT / "configs" / "paper.cfg", "--json"),
    ("help",),
])
def test_a_full_disk_is_named(args):
    with open("/dev/full", "w") as full:
        r = subprocess.run([BUILD / "gonio", *args], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert r.returncode == 1 and "gonio: standard output: No space left on device\n" in r.stderr, r.stderr

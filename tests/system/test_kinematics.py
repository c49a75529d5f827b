# SPDX-License-Identifier: MIT
"""Benches whose axes are not the angles: the same simulated motors behind other numbers measure the same BRDF, and
what a bench cannot reach the plan says."""
import json
import math
import re

from conftest import QUICK_LASER, gonio, query

CAMPAIGN = """\
campaign: {
  name = "axes";
  theta_i_deg = [ 10.0, 40.0 ];
  theta_r: { from_deg = -60.0; to_deg = 60.0; step_deg = 20.0; };
  dense: { half_width_deg = 1.0; step_deg = 1.0; };
  readings: { count = 4; };
};
"""
# The tilt counts backwards from 7; the second axis is geared 2 to 1 and sits 12.5 off.
KINEMATICS = """
kinematics: { rows = ( { axis = "tilt"; theta_i = -1; offset = 7; },
                       { axis = "gear"; theta_r = 2; offset = -12.5; } ); };
"""


def times(text, name, factor):
    return re.sub(rf"\b{name} = ([0-9.e+-]+);", lambda m: f"{name} = {factor * float(m[1]):.9g}e0;", text)


def geared(bench):
    """goniosim's own bench file with its first two axes counted otherwise."""
    start, tilt, rest = re.split(r'(?=  \{ name = "theta_[ir]"; driver)', bench, maxsplit=2)
    gear, rest = re.split(r'(?=  \{ name = "sample")', rest, maxsplit=1)
    tilt = times(tilt.replace('"theta_i"', '"tilt"'), "steps_per_unit", -1)
    tilt = re.sub(r"min = .*?; max = .*?;", 'min = -81.0; max = 12.0; zero = 7.0; approach = "from-above";', tilt)
    gear = times(gear.replace('"theta_r"', '"gear"'), "steps_per_unit", 0.5)
    gear = re.sub(r"min = .*?; max = .*?;", "min = -372.5; max = 347.5; zero = -12.5;", gear)
    for name in ("speed", "acceleration", "backlash", "deadband"):
        gear = times(gear, name, 2)
    return start + tilt + gear + rest + KINEMATICS


def measured(start_sim, start_daemon, folder, change):
    sim = start_sim("--fast", "--seed", "31", *QUICK_LASER, folder=folder / "bench")
    bench = folder / "goniod.cfg"
    bench.write_text(change((sim.folder / "goniod-tcp.cfg").read_text()))
    config = folder / "axes.cfg"
    config.write_text(CAMPAIGN)
    daemon = start_daemon("--config", bench, folder=folder / "d")
    done = daemon.gonio("run", config, "--json")
    assert done.returncode == 0, (done.stderr[-2000:], daemon.errors()[-2000:])
    (file,) = daemon.directory.glob("*.gonio")
    rows = query(file, "select sweep, point, theta_i_deg, theta_r_signed_deg, f_r, u_A from reading_brdf"
                       " where f_r is not null order by sweep, point")
    return rows, daemon.status()


def test_other_axes_measure_the_same(start_sim, start_daemon, tmp_path):
    direct, _ = measured(start_sim, start_daemon, tmp_path / "direct", lambda bench: bench)
    other, status = measured(start_sim, start_daemon, tmp_path / "geared", geared)
    assert len(direct) == len(other) == 2 * 7 + 3 + 2
    for a, b in zip(direct, other):
        assert a[:2] == b[:2]
        assert abs(a[2] - b[2]) < 0.01 and abs(a[3] - b[3]) < 0.01, (a, b)
        # noise of both, and 0.5 % for the two beams; 0.003 deg beside 1/cos and the peak are less
        assert abs(a[4] - b[4]) <= 6 * math.hypot(a[5], b[5]) + 5e-3 * a[4], (a, b)
    axes = {d["name"]: d for d in status["devices"]}
    assert {"tilt", "gear", "sample"} <= set(axes)
    tilt = axes["tilt"]
    assert abs(tilt["position"] - (7 - tilt["dial"])) < 1e-9
    assert abs(tilt["raw_steps"] - 1000 * tilt["dial"]) < 1e-6


def test_the_plan_names_what_lies_in_and_behind_a_keep_out(start_sim, tmp_path):
    sim = start_sim("--fast")
    bench = tmp_path / "goniod.cfg"
    fence = 'keep_out: ( { name = "laser head"; polygon = ( (-10, 15), (-10, 5), (90, -95), (90, -85) ); } );\n'
    text = (sim.folder / "goniod.cfg").read_text()  # whose park would lie in the fence
    bench.write_text(text.replace('"park"; theta_i_deg = 0.0; theta_r_deg = 0.0', '"park"; theta_i_deg = 0.0; '
                                  'theta_r_deg = 90.0') + fence)
    config = tmp_path / "axes.cfg"
    config.write_text(CAMPAIGN)
    planned = gonio("plan", config, "--bench", bench, "--json")
    assert planned.returncode == 0, planned.stderr
    plan = json.loads(planned.stdout)
    why = {(s["theta_i_deg"], s["theta_r_deg"]): s["reason"] for s in plan["skipped"]}
    assert why[(40.0, -40.0)] == "in a keep-out"
    assert why[(40.0, -60.0)] == why[(10.0, -20.0)] == "cut off by a keep-out"
    assert any('keep-out "laser head"' in w for w in plan["warnings"])
    table = gonio("plan", config, "--bench", bench)
    assert "1 in a keep-out, 1 cut off by a keep-out" in table.stdout


def test_a_bench_that_cannot_be_is_refused_with_its_line(start_sim, tmp_path):
    sim = start_sim("--fast")
    bench = tmp_path / "goniod.cfg"
    text = geared((sim.folder / "goniod.cfg").read_text()).replace("theta_r = 2;", "theta_i = 2;")
    bench.write_text(text)
    checked = gonio("check", bench)
    line = text[:text.index('"gear"; theta_i')].count("\n")
    assert checked.returncode == 2
    assert f"goniod.cfg:{line}: kinematics.rows = ( ... ): no row has a coefficient for theta_r" in checked.stderr

# SPDX-License-Identifier: MIT
"""A campaign with s light without an analyser and p light behind a parallel one, over real ptys: from plan to fit. The
simulator's noise comes as real time does, so a seed does not fix it: n, k and sigma must lie within 6 reported
standard uncertainties of the truth, which for normal deviations of 1.3 of them fails once in 80,000 runs."""
import json

from conftest import QUICK_LASER, query

SAMPLE = {"n": 1.5, "k": 0.8, "sigma": 0.15, "ks": 0.9, "kd": 0.05}
CONFIG = """\
campaign: {
  name = "polarised";
  pol_in = ("s", "p");
  pol_out = ("u", "p");
  pol_combine = "pairs";
  theta_i_deg = [ 10.0, 40.0, 65.0 ];
  theta_r: { from_deg = -40.0; to_deg = 80.0; step_deg = 15.0; };
  dense: { half_width_deg = 2.0; step_deg = 2.0; };
  readings: { count = 2; };
  dark: { count = 60; };
  beam: { count = 40; };
};
"""
CHANNELS = [("s", "u"), ("p", "p")]


def test_s_and_p_light_give_n_and_k_from_plan_to_fit(start_sim, start_daemon, tmp_path):
    sets = [w for name, value in SAMPLE.items() for w in ("--set", f"sample.{name}={value}")]
    sim = start_sim("--fast", "--seed", "31", "--set", "polarisation.elements=true", "--set",
                    "detector.noise_v_per_rthz=3e-8", "--set", "axes.speed=1500", *QUICK_LASER, *sets)
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    config = tmp_path / "polarised.cfg"
    config.write_text(CONFIG)
    plan = daemon.gonio("plan", config, "--bench", sim.folder / "goniod.cfg")
    assert "each sweep in 2 states of polarisation, one after the other: s, p>p" in plan.stderr

    done = daemon.gonio("run", config, "--json")
    assert done.returncode == 0, (done.stderr[-2000:], daemon.errors()[-2000:])
    run = json.loads(daemon.gonio("list", "--json").stdout)[0]
    assert run["state"] == "done"
    fit = json.loads(daemon.gonio("fit", run["id"], "--json").stdout)
    for name, true in SAMPLE.items():
        p = fit["params"][name]
        print(f"{name} = {p['value']:.6f}, u {p['u']:.6f}, {(p['value'] - true) / p['u']:.2f} u off")
        assert p["identified"] and abs(p["value"] - true) < 6 * p["u"], (name, p)
    assert fit["chi2_per_dof"] < 3

    file = daemon.directory / next(f.name for f in daemon.directory.glob("*.gonio"))
    rows = query(file, "SELECT DISTINCT pol_in, pol_out FROM reading_brdf WHERE f_r NOTNULL ORDER BY point")
    assert [tuple(r) for r in rows] == CHANNELS
    beams = query(file, "SELECT sweep, pol_in, pol_out FROM plan WHERE kind = 'beam' ORDER BY sweep, point")
    assert [tuple(r) for r in beams] == [(0, "s", "u"), (0, "p", "u"), (4, "s", "u"), (4, "p", "u")]
    assert query(file, "PRAGMA user_version")[0][0] == 4
    axes = sim.control(do="state")["axes"]
    assert axes["polariser"]["moves"] > 0 and axes["analyser"]["moves"] > 0

    refused = daemon.gonio("run", "--json", write(tmp_path, CONFIG.replace('"s", "p"', '"s", "R"')))
    assert refused.returncode == 2 and 'pol_in = "R", and the bench has only' in refused.stderr


def write(folder, text):
    path = folder / "circular.cfg"
    path.write_text(text)
    return path
